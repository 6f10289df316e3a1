// A product of tables made ready for bounded_sum: variables in search order, every table as ratios to an upper bound
// of one number for each value of its last two variables.
//
// Idea      The bound a(second last) * b(last) of a table leans on a rough guess of the marginals: it is tight where both
//           values are likely, and unlikely ones pay for that. See bounded_sum.h for what it is used for.
// Cost      O(entries of the tables), a few times over.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "inference/elimination.h"

namespace sherlog {

// By position in the search order; vectors over values are padded with zeros to whole packs of kLanes.
struct BoundedProblem {
  static constexpr std::size_t kLanes = 4;
  static constexpr std::uint32_t kNone = 0xffffffffu;

  // A table over two or more variables, in search order; the last runs fastest.
  struct Factor {
    std::uint32_t table = 0;
    std::vector<std::uint32_t> positions;    // of its variables, increasing
    std::vector<std::size_t> strides;        // of each of these in `ratios`
    std::vector<std::size_t> scope_strides;  // the same in the order of the table's own scope
    std::size_t begin = 0;                   // in `ratios`
    std::uint32_t last() const { return positions.back(); }
    std::uint32_t second_last() const { return positions[positions.size() - 2]; }
  };

  std::vector<std::uint32_t> order;       // variable at each position; two at least, kNone: has one value and no tables
  std::vector<std::size_t> size, width;   // by position: values, padded
  std::vector<Factor> factors;            // sorted by second last, then last variable
  std::vector<double> ratios;             // table / bound, <= 1
  std::vector<std::vector<double>> base;  // by position: unary tables times bounds, scaled to sum 1
  double log_scale = 0.0;                 // the whole product is exp(log_scale) times that of base and ratios
  bool impossible = false;                // a table or variable has no entry above zero; the rest is not filled in
  bool may_underflow = false;             // a product of ratios above zero may come out as zero
};

// Tables of natural logarithms, the last variable of a scope runs fastest, no scope is empty.
BoundedProblem make_bounded_problem(std::span<const std::uint32_t> cardinalities,
                                    std::span<const std::vector<std::uint32_t>> scopes, const LogTables& tables);

// Calls visit(index in the table, index in problem.ratios) for every entry of the factor's table.
template <class Visit>
void each_ratio(const BoundedProblem::Factor& factor, std::span<const std::uint32_t> cardinalities,
                std::span<const std::uint32_t> scope, Visit visit) {
  std::vector<std::uint32_t> values(scope.size(), 0);
  std::size_t at = factor.begin;
  for (std::size_t i = 0;; ++i) {
    visit(i, at);
    std::size_t d = scope.size();
    while (d > 0) {
      --d;
      at += factor.scope_strides[d];
      if (++values[d] < cardinalities[scope[d]]) break;
      at -= factor.scope_strides[d] * values[d];
      values[d] = 0;
      if (d == 0) return;
    }
  }
}

}  // namespace sherlog
