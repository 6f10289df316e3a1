// Generated kitchen scenes as scenes: what the annotators of a robot would have written about them.
//
// Idea      kitchen_generator.h makes scenes as facts for a model. Here the same scenes are observations with annotations,
//           confidences, poses and run times, so that the store, the evidence mappings and the reports have something to work
//           on that is as large as anyone likes.
// Random    draws only from (seed, number of the scene), as the generator does
#pragma once

#include <cstdint>

#include "perception_bridge/kitchen_generator.h"
#include "perception_bridge/scene.h"

namespace sherlog {

struct KitchenSceneOptions {
  double start = 1353571200;  // time stamp of scene 0: 2012-11-22 08:00 UTC
  double interval = 600;      // seconds between scenes
  bool labels = true;         // GroundTruth annotations
};

// Requires  validate(config) finds nothing.
Scene kitchen_scene(const KitchenConfig& config, std::uint64_t seed, std::uint64_t number,
                    const KitchenSceneOptions& options = {});

}  // namespace sherlog
