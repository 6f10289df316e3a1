#include "inference/matching_sum.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "inference/assignment.h"

namespace sherlog {
namespace {

struct Pair {
  std::uint32_t column;
  double weight;
};

std::vector<double> transposed(std::span<const double> matrix, std::size_t rows, std::size_t columns) {
  std::vector<double> out(matrix.size());
  for (std::size_t r = 0; r < rows; ++r) {
    for (std::size_t c = 0; c < columns; ++c) out[c * rows + r] = matrix[r * columns + c];
  }
  return out;
}

// At least as many rows as columns.
class SubsetSum {
 public:
  SubsetSum(std::span<const double> log_weights, std::size_t rows, std::size_t columns)
      : rows_(rows), columns_(columns), sets_(std::size_t{1} << columns) {
    // The Hungarian algorithm wants the shorter side first.
    const Assignment best = best_assignment(transposed(log_weights, rows, columns), columns, rows);
    log_scale_ = best.gain;
    for (std::size_t r = 0; r < rows; ++r) {
      alone_.push_back(std::exp(-best.column_potential[r]));
      std::vector<Pair>& pairs = pairs_.emplace_back();
      for (std::size_t c = 0; c < columns; ++c) {
        const double weight = std::exp(log_weights[r * columns + c] - best.column_potential[r] - best.row_potential[c]);
        if (weight > 0) pairs.push_back({static_cast<std::uint32_t>(c), weight});
      }
    }
    for (double p : best.row_potential) column_alone_.push_back(std::exp(-p));
  }

  MatchingSum run(const StopCondition& stop) {
    std::vector<std::vector<double>> forward = {std::vector<double>(sets_, 0.0)};
    forward[0][0] = 1.0;
    for (std::size_t r = 0; r < rows_; ++r) {
      if (stop.reached()) return {};
      forward.push_back(with_row(forward.back(), r));
    }
    std::vector<double> backward(sets_, 1.0);
    for (std::size_t s = 0; s < sets_; ++s) {
      for (std::size_t c = 0; c < columns_; ++c) backward[s] *= (s >> c & 1) != 0 ? 1.0 : column_alone_[c];
    }
    double total = 0;
    for (std::size_t s = 0; s < sets_; ++s) total += forward[rows_][s] * backward[s];
    MatchingSum out;
    out.log_total = log_scale_ + std::log(total);
    std::vector<double> paired(rows_ * columns_, 0.0);
    for (std::size_t r = rows_; r-- > 0;) {
      if (stop.reached()) return {};
      go_back(forward[r], backward, r, {paired.data() + r * columns_, columns_});
    }
    for (double& p : paired) p = std::min(1.0, p / total);
    out.paired = std::move(paired);
    return out;
  }

 private:
  std::vector<double> with_row(const std::vector<double>& before, std::size_t r) const {
    std::vector<double> after(sets_);
    for (std::size_t s = 0; s < sets_; ++s) after[s] = before[s] * alone_[r];
    for (const Pair& pair : pairs_[r]) {
      const std::size_t bit = std::size_t{1} << pair.column;
      for (std::size_t high = 0; high < sets_; high += 2 * bit) {
        for (std::size_t s = high; s < high + bit; ++s) after[s + bit] += before[s] * pair.weight;
      }
    }
    return after;
  }

  // `backward`: of the sets after row r, becomes that of the sets before it.
  void go_back(const std::vector<double>& before, std::vector<double>& backward, std::size_t r,
               std::span<double> paired) const {
    std::vector<double> earlier(sets_);
    for (std::size_t s = 0; s < sets_; ++s) earlier[s] = backward[s] * alone_[r];
    for (const Pair& pair : pairs_[r]) {
      const std::size_t bit = std::size_t{1} << pair.column;
      double sum = 0;
      for (std::size_t high = 0; high < sets_; high += 2 * bit) {
        for (std::size_t s = high; s < high + bit; ++s) {
          const double then = pair.weight * backward[s + bit];
          sum += before[s] * then;
          earlier[s] += then;
        }
      }
      paired[pair.column] = sum;
    }
    backward = std::move(earlier);
  }

  std::size_t rows_, columns_, sets_;
  double log_scale_ = 0;
  std::vector<double> alone_, column_alone_;
  std::vector<std::vector<Pair>> pairs_;  // by row
};

}  // namespace

double matching_sum_log2(std::size_t rows, std::size_t columns) {
  return static_cast<double>(std::min(rows, columns)) + std::log2(static_cast<double>(std::max(rows, columns) + 1));
}

MatchingSum matching_sum(std::span<const double> log_weights, std::size_t rows, std::size_t columns,
                         const StopCondition& stop) {
  if (rows >= columns) return SubsetSum(log_weights, rows, columns).run(stop);
  MatchingSum out = SubsetSum(transposed(log_weights, rows, columns), columns, rows).run(stop);
  if (!out.paired.empty()) out.paired = transposed(out.paired, columns, rows);
  return out;
}

}  // namespace sherlog
