// The slow twin of grounding: what a model, evidence and query mean, from the definition and nothing else.
//
// Every world of the open atoms is made, one after the other; every formula is evaluated in it by recursion, under
// every assignment of its variables. Nothing is simplified, shared, indexed or counted in closed form.
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "grounding/ground.h"

namespace sherlog::oracle {

struct NaiveAnswer {
  bool possible = false;  // some world has a positive probability
  double log_partition = 0.0;
  double best_score = 0.0;  // of a most probable world
  std::vector<std::pair<std::string, double>>
      marginals;      // queried atoms that are not decided, and queried formulas, in order
  double worlds = 0;  // that the evidence and the block rules leave
};

struct NaiveLimits {
  double worlds = 1 << 14;
  double steps = 2e7;  // worlds times ground formulas
};

// Soft evidence is read as kVirtual. Nothing where the limits are exceeded.
std::optional<NaiveAnswer> naive_semantics(const Model& model, const Evidence& evidence, const Query& query,
                                           const GroundingOptions& options, const NaiveLimits& limits = {});

}  // namespace sherlog::oracle
