// In which order to sum variables out, so that the tables stay small.
//
// Idea      Eliminating a variable joins all tables that mention it; the joined table spans the variable and its
//           neighbours, which become a clique. Finding the best order is NP-hard; greedy orders are good in practice.
//           Candidates:
//             minimum weight   smallest joined table next
//             minimum fill     fewest new edges next, ties by weight; with shuffled ties where tables stay large
//             minimum degree   Boost.Graph's multiple minimum degree ordering
//             sweep            an order that the caller knows to suit the structure, e.g. row by row of a matrix, where
//                              greedy orders end wider (2^31 against 2^24 on a one-to-one matching of 20 and 20)
//           and of those whose largest table is within the limit the one with the fewest entries in total is taken.
//           Vertices with at most one neighbour go first: that is always optimal, and it makes trees and stars linear.
// Source    Koller & Friedman, Probabilistic Graphical Models, 2009, 9.4.3; Liu, ACM TOMS 11(2), 1985 (minimum degree).
// Cost      Bounded by `max_steps` elementary steps, not by a clock: the same input gives the same order everywhere.
#pragma once

#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "mln/monitor.h"

namespace sherlog {

struct OrderLimits {
  double max_table_log2 = std::numeric_limits<double>::infinity();  // far beyond it the search gives up
  std::uint64_t max_steps = 100'000'000;
  bool thorough = true;  // false: two greedy orders, for small problems that come by the thousand
  double max_total =
      std::numeric_limits<double>::infinity();  // entries of all joined tables beyond which no order is wanted
  const StopCondition* stop = nullptr;          // gives up where it says so
};

struct EliminationOrder {
  std::vector<std::uint32_t> order;  // all variables where complete; else empty
  bool complete = false;             // false: given up, the figures below are what was met until then
  double largest_log2 = 0.0;         // entries of the largest joined table, log2
  double total_log2 = 0.0;           // entries of all joined tables, log2
};

// `scopes`: variables of each table (without repetitions). `sweep`: empty, or all variables in an order to be tried
// too.
EliminationOrder find_elimination_order(std::span<const std::uint32_t> cardinalities,
                                        std::span<const std::vector<std::uint32_t>> scopes,
                                        const OrderLimits& limits = {}, std::span<const std::uint32_t> sweep = {});

}  // namespace sherlog
