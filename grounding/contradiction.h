// Hard formulas that contradict each other: found by unit propagation.
//
// Idea      A constraint that demands one atom decides it; a disjunction all of whose inputs but one are false decides
//           that one; a true value of a block denies its siblings, and the last value of a '!' block is true. Where a
//           constraint or a block ends up with nothing, the constraints that led there are read backwards, and each is
//           left out in turn: where propagation still fails without it, it was not needed. What takes search to refute
//           is left to inference.
// Source    Dowling & Gallier, "Linear-time algorithms for testing the satisfiability of propositional Horn formulae",
//           1984: counters, not watched literals, since nothing is ever taken back.
// Cost      linear in the size of the constraints; nothing where no constraint demands a single atom.
#pragma once

#include <vector>

#include "grounding/network.h"

namespace sherlog {

// Indices of constraints that no world meets together; dropping any one ends what propagation can refute. Empty: none
// found.
std::vector<std::uint32_t> contradicting_constraints(const GroundNetwork& network);

}  // namespace sherlog
