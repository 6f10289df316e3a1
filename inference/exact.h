// Exact marginals, partition sums and most probable worlds, by variable elimination on each component.
//
// Idea      A component is compiled to tables (factor_graph.h: hard constraints shrink them, long disjunctions become
//           chains), an order is sought that keeps joined tables small (elimination_order.h), and two waves of
//           messages give every marginal at once (elimination.h). The largest joined table decides: a component whose
//           table would exceed options.max_table_log2 has one more chance where it has at most 64 variables: bounded
//           search (bounded_sum.h), which gets two or three seconds to come within 1e-10 of the sum, and does so where
//           most of the mass lies in few worlds. If that fails too, or the memory does not suffice, the component is
//           left out with a message that says how wide it is; the others are answered. A most probable world is found
//           by elimination only.
// Input     MethodContext: components, atom_bias (added to the score where the atom is true)
// Output    marginals of the queries of these components (NaN where a component could not be answered, as far as it
//           was asked for), log_partition where all were answered
// Errors    kTooWide, kMemoryLimit, kTimeLimit, kInterrupted with what was found; kNoPossibleWorld with `conflict`
// Cost      O(sum of joined tables), exact_cost() tells beforehand, or that of bounded search. Components run in parallel; the answer does not
//           depend on the number of threads.
#pragma once

#include "inference/inference.h"

namespace sherlog {

MethodResult run_exact(const MethodContext& context);

// A most probable world of the given components, proved: map_bound equals map_score where completed.
MethodResult run_exact_map(const MethodContext& context);

struct ExactCost {
  double largest_log2 = 0.0;  // entries of the largest joined table
  double total_log2 = 0.0;    // entries of all joined tables: a measure of time, about 2^29 of them a second
  double bytes = 0.0;
  bool possible = true;   // false: propagation alone found a contradiction
  bool feasible = false;  // within the options' table and memory limits
};
// Elimination is preferred to sampling where it touches at most this many table entries (log2), some tenths of a second.
inline constexpr double kQuickLog2 = 24.0;
ExactCost exact_cost(const GroundNetwork& network, ComponentId component, const InferenceOptions& options,
                     const StopCondition& stop);

// Bounded search answers the component within about a tenth of a second: found out by trying. For components that are
// not `feasible`.
bool search_is_cheap(const GroundNetwork& network, ComponentId component, const InferenceOptions& options,
                     std::span<const double> atom_bias, const StopCondition& stop);

}  // namespace sherlog
