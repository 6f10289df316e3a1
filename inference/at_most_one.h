// Groups of literals of which at most one is true, seen in pairwise hard clauses.
//
// Idea      "One-to-one" written as !P(a,b) v !P(a,c) for all b, c grounds to a clause for each pair. The pairs are
//           the edges of a graph over (variable, value); values of one variable exclude each other too. A clique of it
//           is one constraint "at most one", which a chain, a sampler's move or a linear inequality states in linear
//           size. Cliques are grown greedily from edges not covered so far.
// Source    Biere et al., "Detecting cardinality constraints in CNF", SAT 2014 (there on clauses, greedily as well).
// Cost      O(sum over groups of literals x neighbours); it stops looking after a number of steps linear in the edges. Two times four
//           bytes for each end of an edge.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "grounding/network.h"
#include "mln/monitor.h"

namespace sherlog {

struct VariableValue {
  VariableId variable;
  std::uint32_t value = 0;
  auto operator<=>(const VariableValue&) const = default;
};

struct AtMostOne {
  std::vector<std::vector<VariableValue>> groups;  // at least three literals of at least two variables each, sorted
  std::vector<std::uint32_t> covered;              // constraints (indices) that the groups imply, sorted
};

// `stop`: where it says so, the groups found until then.
AtMostOne find_at_most_one(const GroundNetwork& network, std::span<const std::uint32_t> constraints,
                           const StopCondition* stop = nullptr);
inline AtMostOne find_at_most_one(const GroundNetwork& network, ComponentId component,
                                  const StopCondition* stop = nullptr) {
  return find_at_most_one(network, network.component_constraints(component), stop);
}

// The same distribution with the covered constraints replaced by one at-most-one gate for each group. Atoms, variables, features and
// queries keep their numbers; gates and constraints do not.
GroundNetwork fold_at_most_one(const GroundNetwork& network, const AtMostOne& found);

}  // namespace sherlog
