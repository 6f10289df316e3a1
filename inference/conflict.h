// A small set of hard constraints that no world meets together.
//
// Idea      Propagation alone often proves the contradiction, and names the constraints that took part. Else a small
//           search (decide, propagate, turn round) proves it; the constraints of all its dead ends together are
//           contradictory. Then constraints are left out one by one for as long as the rest is still contradictory:
//           what remains is minimal.
// Source    deletion-based minimisation: Chinneck & Dravnieks, ORSA J. Computing 3, 1991.
// Cost      Bounded by steps and by `stop`. Whatever ends it, the answer is contradictory; minimal where it was not
//           cut short.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "grounding/network.h"
#include "mln/monitor.h"

namespace sherlog {

// Whether the constraints (indices into network.constraints()) can be met together. If not: those that the proof used.
// Nothing where the search took more than `max_decisions`.
struct Satisfiability {
  bool possible = false;
  std::vector<std::uint32_t> core;  // where not possible, sorted
};
std::optional<Satisfiability> check_constraints(const GroundNetwork& network,
                                                std::span<const std::uint32_t> constraints, std::uint64_t max_decisions,
                                                const StopCondition& stop);

// `contradictory`: constraints known to contradict each other, e.g. all of a component. The answer is a subset, sorted.
std::vector<std::uint32_t> small_conflict(const GroundNetwork& network, std::span<const std::uint32_t> contradictory,
                                          const StopCondition& stop);

}  // namespace sherlog
