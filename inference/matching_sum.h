// Sums over all partial matchings of rows with columns: their total weight, and how probable each pair is.
//
// Idea      A matching weighs the product of its pairs' weights. Rows come one by one; what later rows need to know is the set of
//           columns that are taken, so the sum runs over subsets of the columns (there are fewer of them than rows, otherwise
//           both change places). A second wave from the end gives every pair's probability. Before, weights are divided by
//           exp(row potential + column potential) of the best matching (assignment.h): then the best matching weighs 1 and
//           no other one more, so nothing overflows and what underflows is nothing.
// Source    Ryser's and Bellman's dynamic programming for permanents; scaling by duals: ours.
// Cost      O(rows x columns x 2^columns) time, O(rows x 2^columns) memory: 15 x 10 takes 0.3 ms
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "mln/monitor.h"

namespace sherlog {

struct MatchingSum {
  double log_total = 0.0;      // the empty matching weighs 1
  std::vector<double> paired;  // rows x columns, row by row: probabilities
};

// Entries of the table that matching_sum makes, log2.
double matching_sum_log2(std::size_t rows, std::size_t columns);

// `log_weights`: rows x columns, row by row; minus infinity forbids a pair. Stops, with `paired` empty, when `stop` says so.
// Requires the smaller side to have at most 26 members.
MatchingSum matching_sum(std::span<const double> log_weights, std::size_t rows, std::size_t columns,
                         const StopCondition& stop);

}  // namespace sherlog
