// The free parameters of the learned identity model, from simulated training trials.
//
// Idea      How often things happen are weights of formulas, and the project's learner finds them. The sensor's sigmas are no
//           log-linear weights: the differences between two measurements of one thing that stayed are Gaussian with
//           variance 2 sigma^2, so their mean square gives the maximum-likelihood estimate.
// Source    models/identity_resolution/learned.mln (what is learned) and learning.mln (how the learner sees it)
#pragma once

#include <string>

#include "perception_bridge/four_tables.h"
#include "perception_bridge/identity_resolver.h"
#include "perception_bridge/identity_weights.h"

namespace sherlog {

struct IdentityTraining {
  FourTablesConfig config;
  std::vector<std::uint32_t> actions = {1, 2, 3, 4, 5};  // dealt to the trials in turn
  std::uint64_t trials = 1000;
  std::uint64_t seed = 0x747261696e000000;  // evaluate on another
  WeightLearning how;
};

struct LearnedIdentity {
  Termination termination = Termination::kCompleted;
  std::string message;        // where not completed
  Grading grading;            // kOdds
  IdentityWeights weights{};  // in the order of learned.mln's last formulas
  std::string model;          // learned.mln with these weights
  double objective = 0.0;
  std::uint32_t iterations = 0;
  double seconds = 0.0;
};

LearnedIdentity learn_identity(const IdentityTraining& training, Monitor& monitor);

}  // namespace sherlog
