// How often things happen to objects: the six weights at the end of learned.mln and scenes.mln, from steps of which it is known.
//
// Idea      Each step (what was seen before, what is seen now) is one training database of learning.mln: the grades of every pair
//           and what really happened. The project's learner finds the weights.
// Source    models/identity_resolution/learning.mln
#pragma once

#include <array>
#include <limits>
#include <string>
#include <string_view>
#include <vector>

#include "mln/monitor.h"
#include "perception_bridge/identity_resolver.h"

namespace sherlog {

// "gone": an old cluster that is none of the new ones, its place in view or not.
inline constexpr std::array<const char*, 6> kIdentityWeightNames = {
    "stay", "move", "newview", "appeared", "gone, in view", "unmatched, out of view"};
using IdentityWeights = std::array<double, kIdentityWeightNames.size()>;

struct KnownStep {
  std::vector<bool> in_view;            // by old cluster: its place is
  std::vector<PairGrade> grades;        // old x new, row by row
  std::vector<std::string_view> truth;  // the same: stay, move, newview, not
};

class IdentityTrainingData {
 public:
  // A step without old or without new clusters says nothing of pairs, and is left out.
  void add(const KnownStep& step);
  std::uint64_t steps() const { return steps_; }
  const std::string& text() const { return text_; }  // databases of learning.mln

 private:
  std::string text_;
  std::uint64_t steps_ = 0;
};

struct WeightLearning {
  std::string method = "dpll";  // of the learner
  std::uint32_t threads = 0;
  double max_seconds = std::numeric_limits<double>::infinity();
};

struct LearnedWeights {
  Termination termination = Termination::kCompleted;
  std::string message;  // where not completed
  IdentityWeights weights{};
  double objective = 0.0;
  std::uint32_t iterations = 0;
};

LearnedWeights learn_identity_weights(const IdentityTrainingData& data, const WeightLearning& how, Monitor& monitor);

// A model's text with other weights in its last six lines.
std::string with_identity_weights(std::string_view model, const IdentityWeights& weights);

}  // namespace sherlog
