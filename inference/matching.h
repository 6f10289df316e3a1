// Marginals and most probable worlds of one-to-one matchings: exact where the shorter side is short, else sampled and exact.
//
// Idea      matching_structure.h sees the matching in a component, matching_weights.h weighs its pairs. Its sums come from a
//           table over subsets of the shorter side (matching_sum.h), its optimum from the Hungarian algorithm
//           (assignment.h), at any size.
//           Table 1 with 15 old and 10 new clusters: 2 ms, where elimination takes 0.2 s. Where the shorter side has more than
//           about 18 members, marginals are sampled (matching_sampler.h), with error bars.
// Input     MethodContext: components, atom_bias (added to the score where the atom is true)
// Output    marginals of the queries of these components, log_partition where all were answered
// Errors    kRefused where a component is no matching, with the reason; kTimeLimit, kInterrupted; kNoPossibleWorld
// Cost      O(rows x columns x 2^columns) for marginals, columns the shorter side; O(columns^2 (rows + columns)) for the optimum
#pragma once

#include <optional>

#include "inference/inference.h"
#include "inference/matching_structure.h"

namespace sherlog {

MethodResult run_matching(const MethodContext& context);

// The component's structure where it is a matching of at least two rows and columns; else nothing.
std::optional<MatchingStructure> quick_matching(const GroundNetwork& network, ComponentId component);
// For components whose structure is known already: by component of the context.
MethodResult run_matching(const MethodContext& context, std::vector<MatchingStructure> structures);

// The best values of a component that is a matching, by variable of the component; nothing where no world is possible.
struct MatchingOptimum {
  double score = 0.0;
  std::vector<std::pair<VariableId, std::uint32_t>> values;
};
std::optional<MatchingOptimum> best_matching_world(const GroundNetwork& network, const MatchingStructure& structure,
                                                   std::span<const double> atom_bias);

}  // namespace sherlog
