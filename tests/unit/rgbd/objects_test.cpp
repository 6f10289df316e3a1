#include <gtest/gtest.h>

#include <numbers>
#include <opencv2/imgproc.hpp>
#include <random>

#include "rgbd/objects/looks.h"
#include "rgbd/objects/shape.h"
#include "rgbd/synthetic/sequences.h"
#include "tests/support/shot.h"

namespace sherlog::rgbd {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

using Names = std::multiset<std::string>;

TEST(TableTop, IsFoundToTheMillimetreUnderManyThings) {
  Shot shot;
  for (std::size_t kind = 0; kind < 8; ++kind) {
    shot.add(kind, -0.45 + 0.25 * static_cast<double>(kind % 4), kind < 4 ? 1.0 : 1.3);
  }
  shot.take();
  EXPECT_NEAR(shot.table.in_world.translation().z(), kTableHeight, 0.002);
  EXPECT_GT(shot.table.in_world.linear().col(2).z(), std::cos(0.01));
  EXPECT_LT(shot.table.area, 1.3 * 0.8 + 0.02);
  EXPECT_GT(shot.table.area, 1.3 * 0.8 - 0.15);  // the picture cuts off two corners
  const auto at = [&](double x, double y) {
    const Vector3d p = shot.table.in_world.inverse() * Vector3d(x, y, kTableHeight);
    return shot.table.has(p.x(), p.y());
  };
  EXPECT_TRUE(at(0, 1.1));
  EXPECT_TRUE(at(-0.5, 1.4));
  EXPECT_FALSE(at(0, 1.7));
  EXPECT_FALSE(at(0.8, 1.1));
}

TEST(TableTop, IsFoundWithoutThePoseOfTheCamera) {
  Shot shot;
  shot.add(0, 0, 1.2);
  shot.take();
  std::string problem;
  const auto tables = find_tables(shot.cloud, std::nullopt, {}, problem);
  ASSERT_EQ(tables.size(), 1u) << problem;
  EXPECT_FALSE(tables[0].has_world);
  EXPECT_NEAR((tables[0].pose.translation() - shot.table.pose.translation()).norm(), 0, 0.05);
  EXPECT_GT(tables[0].pose.linear().col(2).dot(shot.table.pose.linear().col(2)), std::cos(0.01));
}

TEST(TableTop, IsMissedWithASentenceWhereThereIsNone) {
  std::string problem;
  EXPECT_TRUE(find_tables(Cloud(48, 64, cv::Vec3f()), std::nullopt, {}, problem).empty());
  EXPECT_NE(problem.find("no table top"), std::string::npos);
  EXPECT_TRUE(find_tables(Cloud(1, 1, cv::Vec3f()), std::nullopt, {}, problem).empty());
  // A wall that the camera faces.
  const Calibration calibration = kinect_calibration(64, 48);
  const DepthImage wall(48, 64, std::uint16_t{2000});
  EXPECT_TRUE(find_tables(cloud_of(wall, calibration), std::nullopt, {}, problem).empty());
}

TEST(Hypotheses, AreTheThingsAndNothingElse) {
  Shot shot;
  Names expected;
  for (std::size_t kind = 0; kind < 8; ++kind) {
    shot.add(kind, -0.45 + 0.28 * static_cast<double>(kind % 4), kind < 4 ? 1.38 : 1.0, 0.2);
    expected.insert(things()[kind].object_class);
  }
  shot.take();
  const Hypotheses found = shot.find();
  EXPECT_EQ(shot.names(found), expected);
  EXPECT_EQ(found.reaching, 0U);
}

TEST(Hypotheses, OfAnEmptyTableAreNone) {
  Shot shot;
  shot.take();
  EXPECT_TRUE(shot.find().things.empty());
}

TEST(Hypotheses, ColourSeesWhatGivesNoDepth) {
  Shot shot;
  shot.add(8, 0, 1.1, 0.3);  // a knife
  shot.scene.bodies.back().gives_depth = false;
  shot.take();
  HypothesisOptions depth_alone;
  depth_alone.use_colour = false;
  EXPECT_EQ(shot.names(shot.find(depth_alone)), Names{});
  const Hypotheses both = shot.find();
  ASSERT_EQ(shot.names(both), Names{"Knife"});
  EXPECT_TRUE(both.things[0].from_colour);
  EXPECT_EQ(fit_shape(both.things[0], 0.001).shape, "flat");
}

TEST(Hypotheses, ColourSeparatesWhatTouches) {
  Shot shot;
  shot.add(1, 0, 1.15);       // milk, white, 7.5 cm wide
  shot.add(9, 0.0825, 1.15);  // juice, orange, 9 cm wide, its side on the milk's
  shot.take();
  HypothesisOptions depth_alone;
  depth_alone.use_colour = false;
  EXPECT_EQ(shot.find(depth_alone).things.size(), 1U);
  EXPECT_EQ(shot.names(shot.find()), (Names{"Juice", "Milk"}));
}

TEST(Hypotheses, BothWaysTogetherHaveWhatEachHas) {
  for (const char* name : {"table_moves", "table_occlusion"}) {
    const auto sequence = make_sequence(name);
    Shot shot;
    const TrueFrame truth = sequence->frame(0);
    shot.scene = truth.scene;
    shot.view.entities = truth.entities;
    shot.frame = truth.frame;
    shot.cloud = cloud_of(truth.frame.depth, shot.calibration);
    std::string problem;
    shot.table = find_tables(shot.cloud, truth.frame.pose, {}, problem).at(0);
    HypothesisOptions depth, colour;
    depth.use_colour = colour.use_depth = false;
    const Names both = shot.names(shot.find());
    for (const HypothesisOptions& options : {depth, colour}) {
      for (const std::string& found : shot.names(shot.find(options))) {
        EXPECT_TRUE(found == "table" || found == "nothing" || both.contains(found)) << name << ": " << found;
      }
    }
  }
}

TEST(Hypotheses, LeaveOutWhatHoversOrReachesIn) {
  Shot shot;
  shot.add(1, -0.3, 1.2);
  shot.add(3, 0.2, 1.1, 0, 0.15);  // a cup in the air
  shot.take();
  const Hypotheses hovering = shot.find();
  EXPECT_EQ(shot.names(hovering), Names{"Milk"});
  EXPECT_EQ(hovering.reaching, 1U);

  Shot arm;
  arm.add(1, -0.3, 1.2);
  add_reaching_arm(arm.scene, "arm", {0.25, 1.2, 0.85});
  arm.take();
  const Hypotheses reaching = arm.find();
  EXPECT_EQ(arm.names(reaching), Names{"Milk"});
  EXPECT_GE(reaching.reaching, 1U);
}

TEST(Hypotheses, KeepWhatIsHalfHidden) {
  Shot shot;
  shot.add(0, 0, 1.0);     // cereals
  shot.add(5, 0.05, 1.3);  // chips behind them: its foot cannot be seen
  shot.take();
  EXPECT_EQ(shot.names(shot.find()), (Names{"Cereals", "Chips"}));
}

// Random places and turns of everything in the catalogue, from noisy images.
TEST(Shape, AndSizeOfAllThingsAreRight) {
  std::mt19937_64 random(7);
  std::uniform_real_distribution<double> unit(-1, 1);
  std::size_t right = 0, total = 0;
  for (int round = 0; round < 4; ++round) {
    for (std::size_t kind = 0; kind < things().size(); ++kind) {
      const Thing& thing = things()[kind];
      Shot shot;
      const double x = 0.4 * unit(random), y = 1.15 + 0.2 * unit(random);
      shot.add(kind, x, y, 1.5 * unit(random));
      shot.take({}, static_cast<std::uint64_t>(round) + 1);
      const Hypotheses found = shot.find();
      ASSERT_EQ(shot.names(found).count(thing.object_class), 1U) << thing.object_class;
      const Hypothesis& one = found.things[0];
      const ShapeFit fit = fit_shape(one, 0.002);
      ++total;
      right += fit.shape == thing.shape ? 1U : 0U;
      EXPECT_GE(fit.confidence, 0.0);
      EXPECT_LE(fit.confidence, 1.0);
      if (std::string(thing.object_class) == "Knife") continue;  // depth has but a part of it
      const Vector3d centre = shot.table.in_world * fit.box.centre;
      EXPECT_LT((centre.head<2>() - Vector2d(x, y)).norm(), 0.025) << thing.object_class;
      EXPECT_NEAR(fit.box.size.z(), thing.size.z(), 0.012) << thing.object_class;
      EXPECT_NEAR(fit.box.size.x(), std::max(thing.size.x(), thing.size.y()), 0.03) << thing.object_class;
    }
  }
  EXPECT_GE(right, total * 9 / 10) << right << " of " << total;
}

// Cans and cartons of square section, at any place and turn, that lie.
TEST(Shape, OfWhatLiesIsACylinderOrABox) {
  std::mt19937_64 random(11);
  std::uniform_real_distribution<double> unit(-1, 1);
  std::size_t right = 0, total = 0;
  for (int round = 0; round < 24; ++round) {
    Shot shot;
    const bool is_round = round % 2 == 0;
    const double width = 0.075 + 0.015 * unit(random), length = 0.18 + 0.06 * unit(random);
    Entity entity{.kind = EntityKind::kObject, .name = "lying", .size = {width, width, length}};
    entity.pose.linear() = (Eigen::AngleAxisd(1.5 * unit(random), Vector3d::UnitZ()) *
                            Eigen::AngleAxisd(std::numbers::pi / 2, Vector3d::UnitY()))
                               .toRotationMatrix();
    entity.pose.translation() = Vector3d(0.4 * unit(random), 1.15 + 0.2 * unit(random), kTableHeight + width / 2);
    Body body{.shape = is_round ? BodyShape::kCylinder : BodyShape::kBox,
              .size = entity.size,
              .pose = entity.pose,
              .colour = {40, 60, 200}};
    body.entity = shot.scene.add(std::move(entity));
    shot.scene.bodies.push_back(body);
    shot.take({}, static_cast<std::uint64_t>(round) + 1);
    const Hypotheses found = shot.find();
    ASSERT_EQ(found.things.size(), 1U) << round;
    const ShapeFit fit = fit_shape(found.things[0], 0.002);
    ++total;
    right += fit.shape == (is_round ? "cylinder" : "box") ? 1U : 0U;
    EXPECT_NEAR(fit.box.size.x(), length, 0.03) << round;
    EXPECT_NEAR(fit.box.size.z(), width, 0.012) << round;
  }
  EXPECT_GE(right, total * 9 / 10) << right << " of " << total;
}

TEST(Circle, IsFittedThroughAQuarterOfOutliers) {
  std::mt19937_64 random(2);
  std::uniform_real_distribution<double> unit(-1, 1);
  std::vector<Vector2d> outline;
  for (int i = 0; i < 60; ++i) {
    const double turn = unit(random) * std::numbers::pi;
    outline.emplace_back(0.3 + 0.05 * std::cos(turn), -0.1 + 0.05 * std::sin(turn));
  }
  for (int i = 0; i < 15; ++i) outline.emplace_back(0.3 + 0.03 * unit(random), -0.1 + 0.03 * unit(random));
  const CircleFit fit = fit_circle(outline, 0.003);
  EXPECT_NEAR(fit.radius, 0.05, 0.002);
  EXPECT_NEAR((fit.centre - Vector2d(0.3, -0.1)).norm(), 0, 0.002);
  EXPECT_GE(fit.inliers, 0.75);
  EXPECT_LT(fit.inliers, 0.95);
}

TEST(Rectangle, HasItsHeading) {
  for (const double heading : {-1.2, -0.4, 0.0, 0.7, 1.3}) {
    std::vector<Vector2d> outline;
    const Vector2d x(std::cos(heading), std::sin(heading)), y(-x.y(), x.x());
    for (int i = -20; i <= 20; ++i) {
      for (const int side : {-1, 1}) {
        outline.emplace_back(x * (0.1 * i / 20) + y * (0.04 * side));
        outline.emplace_back(x * (0.1 * side) + y * (0.04 * i / 20));
      }
    }
    const RectangleFit fit = fit_rectangle(outline, 0.003);
    EXPECT_NEAR(std::abs(std::cos(fit.heading - heading)), 1, 1e-3) << heading;
    EXPECT_NEAR(fit.size.x(), 0.2, 0.005);
    EXPECT_NEAR(fit.size.y(), 0.08, 0.005);
    EXPECT_GT(fit.inliers, 0.95);
  }
}

TEST(Size, HasTheNamesOfTheLimitsAndIsSurestFarFromThem) {
  EXPECT_EQ(size_name(0.00119).name, "small");
  EXPECT_EQ(size_name(0.00121).name, "medium");
  EXPECT_EQ(size_name(0.00399).name, "medium");
  EXPECT_EQ(size_name(0.00401).name, "large");
  EXPECT_NEAR(size_name(0.0012).confidence, 0.5, 1e-6);
  EXPECT_GT(size_name(0.0021).confidence, size_name(0.0013).confidence);
  EXPECT_EQ(size_name(0).name, "small");
}

TEST(Colour, NamesAreThoseOfRoboSherlock) {
  for (const auto& [colour, name] :
       {std::pair{cv::Vec3b(0, 0, 200), "red"}, std::pair{cv::Vec3b(0, 200, 200), "yellow"},
        std::pair{cv::Vec3b(0, 200, 0), "green"}, std::pair{cv::Vec3b(200, 200, 0), "cyan"},
        std::pair{cv::Vec3b(200, 0, 0), "blue"}, std::pair{cv::Vec3b(200, 0, 200), "magenta"},
        std::pair{cv::Vec3b(200, 200, 200), "white"}, std::pair{cv::Vec3b(100, 100, 100), "grey"},
        std::pair{cv::Vec3b(30, 0, 0), "black"}, std::pair{cv::Vec3b(20, 0, 200), "red"}}) {
    EXPECT_EQ(colour_name(colour), name) << colour;
  }
}

TEST(Colour, SharesAndHistogramCountThePixelsOfTheMask) {
  ColourImage colour(4, 10, cv::Vec3b(0, 0, 200));
  colour(cv::Rect(5, 0, 5, 4)).setTo(cv::Scalar(200, 0, 0));
  Hypothesis thing;
  thing.roi = {2, 1, 4, 2};  // three columns of red, one of blue
  thing.mask = cv::Mat1b(2, 4, std::uint8_t{255});
  const auto names = colour_names(colour, thing);
  ASSERT_EQ(names.size(), 2U);
  EXPECT_EQ(names[0].name, "red");
  EXPECT_DOUBLE_EQ(names[0].share, 0.75);
  thing.mask(cv::Rect(0, 0, 3, 2)).setTo(0);
  EXPECT_EQ(colour_names(colour, thing)[0].name, "blue");
  double sum = 0;
  for (const double count : colour_histogram(colour, thing)) sum += count;
  EXPECT_DOUBLE_EQ(sum, 2);
  EXPECT_NEAR(mean_colour(colour, thing)[2], 200 / 255.0, 1e-9);
}

}  // namespace
}  // namespace sherlog::rgbd
