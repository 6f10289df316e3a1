// Small scenes by hand: things with a place, a colour and a shape, and a tracker over them.
#pragma once

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <array>
#include <string>
#include <vector>

#include "mln/parser.h"
#include "perception_bridge/scene_tracker.h"
#include "perception_bridge/shipped_models.h"

namespace sherlog {

struct Thing {
  double x = 0, y = 0;
  std::array<double, 3> color = {0.5, 0.5, 0.5};
  std::vector<double> feature = {};  // of its shape; empty: not measured
  std::string hash = {};             // of its picture; empty: not measured
};

inline Annotation made(const char* type, Value::Object fields) {
  Annotation annotation;
  annotation.type = type;
  annotation.fields = std::move(fields);
  return annotation;
}

inline Cluster cluster_of(const std::string& id, const Thing& thing) {
  Cluster cluster;
  cluster.id = id;
  cluster.annotations.push_back(
      made("rs.annotation.LocationAnnotation", {{"position", number_list({thing.x, thing.y})}}));
  cluster.annotations.back().frame = "map";
  cluster.annotations.push_back(
      made("sherlog.annotation.MeanColor", {{"color", number_list({thing.color.begin(), thing.color.end()})}}));
  if (!thing.feature.empty())
    cluster.annotations.push_back(made("rs.annotation.PclFeature", {{"feature", number_list(thing.feature)}}));
  if (!thing.hash.empty())
    cluster.annotations.push_back(made("rs.annotation.PerceptualHash", {{"hash", Value(thing.hash)}}));
  return cluster;
}

// Clusters c0, c1, ... at that second.
inline Scene scene_of(double time, const std::vector<Thing>& things) {
  Scene scene;
  scene.id = fmt::format("s{}", time);
  scene.timestamp = time;
  for (std::size_t i = 0; i < things.size(); ++i)
    scene.clusters.push_back(cluster_of(fmt::format("c{}", i), things[i]));
  return scene;
}

inline Scene looking_at(Scene scene, std::vector<double> min, std::vector<double> max) {
  scene.annotations.push_back(
      made("sherlog.annotation.ViewBox", {{"min", number_list(min)}, {"max", number_list(max)}}));
  scene.annotations.back().frame = "map";
  return scene;
}

inline SceneTracker table1_tracker(TrackerOptions options = {}) {
  Diagnostics diagnostics;
  std::string problem;
  auto tracker = SceneTracker::make(*parse_model(paper_identity_model(), "table1.mln", diagnostics),
                                    *shipped_mapping("identity"), {}, std::move(options), problem);
  EXPECT_TRUE(tracker) << problem;
  return std::move(*tracker);
}

inline SceneTracker arbitrated_tracker(ArbiterOptions options = {}) {
  SceneTracker tracker = table1_tracker();
  tracker.use_arbiter(TrackingArbiter(default_trackers(), options));
  return tracker;
}

inline TrackingStep fed(SceneTracker& tracker, const Scene& scene) {
  Monitor quiet;
  TrackingStep step = tracker.feed(scene, quiet);
  EXPECT_EQ(step.termination, Termination::kCompleted) << step.message;
  return step;
}

// The objects of the clusters, in their order.
inline std::vector<std::string> names_in(const TrackingStep& step) {
  std::vector<std::string> names;
  for (const auto& entry : step.clusters) names.push_back(entry.object);
  return names;
}

}  // namespace sherlog
