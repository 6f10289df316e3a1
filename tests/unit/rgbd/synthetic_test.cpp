#include <gtest/gtest.h>

#include <random>
#include <set>

#include "rgbd/depth/disparity.h"
#include "rgbd/synthetic/sequences.h"

namespace sherlog::rgbd {
namespace {

using Eigen::Vector3d;

// Slow twin of meeting a body: is a point inside (of the bowl: of its wall)?
bool inside(const Body& body, const Vector3d& world) {
  const Vector3d p = body.pose.inverse() * world, h = body.size / 2;
  switch (body.shape) {
    case BodyShape::kBox:
      return (p.cwiseAbs() - h).maxCoeff() <= 0;
    case BodyShape::kCylinder:
      return std::pow(p.x() / h.x(), 2) + std::pow(p.y() / h.y(), 2) <= 1 && std::abs(p.z()) <= h.z();
    case BodyShape::kCapsule:
      return (p - Vector3d(0, 0, std::clamp(p.z(), -h.z(), h.z()))).norm() <= h.x();
    case BodyShape::kBowl: {
      const double r = Vector3d(p.x() / h.x(), p.y() / h.y(), p.z() / body.size.z()).norm();
      return p.z() <= 0 && r <= 1 && r >= 0.9;
    }
  }
  return false;
}

TEST(Body, IsMetWhereAMarchAlongTheRayFirstGetsInside) {
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> unit(-1, 1);
  for (const BodyShape shape : {BodyShape::kBox, BodyShape::kCylinder, BodyShape::kCapsule, BodyShape::kBowl}) {
    int met = 0;
    for (int round = 0; round < 300; ++round) {
      Body body{.shape = shape,
                .size = Vector3d(0.5 + 0.3 * unit(random), 0.5 + 0.3 * unit(random), 0.5 + 0.3 * unit(random))};
      body.pose.linear() = Eigen::AngleAxisd(3 * unit(random), Vector3d(unit(random), unit(random), 1.1).normalized())
                               .toRotationMatrix();
      body.pose.translation() = 0.3 * Vector3d(unit(random), unit(random), unit(random));
      const Vector3d origin = 2 * Vector3d(unit(random), unit(random), unit(random)).normalized();
      const Vector3d direction = (0.5 * Vector3d(unit(random), unit(random), unit(random)) - origin).normalized();
      double t = 0;
      Vector3d normal;
      const bool hit = meet(body, origin, direction, t, normal);
      double marched = -1;
      for (double s = 0; s < 4; s += 2e-4) {
        if (!inside(body, origin + s * direction)) continue;
        marched = s;
        break;
      }
      if (hit && marched >= 0) {
        EXPECT_NEAR(t, marched, 1e-3);
        EXPECT_LE(normal.dot(direction), 1e-9);
        EXPECT_NEAR(normal.norm(), 1, 1e-9);
        ++met;
      } else {
        // A graze between two steps of the march is all that may differ.
        EXPECT_TRUE(hit == (marched >= 0) || (hit && !inside(body, origin + (t + 4e-4) * direction)));
      }
    }
    EXPECT_GT(met, 60);
  }
}

TEST(Render, ShowsEachBodyWhereItsPointsProjectTo) {
  Scene scene;
  const std::uint16_t ball = scene.add({.name = "ball"});
  scene.bodies.push_back(limb({0.2, 2, 0.1}, {0.2, 2, 0.1}, 0.3, {10, 20, 200}, ball));
  const Calibration c = kinect_calibration(160, 120);
  const Eigen::Isometry3d camera = look_at({0, 0, 0}, {0, 1, 0});
  const View view = render(scene, c, camera);
  // The camera looks along y: x right, z up.
  const Eigen::Vector2d centre = c.pixel(camera.inverse() * Vector3d(0.2, 2, 0.1));
  EXPECT_GT(centre.x(), c.cx);
  EXPECT_LT(centre.y(), c.cy);
  const int x = static_cast<int>(std::lround(centre.x())), y = static_cast<int>(std::lround(centre.y()));
  EXPECT_EQ(view.entities(y, x), ball);
  EXPECT_NEAR(static_cast<double>(view.depth(y, x)), 1.85, 0.002);
  // Every pixel by the slow way: each ray against each body.
  for (int v = 0; v < c.height; ++v) {
    for (int u = 0; u < c.width; ++u) {
      double t = 0;
      Vector3d normal;
      const bool hit = meet(scene.bodies[0], camera.translation(), camera.linear() * c.point(u, v, 1), t, normal);
      ASSERT_EQ(view.entities(v, u), hit ? ball : 0);
      if (hit) {
        ASSERT_NEAR(static_cast<double>(view.depth(v, u)), t, 1e-5);
      }
    }
  }
}

TEST(Sensor, NoiseIsTheSameInStepsNearAndFar) {
  const Calibration c = kinect_calibration(160, 120);
  for (const double metres : {0.9, 1.5, 4.0, 7.0}) {
    View view{cv::Mat1w(c.size(), std::uint16_t{1}), cv::Mat1f(c.size(), static_cast<float>(metres)),
              cv::Mat1b(c.size(), std::uint8_t{255}), cv::Mat1f(c.size(), 1.0F),
              ColourImage(c.size(), cv::Vec3b(100, 100, 100))};
    const Frame frame = measure(view, c, {}, 3, 0);
    double sum = 0, squares = 0, count = 0;
    std::set<std::uint16_t> values;
    for (const std::uint16_t depth : frame.depth) {
      if (depth == 0) continue;
      const double error = normalised_disparity(depth) - normalised_disparity(metres * 1000);
      if (std::abs(error) > 3) continue;  // an outlier
      sum += error;
      squares += error * error;
      ++count;
      values.insert(depth);
    }
    EXPECT_NEAR(count / (160 * 120), 0.9975, 0.002);  // 0.2 % gaps, 0.05 % outliers
    // Rounding with so little noise depends on where between two steps the surface lies.
    EXPECT_NEAR(sum / count, 0, 0.1);
    EXPECT_NEAR(std::sqrt(squares / count), std::sqrt(0.25 + 1.0 / 12), 0.1);  // 0.5 steps, and rounding to steps
    EXPECT_LE(values.size(), 8U);                                              // whole steps only
  }
}

// A slow twin of the shadows: a pixel is dark where any other of its row is nearer and at the same place in the
// projector's image.
TEST(Sensor, ShadowsAreWhereTheProjectorIsBlocked) {
  Scene scene;
  const std::uint16_t wall = scene.add({.name = "wall"}), post = scene.add({.name = "post"});
  scene.bodies.push_back({.size = {8, 0.2, 8}, .entity = wall});
  scene.bodies.back().pose.translation() = Vector3d(0, 3, 0);
  scene.bodies.push_back({.size = {0.3, 0.1, 1}, .entity = post});
  scene.bodies.back().pose.translation() = Vector3d(0, 1, 0);
  const Calibration c = kinect_calibration(320, 240);
  const View view = render(scene, c, look_at({0, 0, 0}, {0, 1, 0}));
  SensorModel sensor = perfect_sensor();
  sensor.baseline = 0.075;
  const Frame frame = measure(view, c, sensor, 1, 0);
  const int y = 120;
  std::size_t dark = 0;
  for (int x = 0; x < c.width; ++x) {
    const auto place = [&](int u) { return u - c.fx * 0.075 / static_cast<double>(view.depth(y, u)); };
    bool blocked = false;
    for (int u = x + 1; u < c.width; ++u) blocked = blocked || place(u) < place(x) - 0.5;
    EXPECT_EQ(frame.depth(y, x) == 0, blocked) << x;
    dark += blocked ? 1 : 0;
    // Shadows lie to the left of what throws them.
    if (blocked) {
      EXPECT_LT(x, 120 + 40);
    }
  }
  // 285 pixels of focal length, 75 mm: the post's disparity at 0.95 m less the wall's at 2.9 m.
  EXPECT_NEAR(static_cast<double>(dark), 285 * 0.075 * (1 / 0.95 - 1 / 2.9), 2);
}

TEST(SyntheticSequence, IsTheSameWhereverItIsMade) {
  const SequenceOptions options{.width = 80, .height = 60, .frames = 12, .seed = 7};
  const auto a = make_sequence("hall", options), b = make_sequence("hall", options);
  ASSERT_TRUE(a && b);
  for (const std::size_t i : {std::size_t{0}, std::size_t{5}, std::size_t{11}}) {
    const TrueFrame first = a->frame(i), second = b->frame(i);
    EXPECT_EQ(cv::norm(first.frame.depth, second.frame.depth, cv::NORM_INF), 0);
    EXPECT_EQ(cv::norm(first.frame.colour, second.frame.colour, cv::NORM_INF), 0);
  }
  const auto other = make_sequence("hall", {.width = 80, .height = 60, .frames = 12, .seed = 8});
  EXPECT_GT(cv::norm(a->frame(0).frame.depth, other->frame(0).frame.depth, cv::NORM_INF), 0);
  EXPECT_FALSE(make_sequence("cellar", options));
  EXPECT_FALSE(make_sequence("hall", {.width = 0, .height = 60}));
}

TEST(SyntheticSequence, TruthFitsWhatIsMeasured) {
  for (const std::string& name : sequence_names()) {
    SCOPED_TRACE(name);
    const auto sequence = make_sequence(name, {.width = 160, .height = 120, .frames = 20});
    ASSERT_TRUE(sequence);
    std::size_t foreground = 0;
    for (std::size_t i = 0; i < sequence->size(); i += 3) {
      const TrueFrame truth = sequence->frame(i);
      std::size_t far_off = 0, valid = 0;
      for (int y = 0; y < 120; ++y) {
        for (int x = 0; x < 160; ++x) {
          const std::uint16_t measured = truth.frame.depth(y, x), clean = truth.depth(y, x),
                              entity = truth.entities(y, x);
          ASSERT_LE(entity, truth.scene.entities.size());
          ASSERT_EQ(clean == 0, entity == 0);
          const bool should = entity != 0 && truth.scene.entities[entity - 1U].is_foreground;
          ASSERT_EQ(truth.foreground(y, x) != 0, should);
          foreground += should ? 1 : 0;
          if (measured == 0) continue;
          ++valid;
          if (std::abs(normalised_disparity(measured) - normalised_disparity(clean)) > 3) ++far_off;
        }
      }
      if (i == 0) {
        EXPECT_EQ(foreground, 0U);  // nobody is there at first
      }
      EXPECT_LE(far_off, valid / 500);
      EXPECT_GT(valid, 160U * 120 / 2);
    }
    EXPECT_EQ(foreground > 0, name != "empty_room");
  }
}

TEST(SyntheticSequence, PeopleKeepTheirLabelsAndJointsLieOnThem) {
  const auto sequence = make_sequence("people_crossing", {.width = 160, .height = 120});
  ASSERT_TRUE(sequence);
  EXPECT_EQ(sequence->size(), 300U);
  const TrueFrame truth = sequence->frame(120);
  std::set<std::int32_t> labels;
  std::size_t seen = 0;
  for (std::size_t number = 1; number <= truth.scene.entities.size(); ++number) {
    const Entity& person = truth.scene.entities[number - 1];
    if (person.kind != EntityKind::kPerson) continue;
    labels.insert(person.person);
    EXPECT_EQ(person.joints.size(), 13U);
    for (const auto& [joint, place] : person.joints) {
      const Eigen::Vector2d pixel = sequence->calibration().pixel(sequence->camera().inverse() * place);
      const cv::Point at(static_cast<int>(std::lround(pixel.x())), static_cast<int>(std::lround(pixel.y())));
      if (!cv::Rect(0, 0, 160, 120).contains(at)) continue;
      const std::uint16_t entity = truth.entities(at);
      seen += entity == number ? 1 : 0;
      EXPECT_TRUE(entity == number || (entity != 0 && truth.scene.entities[entity - 1U].kind == EntityKind::kPerson))
          << joint;
    }
  }
  EXPECT_EQ(labels, (std::set<std::int32_t>{1, 2}));
  EXPECT_GE(seen, 13U);
}

TEST(SyntheticSequence, ThingsStandOnTheTableOrAreCarriedAbove) {
  for (const char* name : {"table_moves", "table_removals", "table_occlusion", "robot_table"}) {
    const auto sequence = make_sequence(name, {.width = 32, .height = 24, .frames = 40});
    ASSERT_TRUE(sequence);
    const std::size_t before = sequence->movers(0).entities.size();
    for (std::size_t i = 0; i < sequence->size(); ++i) {
      std::set<std::string> names;
      for (const Entity& entity : sequence->movers(i).entities) {
        EXPECT_TRUE(names.insert(entity.name).second);
        if (entity.kind != EntityKind::kObject) continue;
        EXPECT_GE(entity.pose.translation().z() - entity.size.z() / 2, 0.75 - 1e-9);
        EXPECT_FALSE(entity.object_class.empty() || entity.shape.empty() || entity.colour_name.empty());
      }
    }
    if (std::string_view(name) == "table_removals") {  // three go, one comes
      EXPECT_EQ(sequence->movers(39).entities.size(), before - 2);
    }
  }
}

}  // namespace
}  // namespace sherlog::rgbd
