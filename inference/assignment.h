// The best partial matching of rows with columns: the Hungarian algorithm.
//
// Idea      Each row may stay alone, which is a column of its own that costs nothing. Rows are added one by one along a
//           shortest augmenting path in reduced costs (Dijkstra without a heap: the matrix is dense). The potentials at
//           the end prove the optimum, and they are what matching_sum.h scales its sums with.
// Source    Kuhn, Naval Research Logistics 2, 1955; Jonker & Volgenant, Computing 38, 1987.
// Cost      O(rows^2 (rows + columns)) time, O(rows + columns) memory besides the gains; give it fewer rows than columns
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

namespace sherlog {

struct Assignment {
  std::vector<std::optional<std::uint32_t>> column_of;  // by row
  double gain = 0.0;                                    // sum over the pairs
  // row_potential[r] + column_potential[c] >= gain(r, c), equal where they are matched; none is below 0, and those of rows and
  // columns without a partner are 0.
  std::vector<double> row_potential, column_potential;
};

// `gains`: rows x columns, row by row; minus infinity forbids a pair, and no pair with a negative gain is taken.
Assignment best_assignment(std::span<const double> gains, std::size_t rows, std::size_t columns);

}  // namespace sherlog
