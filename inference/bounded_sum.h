// Sum of a product of tables by depth-first search with upper bounds: for a few variables with many values each, where
// elimination would join everything into one table, and most of the mass lies in few joint values.
//
// Idea      Variables are assigned one after the other. A table acts on the last of its variables as soon as all others
//           are assigned; before that it is bounded by a product of one number for each value of its last two
//           variables, table <= a(second last) * b(last). So every variable l that is not yet assigned has a vector
//           m_l(v): its unary tables times the bounds, times table / (a * b) <= 1 for every table that acts already.
//             bound of a node = product of the m at the assigned values * product over the others of sum_v m_l(v)
//           is never less than the subtree's sum, and falls as variables are assigned. A subtree whose bound is below a
//           threshold is dropped; the dropped bounds together are what the sum can miss at most. The threshold is
//           lowered and the search repeated until that is small enough. The last two variables are not searched: their
//           sum is a vector-matrix-vector product, and there nearly all of the time is spent.
//           The bounds a * b lean on a rough guess of the marginals: they are tight where both values are likely, and
//           unlikely values pay for that. Variables with few likely values come first.
//           Probabilities of table entries come with the sum: a subtree's sum is added to the vectors of the variables
//           below it, and from there to the tables that act on them, as the search leaves the subtree.
// Source    Branch and bound with mini-bucket bounds of one variable, Dechter & Rish, JACM 50, 2003, turned from
//           maximum to sum; the threshold takes the place of the incumbent.
// Fails     where mass is spread over many joint values: it then says so, after max_steps at the latest. Six variables of
//           21 values are summed without dropping anything in 0.2 s.
// Cost      time O(joint values of all but two variables that matter * entries of one table), memory of the tables.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "inference/elimination.h"
#include "mln/monitor.h"

namespace sherlog {

struct BoundedSumOptions {
  double relative_gap = 1e-10;              // the sum may miss at most this share of itself
  std::uint64_t max_steps = 4'000'000'000;  // about multiplications: 2^29 to 2^30 of them a second
  bool with_marginals = true;
  // Where to start: BoundedSumResult::threshold of a similar problem, or 0. Saves repetitions, not correctness.
  double first_threshold = 0.0;
};

struct BoundedSumResult {
  // kCompleted; kTooWide: max_steps were used up; kTimeLimit, kInterrupted. Other than kCompleted: no marginals.
  Termination termination = Termination::kCompleted;
  double log_partition = 0.0;  // of what was summed; -infinity: nothing is possible (if completed), and no marginals
  double relative_gap = 0.0;   // true sum <= sum * (1 + relative_gap)
  std::vector<std::vector<double>> marginals;        // [variable][value]
  std::vector<std::vector<double>> table_marginals;  // [table][entry]
  double threshold = 0.0;                            // bound below which subtrees were dropped, as a share of the sum
  std::uint64_t nodes = 0, steps = 0;                // in all searches together
  std::uint32_t searches = 0;
};

// Tables of natural logarithms as for BucketTree: any order within a scope, the last variable runs fastest, no scope is
// empty. The same input gives the same bits on every machine.
BoundedSumResult bounded_sum(std::span<const std::uint32_t> cardinalities,
                             std::span<const std::vector<std::uint32_t>> scopes, const LogTables& tables,
                             const BoundedSumOptions& options, const StopCondition& stop);

}  // namespace sherlog
