// Biases that make the posteriors of Jeffrey evidence what it wants them to be, component by component.
//
// Idea      Components are independent, so each is fitted by itself: those narrow enough for elimination with exact
//           marginals, whatever method answers afterwards, the others with those of the sampler. See jeffrey.h.
// Input     method: the one that will answer, or none where it is chosen by component
// Output    biases by atom; `termination` and `message` say why there are none, `warnings` what was met in part only
// Random    evaluation r draws with the seed options.seed + r
#pragma once

#include <string>
#include <vector>

#include "inference/inference.h"

namespace sherlog {

struct SoftTargetFit {
  Termination termination = Termination::kCompleted;
  std::string message;
  std::vector<std::string> warnings;
  std::vector<std::uint32_t> conflict;  // constraints, where no world is possible at all
  std::vector<double> biases;
};

SoftTargetFit fit_soft_targets(const GroundNetwork& network, const Method* method, const InferenceOptions& options,
                               const StopCondition& stop);

}  // namespace sherlog
