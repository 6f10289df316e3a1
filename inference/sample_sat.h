// Local search for a world that meets all demands, from wherever the World stands.
//
// Idea      WalkSAT on gates instead of clauses: take a random broken demand, walk down the gate to the single changes that
//           would repair it, and make the one that breaks least; with some probability a random one. SampleSAT mixes in
//           simulated-annealing moves, which spread its solutions more evenly over the solution space.
// Source    Wei, Erenrich & Selman, AAAI 2004 (SampleSAT); Selman, Kautz & Cohen 1996 (WalkSAT). We differ in moves: a variable with
//           several values moves as a whole.
// Cost      O(occurrences of the candidates) for each flip.
#pragma once

#include <cstdint>
#include <span>

#include "inference/rng.h"
#include "inference/world.h"
#include "mln/monitor.h"

namespace sherlog {

// Moves only `variables`. True once nothing is broken; false after `max_flips` or at `stop` (the World is then somewhere else than before).
bool sample_sat(World& world, Rng& rng, std::span<const VariableId> variables, std::uint64_t max_flips,
                const StopCondition* stop = nullptr);

}  // namespace sherlog
