// How a ground network is stated as a 0/1 linear program; see integer_program.h for the idea.
#pragma once

#include <limits>
#include <vector>

#include "grounding/network.h"

namespace sherlog {

// Minimise objective . x over row_lower <= A x <= row_upper and column bounds; the first columns are the atoms, in their order. The
// score of a world is constant - objective . x at its best completion.
struct LinearProgram {
  double constant = 0.0;
  std::vector<double> objective, column_lower, column_upper;
  std::vector<int> row_start{0}, index;  // the rows' columns, and below their factors
  std::vector<double> value, row_lower, row_upper;
  // Atoms; gates of many inputs too: they follow from the atoms, but to branch on "any of these" makes smaller trees (UW-CSE: 77
  // nodes instead of 340).
  std::vector<bool> is_whole;

  int add_column(double cost) {  // between 0 and 1
    is_whole.push_back(false);
    objective.push_back(cost), column_lower.push_back(0.0), column_upper.push_back(1.0);
    return static_cast<int>(objective.size() - 1);
  }
};

// Rows without a limit on one side have +-kUnlimited there.
inline constexpr double kUnlimited = std::numeric_limits<double>::max();  // as the solvers spell it

LinearProgram state_linear_program(const GroundNetwork& network);

}  // namespace sherlog
