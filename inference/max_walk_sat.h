// MaxWalkSAT: local search for a most probable world, over variables and whole formulas.
//
// Idea      Take something unhappy (a broken hard formula if there is one, otherwise a weighted formula that is not as its weight
//           wants) and repair it. The moves that repair are found by walking down its gates: an OR becomes true by any input, and
//           false by its true inputs; an IFF by either side. A move sets a whole variable, so a block never holds two values. The
//           best move is made (fewer broken hard formulas first, then score), now and then a random one; what was changed a
//           few steps ago is left alone. Several restarts from different starts, each begun and ended by a descent over
//           single variables. Hard formulas are never traded against weights.
// Source    Kautz, Selman & Jiang, 1997; Richardson & Domingos, Machine Learning 62, 2006 (Table 3); tabu: Mazure et al., AAAI 1997.
//           We differ in gates instead of clauses, blocks as variables and lexicographic order.
// Random    draws from Rng(seed, restart): the same answer for any number of threads. A restart that reaches `enough` ends only
//           restarts with higher numbers, for the same reason.
// Cost      a step: moves of one formula x occurrences of their atoms; no allocation. Memory O(gate inputs) a thread.
#pragma once

#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "grounding/network.h"
#include "mln/monitor.h"

namespace sherlog {

struct MaxWalkSatOptions {
  std::uint64_t flips = 1000000;    // steps of a restart
  std::uint64_t patience = 250000;  // steps without a better world that end a restart
  std::uint32_t restarts = 4;
  std::uint64_t seed = 1;
  std::uint32_t threads = 1;
  double noise = 0.1;                                       // share of random moves
  std::uint32_t tabu = 5;                                   // steps
  double enough = std::numeric_limits<double>::infinity();  // score (without constant_score) at which to stop
};

struct LocalOptimum {
  std::vector<std::uint32_t> values;  // by variable
  std::size_t broken = 0;             // hard formulas (distinct literals) that are not met
  double score = 0.0;                 // sum of features, constant_score left out
  std::uint64_t flips = 0;            // steps made, all restarts together
};

// The best world met (fewest broken, then score, then lowest restart). `starts` are used first; later restarts begin at random.
LocalOptimum max_walk_sat(const GroundNetwork& network, const MaxWalkSatOptions& options, const StopCondition& stop,
                          std::span<const std::vector<std::uint32_t>> starts = {});

// Best single-variable changes from `start` until none helps: never worse than `start`.
LocalOptimum descend(const GroundNetwork& network, std::vector<std::uint32_t> start, const StopCondition& stop);

}  // namespace sherlog
