#include "rgbd/synthetic/sequences.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <random>
#include <utility>

#include "rgbd/synthetic/kitchen.h"
#include "rgbd/synthetic/person.h"
#include "rgbd/synthetic/random_kitchen.h"

namespace sherlog::rgbd {
namespace {

using Eigen::Vector3d;
using Story = SyntheticSequence::Story;
constexpr double kPi = std::numbers::pi;

// 0 before `from`, 1 after `to`, smooth between.
double ramp(double t, double from, double to) {
  const double s = std::clamp((t - from) / (to - from), 0.0, 1.0);
  return s * s * (3 - 2 * s);
}

// --- tables

// A thing is carried between two places while from < t < to, in an arc. Out of view: y far behind the table.
struct Carry {
  std::size_t thing;
  double from, to;
  Vector3d goal;
};
struct Placement {
  std::size_t kind;  // in things()
  Vector3d foot;
  double heading;
  bool is_late = false;  // comes later, so it is foreground wherever it is
};

const Vector3d kAway(0.3, 2.4, 2.6);

// Where a thing is, and whether it is in a hand.
Vector3d place_of(std::size_t thing, const std::vector<Placement>& start, const std::vector<Carry>& carries, double t,
                  bool& in_hand, bool& has_moved) {
  Vector3d place = start[thing].foot;
  in_hand = false;
  has_moved = start[thing].is_late;
  for (const Carry& c : carries) {
    if (c.thing != thing || t <= c.from) continue;
    // The hand comes in the first quarter, and goes in the last.
    const double quarter = (c.to - c.from) / 4;
    const double s = ramp(t, c.from + quarter, c.to - quarter);
    const Vector3d from = place;
    place = from + s * (c.goal - from);
    place.z() += 0.18 * std::sin(kPi * s);
    in_hand = t < c.to;
    has_moved = has_moved || s > 0;
  }
  return place;
}

Story table_story(std::vector<Placement> start, std::vector<Carry> carries) {
  return [start = std::move(start), carries = std::move(carries)](double t) {
    Scene scene;
    for (std::size_t i = 0; i < start.size(); ++i) {
      bool in_hand = false, has_moved = false;
      const Vector3d foot = place_of(i, start, carries, t, in_hand, has_moved);
      const Thing& thing = things()[start[i].kind];
      if ((foot - kAway).norm() > 0.05) {
        add_thing(scene, thing, thing.object_class, foot, start[i].heading, has_moved);
      }
    }
    for (const Carry& c : carries) {
      if (t <= c.from || t >= c.to) continue;
      bool in_hand = false, has_moved = false;
      const Vector3d foot = place_of(c.thing, start, carries, t, in_hand, has_moved);
      const Thing& thing = things()[start[c.thing].kind];
      const double quarter = (c.to - c.from) / 4;
      const double there = std::min(ramp(t, c.from, c.from + quarter), 1 - ramp(t, c.to - quarter, c.to));
      const Vector3d grasp = foot + Vector3d(0, thing.size.y() / 2 + 0.04, 0.7 * thing.size.z());
      add_reaching_arm(scene, std::string("arm with ") + thing.object_class, kAway + there * (grasp - kAway));
    }
    return scene;
  };
}

Vector3d on_table(double x, double y) { return {x, y, kTableHeight}; }

std::vector<Placement> laid_table() {
  return {{0, on_table(-0.42, 1.35), 0.3}, {1, on_table(-0.15, 1.38), 0.1}, {3, on_table(0.10, 1.05), 0},
          {6, on_table(-0.35, 1.02), 0},   {7, on_table(0.40, 1.00), 0},    {5, on_table(0.42, 1.35), 0},
          {2, on_table(0.15, 1.35), -0.4}, {8, on_table(-0.12, 0.98), 0.2}};
}

Story table_moves() {
  return table_story(laid_table(), {{1, 0.05, 0.30, on_table(-0.05, 1.12)},
                                    {5, 0.30, 0.55, on_table(0.28, 1.20)},
                                    {3, 0.55, 0.80, on_table(-0.20, 1.28)},
                                    {2, 0.76, 0.97, on_table(0.45, 1.40)}});
}

Story table_removals() {
  std::vector<Placement> start = laid_table();
  start.push_back({9, kAway, 0.2, true});
  return table_story(
      start,
      {{0, 0.05, 0.28, kAway}, {4, 0.28, 0.52, kAway}, {8, 0.50, 0.74, on_table(-0.40, 1.30)}, {2, 0.74, 0.97, kAway}});
}

Story table_occlusion() {
  return table_story(laid_table(), {{0, 0.05, 0.30, on_table(0.10, 0.90)},
                                    {2, 0.35, 0.60, on_table(0.02, 1.25)},
                                    {0, 0.65, 0.90, on_table(-0.42, 1.35)}});
}

// Things are carried from the table to the counter behind it, which is higher, and back.
Story table_and_counter() {
  const auto on_counter = [](double x, double y) { return Vector3d(x, y, kCounterHeight); };
  return table_story({{0, on_table(-0.42, 1.30), 0.3},
                      {1, on_table(0.35, 1.25), 0.1},
                      {3, on_table(-0.10, 1.05), 0},
                      {7, on_table(0.15, 1.30), 0},
                      {9, on_counter(-0.60, 2.25), 0.2},
                      {6, on_counter(0.55, 2.30), 0},
                      {2, on_counter(0.05, 2.40), -0.4}},
                     {{1, 0.05, 0.30, on_counter(0.25, 2.25)},
                      {4, 0.35, 0.60, on_table(-0.25, 1.30)},
                      {3, 0.65, 0.80, kAway},
                      {2, 0.80, 0.97, on_counter(-0.25, 2.25)}});
}

Story robot_table() {
  return [](double t) {
    Scene scene = table_story(laid_table(), {})(0);
    Eigen::Isometry3d base = Eigen::Isometry3d::Identity();
    base.translation() = Vector3d(-0.95, 0.95, 0.80);
    base.linear() = Eigen::AngleAxisd(-0.2, Vector3d::UnitZ()).toRotationMatrix();
    const double out = ramp(t, 0.02, 0.2);  // first folded, out of view
    const double wave = 2 * kPi * 3 * t;
    const std::array<double, 6> angles = {-2.6 + out * (2.6 + 0.5 * std::sin(wave)),
                                          0.2 + out * 0.9,
                                          0.3 * std::sin(0.7 * wave),
                                          0.5 + 0.3 * out * std::sin(wave + 1),
                                          0.4 * std::sin(1.3 * wave),
                                          0.8 * out};
    add_robot_arm(scene, base, angles);
    return scene;
  };
}

Story random_story(std::uint64_t seed, std::size_t frames) {
  return [kitchen = random_kitchen(seed, frames)](double t) {
    return kitchen.scene(static_cast<std::size_t>(std::lround(t * static_cast<double>(kitchen.steps.size() - 1))));
  };
}

// --- people

// Walks through the points, each with the moment it is reached.
struct Walk {
  std::vector<std::pair<double, Vector3d>> points;
  double height;
  Clothes clothes;
  double steps = 8;  // full turns of the phase over the sequence
};

Posture posture_at(const Walk& walk, double t) {
  Posture posture{.height = walk.height};
  std::size_t k = 0;
  while (k + 2 < walk.points.size() && t >= walk.points[k + 1].first) ++k;
  const auto& [t0, a] = walk.points[k];
  const auto& [t1, b] = walk.points[k + 1];
  const double s = std::clamp((t - t0) / (t1 - t0), 0.0, 1.0);
  posture.place = a + s * (b - a);
  const bool stands = (b - a).norm() < 1e-6;
  posture.heading = stands ? -kPi / 2 : std::atan2(b.y() - a.y(), b.x() - a.x());
  posture.phase = 2 * kPi * walk.steps * t;
  posture.swing = stands ? 0 : 0.45;
  if (stands) posture.right_arm = 0.6 + 0.5 * std::sin(posture.phase / 2);
  return posture;
}

Story people_story(std::vector<Walk> walks) {
  return [walks = std::move(walks)](double t) {
    Scene scene;
    std::int32_t label = 0;
    for (const Walk& walk : walks) {
      ++label;
      add_person(scene, "person " + std::to_string(label), label, posture_at(walk, t), walk.clothes);
    }
    return scene;
  };
}

const Clothes kBlue{.shirt = {170, 80, 50}, .trousers = {70, 70, 70}};
const Clothes kRed{.shirt = {50, 50, 190}, .trousers = {130, 80, 50}};
const Clothes kGreen{.shirt = {70, 150, 60}, .trousers = {60, 80, 110}};
const Clothes kWhite{.shirt = {215, 215, 215}, .trousers = {90, 60, 50}};

Story people_crossing() {
  return people_story({{{{0.02, {-3.2, 2.6, 0}}, {0.98, {3.2, 2.9, 0}}}, 1.80, kBlue, 8},
                       {{{0.02, {3.4, 3.9, 0}}, {0.98, {-3.2, 3.6, 0}}}, 1.68, kRed, 7}});
}

Story window_story() {
  return people_story({{{{0.02, {-2.9, 3.0, 0}}, {0.40, {-0.9, 3.1, 0}}, {0.60, {-0.9, 3.1, 0}}, {0.98, {2.6, 3.0, 0}}},
                        1.75,
                        kRed,
                        8}});
}

Story hall_story() {
  return people_story(
      {{{{0.02, {-3.3, 2.8, 0}}, {0.60, {3.3, 3.2, 0}}, {0.99, {3.4, 3.2, 0}}}, 1.82, kBlue, 9},
       {{{0.10, {4.4, 6.2, 0}}, {0.55, {0.0, 6.4, 0}}, {0.99, {-4.6, 6.0, 0}}}, 1.70, kRed, 8},
       {{{0.20, {-4.2, 4.6, 0}}, {0.50, {0.3, 4.4, 0}}, {0.70, {0.3, 4.4, 0}}, {0.99, {4.4, 4.8, 0}}}, 1.65, kGreen, 8},
       {{{0.35, {3.6, 3.6, 0}}, {0.99, {-3.4, 2.6, 0}}}, 1.76, kWhite, 10}});
}

Story crowd_story(std::uint64_t seed) {
  std::vector<Walk> walks;
  std::mt19937_64 random(seed);
  const auto draw = [&](double low, double high) {
    return low + (high - low) * static_cast<double>(random() >> 11) * 0x1p-53;
  };
  for (int i = 0; i < 50; ++i) {
    const double side = i % 2 == 0 ? 1 : -1, y = draw(2.2, 6.8), goal = draw(2.2, 6.8);
    const double start = draw(0.02, 0.3);
    Walk walk{
        {{start, {-side * 0.62 * y - side, y, 0}}, {1.0, {side * 0.5 * goal, goal, 0}}}, draw(1.5, 1.95), kRed, 8};
    for (int k = 0; k < 3; ++k) walk.clothes.shirt[k] = static_cast<std::uint8_t>(draw(20, 240));
    walks.push_back(std::move(walk));
  }
  return people_story(std::move(walks));
}

struct Named {
  const char* name;
  std::size_t frames;
};
constexpr Named kNames[] = {{"table_moves", 180},
                            {"table_removals", 180},
                            {"table_occlusion", 150},
                            {"robot_table", 150},
                            {"people_crossing", 300},
                            {"window", 200},
                            {"hall", 300},
                            {"crowd", 120},
                            {"empty_room", 30},
                            {"random_kitchen", 8},
                            {"table_and_counter", 180}};

}  // namespace

SyntheticSequence::SyntheticSequence(std::string name, Calibration calibration, Eigen::Isometry3d camera,
                                     std::size_t frames, Scene scenery, Story story, SensorModel sensor,
                                     std::uint64_t seed)
    : name_(std::move(name)),
      calibration_(calibration),
      camera_(camera),
      frames_(frames),
      scenery_(std::move(scenery)),
      story_(std::move(story)),
      sensor_(sensor),
      seed_(seed),
      background_(render(scenery_, calibration_, camera_)) {}

Scene SyntheticSequence::movers(std::size_t index) const {
  return story_(frames_ < 2 ? 0.0 : static_cast<double>(index) / static_cast<double>(frames_ - 1));
}

TrueFrame SyntheticSequence::frame(std::size_t index) const {
  TrueFrame truth;
  truth.scene = movers(index);
  const auto first = static_cast<std::uint16_t>(scenery_.entities.size());
  const View view = render(truth.scene, calibration_, camera_, &background_, first);
  truth.scene.entities.insert(truth.scene.entities.begin(), scenery_.entities.begin(), scenery_.entities.end());
  for (Body& body : truth.scene.bodies) body.entity = static_cast<std::uint16_t>(body.entity + first);

  truth.frame = measure(view, calibration_, sensor_, seed_, index);
  truth.frame.time = static_cast<double>(index) / rate();
  truth.frame.pose = camera_;
  truth.entities = view.entities;
  truth.depth.create(view.depth.size());
  truth.foreground.create(view.depth.size());
  for (int y = 0; y < view.depth.rows; ++y) {
    for (int x = 0; x < view.depth.cols; ++x) {
      truth.depth(y, x) = cv::saturate_cast<std::uint16_t>(view.depth(y, x) * 1000.0F);
      const std::uint16_t entity = view.entities(y, x);
      const bool is_foreground = entity != 0 && truth.scene.entities[entity - std::size_t{1}].is_foreground;
      truth.foreground(y, x) = is_foreground ? 255 : 0;
    }
  }
  return truth;
}

std::vector<std::string> sequence_names() {
  std::vector<std::string> names;
  for (const Named& named : kNames) names.emplace_back(named.name);
  return names;
}

std::optional<SyntheticSequence> make_sequence(std::string_view name, const SequenceOptions& options) {
  const auto* named = std::ranges::find(kNames, name, &Named::name);
  const Calibration calibration = kinect_calibration(options.width, options.height);
  if (named == std::end(kNames) || !problem_of(calibration).empty()) return std::nullopt;
  const std::size_t frames = options.frames == 0 ? named->frames : options.frames;
  const auto make = [&](const Eigen::Isometry3d& camera, Scene scenery, Story story) {
    return SyntheticSequence(std::string(name), calibration, camera, frames, std::move(scenery), std::move(story), {},
                             options.seed);
  };
  if (name.starts_with("table") || name == "robot_table" || name == "random_kitchen") {
    const Eigen::Isometry3d camera = name == "table_and_counter" ? look_at({0, 0.10, 1.65}, {0, 1.60, 0.78})
                                                                 : look_at({0, 0.20, 1.42}, {0, 1.16, 0.78});
    Story story = name == "table_moves"         ? table_moves()
                  : name == "table_and_counter" ? table_and_counter()
                  : name == "table_removals"    ? table_removals()
                  : name == "robot_table"       ? robot_table()
                  : name == "random_kitchen"    ? random_story(options.seed, frames)
                                                : table_occlusion();
    return make(camera, table_room(), std::move(story));
  }
  const Eigen::Isometry3d camera = look_at({0, 0, 1.25}, {0, 3, 1.10});
  if (name == "window") return make(camera, living_room(5.0, 3, false), window_story());
  if (name == "people_crossing") return make(camera, living_room(5.5, 0, false), people_crossing());
  if (name == "hall") return make(camera, living_room(7.5, 3, true), hall_story());
  if (name == "crowd") return make(camera, living_room(7.5, 2, true), crowd_story(options.seed));
  return make(camera, living_room(5.5, 1, false), [](double) { return Scene{}; });
}

}  // namespace sherlog::rgbd
