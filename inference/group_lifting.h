// Weighted clauses that differ only in a member of an at-most-one group, joined to one formula over the group.
//
// Idea      Where at most one x in S is true, at most one of the clauses A v !x, x in S, is false, so with equal weights
//             sum over x in S of w [A v !x]  =  w (|S| - 1) + w [A v !g],      g = OR of S,
//           and if the clause !A v (OR of S) has that weight too, both together are w + w [A <=> g]. A definition that a
//           modeller wrote as clauses ("appear(n) excludes every match of n, and one of them holds") is an equivalence again:
//           one table instead of |S| that tie A to everything, and an atom that a sampler can sum out (defined_atoms.h).
// Output    the same distribution: same variables, atoms, constraints and queries; features and constant score differ.
// Cost      O(weighted two-literal clauses x groups of their literals), nothing where there are none.
#pragma once

#include <optional>

#include "grounding/network.h"
#include "mln/monitor.h"

namespace sherlog {

// Nothing where no clauses can be joined.
std::optional<GroundNetwork> lift_over_groups(const GroundNetwork& network, const StopCondition* stop = nullptr);

}  // namespace sherlog
