// One picture of a table and what the object chain makes of it.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <set>
#include <string>

#include "rgbd/objects/hypotheses.h"
#include "rgbd/synthetic/kitchen.h"
#include "rgbd/synthetic/sensor.h"

namespace sherlog::rgbd {

// A room with some things on its table, seen by a noisy sensor or a perfect one.
struct Shot {
  Calibration calibration = kinect_calibration();
  Eigen::Isometry3d camera = look_at({0, 0.20, 1.42}, {0, 1.16, 0.78});
  rgbd::Scene scene = table_room();
  View view;
  Frame frame;
  Cloud cloud;
  Table table;

  void add(std::size_t kind, double x, double y, double heading = 0, double above = 0) {
    add_thing(scene, things()[kind], things()[kind].object_class, {x, y, kTableHeight + above}, heading, false);
  }
  // A body of one colour on the table, its middle so high above it; the entity's name tells what it is.
  void add_body(BodyShape shape, const std::string& name, const Eigen::Vector3d& size, double x, double y,
                double middle, bool gives_depth = true) {
    Entity entity{.kind = EntityKind::kObject, .name = name, .size = size};
    entity.pose.translation() = Eigen::Vector3d(x, y, kTableHeight + middle);
    Body body{.shape = shape, .size = size, .pose = entity.pose, .colour = {40, 60, 200}, .gives_depth = gives_depth};
    body.entity = scene.add(std::move(entity));
    scene.bodies.push_back(body);
  }
  void add_ball(const std::string& name, double diameter, double x, double y, double above = 0) {
    add_body(BodyShape::kCapsule, name, {diameter, diameter, 0}, x, y, above + diameter / 2);
  }
  void take(const SensorModel& sensor = {}, std::uint64_t seed = 1) {
    view = render(scene, calibration, camera);
    frame = measure(view, calibration, sensor, seed, 0);
    cloud = cloud_of(frame.depth, calibration);
    std::string problem;
    const auto found = find_tables(cloud, camera, {}, problem);
    ASSERT_FALSE(found.empty()) << problem;
    table = found[0];
  }
  Hypotheses find(const HypothesisOptions& options = {}) const {
    return find_hypotheses(above_table(cloud, table), frame.colour, table, calibration, options);
  }
  // Names of the objects that things mostly show, one for each thing.
  std::multiset<std::string> names(const Hypotheses& found) const {
    std::multiset<std::string> result;
    for (const Hypothesis& thing : found.things) {
      std::map<int, int> votes;
      for (int y = 0; y < thing.roi.height; ++y) {
        for (int x = 0; x < thing.roi.width; ++x) {
          if (thing.mask(y, x) != 0) ++votes[view.entities(y + thing.roi.y, x + thing.roi.x)];
        }
      }
      const auto most = std::ranges::max_element(votes, {}, [](const auto& vote) { return vote.second; });
      result.insert(most->first == 0 ? "nothing" : scene.entities[static_cast<std::size_t>(most->first) - 1].name);
    }
    return result;
  }
};

}  // namespace sherlog::rgbd
