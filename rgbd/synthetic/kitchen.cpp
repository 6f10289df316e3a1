#include "rgbd/synthetic/kitchen.h"

#include <cmath>
#include <utility>

namespace sherlog::rgbd {
namespace {

using Eigen::Vector3d;

constexpr std::size_t kThings = 10;
const Thing kCatalogue[kThings] = {
    {"Cereals", "box", "red", {40, 40, 200}, {0.19, 0.06, 0.27}},
    {"Milk", "box", "white", {230, 230, 230}, {0.075, 0.075, 0.20}},
    {"Tea", "box", "green", {60, 160, 60}, {0.13, 0.07, 0.08}},
    {"Cup", "cylinder", "blue", {190, 90, 40}, {0.085, 0.085, 0.095}},
    {"Can", "cylinder", "red", {50, 50, 180}, {0.067, 0.067, 0.125}},
    {"Chips", "cylinder", "orange", {30, 130, 240}, {0.075, 0.075, 0.23}},
    {"Bowl", "round", "yellow", {50, 210, 230}, {0.17, 0.17, 0.07}},
    {"Plate", "flat", "white", {225, 225, 225}, {0.24, 0.24, 0.018}},
    {"Knife", "flat", "grey", {150, 150, 150}, {0.21, 0.022, 0.006}},
    {"Juice", "box", "orange", {40, 150, 235}, {0.09, 0.065, 0.24}},
};

std::uint16_t add_scenery(Scene& scene, const char* name, const Vector3d& low, const Vector3d& high, cv::Vec3b colour,
                          bool gives_depth = true) {
  Entity entity{.kind = EntityKind::kScenery, .name = name, .size = high - low};
  entity.pose.translation() = (low + high) / 2;
  const std::uint16_t number = scene.add(entity);
  scene.bodies.push_back({.shape = BodyShape::kBox,
                          .size = high - low,
                          .pose = entity.pose,
                          .colour = colour,
                          .entity = number,
                          .gives_depth = gives_depth});
  return number;
}

}  // namespace

std::span<const Thing> things() { return kCatalogue; }

std::uint16_t add_thing(Scene& scene, const Thing& thing, std::string name, const Vector3d& foot, double heading,
                        bool is_foreground) {
  Entity entity{.kind = EntityKind::kObject,
                .name = std::move(name),
                .object_class = thing.object_class,
                .shape = thing.shape,
                .colour_name = thing.colour_name,
                .size = thing.size,
                .is_foreground = is_foreground};
  entity.pose.linear() = Eigen::AngleAxisd(heading, Vector3d::UnitZ()).toRotationMatrix();
  entity.pose.translation() = foot + Vector3d(0, 0, thing.size.z() / 2);
  const std::string_view shape = thing.shape;
  Body body{.shape = BodyShape::kBox, .size = thing.size, .pose = entity.pose, .colour = thing.colour};
  if (shape == "cylinder" || (shape == "flat" && thing.size.x() == thing.size.y())) body.shape = BodyShape::kCylinder;
  if (shape == "round") {
    body.shape = BodyShape::kBowl;
    body.pose.translation() = foot + Vector3d(0, 0, thing.size.z());
  }
  const std::uint16_t number = scene.add(std::move(entity));
  body.entity = number;
  scene.bodies.push_back(body);
  return number;
}

Scene table_room() {
  Scene scene;
  add_scenery(scene, "floor", {-4, -2, -0.1}, {4, 4, 0}, {110, 120, 130});
  add_scenery(scene, "wall", {-4, 2.6, 0}, {4, 2.7, 3}, {200, 205, 205});
  add_scenery(scene, "table", {-0.65, 0.75, kTableHeight - 0.04}, {0.65, 1.55, kTableHeight}, {90, 130, 170});
  int leg = 0;
  for (const double x : {-0.6, 0.55}) {
    for (const double y : {0.8, 1.45}) {
      const char* names[] = {"leg 1", "leg 2", "leg 3", "leg 4"};
      add_scenery(scene, names[leg++], {x, y, 0}, {x + 0.05, y + 0.05, kTableHeight - 0.04}, {70, 100, 140});
    }
  }
  add_scenery(scene, "counter", {-1.6, 2.0, 0}, {1.6, 2.6, kCounterHeight}, {180, 190, 190});
  add_scenery(scene, "oven", {0.4, 1.99, 0.2}, {1.0, 2.0, 0.8}, {30, 30, 30}, false);
  add_scenery(scene, "cupboard", {-1.4, 2.2, 1.4}, {0.2, 2.6, 2.2}, {160, 180, 195});
  return scene;
}

Scene living_room(double depth, int windows, bool shiny) {
  Scene scene;
  add_scenery(scene, "floor", {-6, -1, -0.1}, {6, depth, 0}, {100, 115, 130});
  add_scenery(scene, "wall", {-6, depth, 0}, {6, depth + 0.1, 3}, {200, 205, 205});
  add_scenery(scene, "left wall", {-3.6, -1, 0}, {-3.5, depth, 3}, {190, 195, 200});
  add_scenery(scene, "right wall", {3.5, -1, 0}, {3.6, depth, 3}, {190, 200, 195});
  add_scenery(scene, "ceiling", {-6, -1, 2.8}, {6, depth, 2.9}, {220, 220, 220});
  add_scenery(scene, "shelf", {-3.4, depth - 2.2, 0}, {-2.6, depth - 1.0, 1.9}, {70, 100, 150});
  add_scenery(scene, "sideboard", {1.6, depth - 0.6, 0}, {3.2, depth, 0.9}, {90, 110, 150});
  static constexpr const char* kWindows[] = {"window 1", "window 2", "window 3"};
  for (int i = 0; i < windows && i < 3; ++i) {
    const double x = -2.2 + 1.5 * i;
    add_scenery(scene, kWindows[i], {x, depth - 0.01, i == 2 ? 0.05 : 0.8}, {x + 1.2, depth, 2.2}, {240, 235, 220},
                false);
  }
  if (shiny) {
    add_scenery(scene, "panel", {-3.5, depth - 0.8, 0.3}, {-3.48, depth - 0.1, 2.4}, {170, 170, 170}, false);
    add_scenery(scene, "oven", {1.8, depth - 0.61, 0.2}, {2.4, depth - 0.6, 0.75}, {30, 30, 30}, false);
  }
  return scene;
}

void add_reaching_arm(Scene& scene, std::string name, const Vector3d& hand) {
  const std::uint16_t number =
      scene.add({.kind = EntityKind::kPerson, .name = std::move(name), .person = 1, .is_foreground = true});
  const Vector3d shoulder(hand.x() * 0.6 + 0.25, 1.9, 1.35);
  const Vector3d elbow = (shoulder + hand) / 2 + Vector3d(0.08, 0.05, -0.02);
  scene.entities.back().joints = {{"shoulder", shoulder}, {"elbow", elbow}, {"hand", hand}};
  scene.bodies.push_back(limb(shoulder, elbow, 0.10, {60, 60, 200}, number));
  scene.bodies.push_back(limb(elbow, hand, 0.07, {60, 60, 200}, number));
  scene.bodies.push_back(limb(hand, hand + Vector3d(-0.02, -0.05, -0.03), 0.08, {150, 180, 220}, number));
}

std::uint16_t add_robot_arm(Scene& scene, const Eigen::Isometry3d& base, std::span<const double> angles) {
  const std::uint16_t number =
      scene.add({.kind = EntityKind::kRobot, .name = "robot", .pose = base, .is_foreground = true});
  const double lengths[] = {0.16, 0.20, 0.20, 0.20, 0.19, 0.10};
  const double diameters[] = {0.15, 0.13, 0.12, 0.11, 0.10, 0.08};
  Eigen::Isometry3d frame = base;
  for (std::size_t i = 0; i < 6; ++i) {
    const Vector3d axis = i % 2 == 0 ? Vector3d::UnitZ() : Vector3d::UnitY();
    frame.rotate(Eigen::AngleAxisd(i < angles.size() ? angles[i] : 0, axis));
    const Vector3d from = frame.translation();
    frame.translate(Vector3d(0, 0, lengths[i]));
    scene.bodies.push_back(limb(from, frame.translation(), diameters[i], {60, 140, 235}, number));
  }
  for (const double side : {-0.045, 0.045}) {  // two fingers
    Body finger{
        .shape = BodyShape::kBox, .size = {0.03, 0.02, 0.12}, .pose = frame, .colour = {80, 80, 80}, .entity = number};
    finger.pose.translate(Vector3d(0, side, 0.06));
    scene.bodies.push_back(finger);
  }
  return number;
}

}  // namespace sherlog::rgbd
