// Identity resolution learned from scenes in which people (or a simulation) said which thing is which.
//
// Idea      Each scene of a recording against all that was seen before in it is one step, as the tracker takes it: the same
//           looks, the same evidence mapping. Three things are learned, in this order:
//             the spreads of the appearance types: so that the similarity is the probability that two looks are of one thing;
//             the spread of places: two sightings of one thing are Gaussian around the same place, or anywhere else where it was
//             moved to; which of the two is not known, and expectation maximisation finds both;
//             the weights of how often things happen (identity_weights.h), with grades by these spreads.
// Labels    rs.annotation.GroundTruth with an "object": the thing's name. Clusters without one teach nothing and are left out; of
//           several with one name in a scene the first counts.
// Errors    a mapping without the pair rules similar and proximity, no pair of one thing or none of two: said, nothing is learned
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "perception_bridge/evidence_mapping.h"
#include "perception_bridge/identity_weights.h"
#include "perception_bridge/scene.h"

namespace sherlog {

struct SceneTraining {
  std::vector<std::vector<Scene>> recordings;  // each in the order of time; a thing keeps its name within one
  EvidenceMapping mapping;                     // what to begin with
  WeightLearning how;
};

struct LearnedScenes {
  Termination termination = Termination::kCompleted;
  std::string message;      // where not completed
  EvidenceMapping mapping;  // with the learned spreads
  IdentityWeights weights{};
  std::string model;  // scenes.mln with these weights
  std::uint64_t steps = 0, same_pairs = 0, other_pairs = 0;
  double log_likelihood_before = 0, log_likelihood = 0;  // of a pair's looks
  double objective = 0;
  std::uint32_t iterations = 0;
};

LearnedScenes learn_from_scenes(const SceneTraining& training, Monitor& monitor);

// "" where the cluster has no label.
std::string true_object(const Cluster& cluster);

}  // namespace sherlog
