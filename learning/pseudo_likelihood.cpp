#include "learning/pseudo_likelihood.h"

#include <algorithm>
#include <cmath>

#include "learning/column_signatures.h"

namespace sherlog {

PseudoLikelihood::PseudoLikelihood(const ConditionalCounts& counts, std::size_t weight_count)
    : groups_(counts.groups().begin(), counts.groups().end()),
      constant_(counts.constant()),
      support_(weight_count, 0.0) {
  const auto row_count = static_cast<std::int64_t>(counts.row_count());
  rows_.resize(row_count, static_cast<std::int64_t>(weight_count));
  rows_.reserve(static_cast<std::int64_t>(counts.entry_count()));
  for (std::int64_t r = 0; r < row_count; ++r) {
    rows_.startVec(r);
    const auto columns = counts.columns(static_cast<std::size_t>(r));
    const auto values = counts.counts(static_cast<std::size_t>(r));
    for (std::size_t i = 0; i < columns.size(); ++i) rows_.insertBack(r, columns[i]) = values[i];
  }
  rows_.finalize();
  scores_.resize(row_count);
  residual_.resize(row_count);
  look_at_columns(counts);
}

void PseudoLikelihood::look_at_columns(const ConditionalCounts& counts) {
  std::vector<std::uint64_t> signatures(support_.size(), 0);
  for (std::size_t g = 0; g < groups_.size(); ++g) {
    const ConditionalCounts::Group& group = groups_[g];
    if (group.row_count + group.zero_values < 2) continue;  // hard formulas leave one value: nothing is learned
    // Without a zero row the first row is what the others are compared with.
    std::uint64_t others = 0;
    for (std::uint32_t r = 1; r < group.row_count; ++r) others += row_factor(group.first_row + r);
    for (std::uint32_t r = 0; r < group.row_count; ++r) {
      const std::uint32_t row = group.first_row + r;
      const std::uint64_t factor = r == 0 && group.zero_values == 0 ? 0 - others : row_factor(row);
      for (std::size_t i = 0; i < counts.columns(row).size(); ++i) {
        signatures[counts.columns(row)[i]] += signature_term(factor, counts.counts(row)[i]);
        support_[counts.columns(row)[i]] += group.multiplicity;
      }
    }
  }
  for (std::size_t w = 0; w < support_.size(); ++w) {
    if (signatures[w] == 0) support_[w] = 0.0;
  }
  equal_columns_ = equal_signatures(signatures);
}

double PseudoLikelihood::normalise() {
  double value = constant_;
  for (const ConditionalCounts::Group& group : groups_) {
    double* s = scores_.data() + group.first_row;
    double* residual = residual_.data() + group.first_row;
    double top = group.zero_values > 0 ? 0.0 : s[0];
    for (std::uint32_t r = 0; r < group.row_count; ++r) top = std::max(top, s[r]);
    double sum = group.zero_values * std::exp(-top);
    for (std::uint32_t r = 0; r < group.row_count; ++r) sum += std::exp(s[r] - top);
    const double log_sum = top + std::log(sum);
    const double observed = group.observed == ConditionalCounts::kZeroRow ? 0.0 : s[group.observed];
    value += group.multiplicity * (observed - log_sum);
    for (std::uint32_t r = 0; r < group.row_count; ++r) {
      s[r] = std::exp(s[r] - log_sum);
      residual[r] = -group.multiplicity * s[r];
    }
    if (group.observed != ConditionalCounts::kZeroRow) residual[group.observed] += group.multiplicity;
  }
  return value;
}

double PseudoLikelihood::evaluate(std::span<const double> weights, std::span<double> gradient) {
  const Eigen::Map<const Eigen::VectorXd> w(weights.data(), static_cast<Eigen::Index>(weights.size()));
  scores_.noalias() = rows_ * w;
  const double value = normalise();
  Eigen::Map<Eigen::VectorXd> g(gradient.data(), static_cast<Eigen::Index>(gradient.size()));
  g.noalias() = rows_.transpose() * residual_;
  return value;
}

Eigen::MatrixXd PseudoLikelihood::information(std::span<const double> weights, std::span<const std::uint32_t> subset) {
  const Eigen::Map<const Eigen::VectorXd> w(weights.data(), static_cast<Eigen::Index>(weights.size()));
  scores_.noalias() = rows_ * w;
  normalise();
  constexpr std::uint32_t kOut = 0xffffffffu;
  std::vector<std::uint32_t> position(weights.size(), kOut);
  for (std::uint32_t i = 0; i < subset.size(); ++i) position[subset[i]] = i;
  const auto size = static_cast<Eigen::Index>(subset.size());
  Eigen::MatrixXd result = Eigen::MatrixXd::Zero(size, size);
  std::vector<double> mean(subset.size(), 0.0);
  std::vector<std::uint32_t> touched;
  for (const ConditionalCounts::Group& group : groups_) {
    touched.clear();
    for (std::uint32_t r = group.first_row; r < group.first_row + group.row_count; ++r) {
      for (Matrix::InnerIterator a(rows_, r); a; ++a) {
        const std::uint32_t i = position[static_cast<std::size_t>(a.col())];
        if (i == kOut) continue;
        touched.push_back(i);
        mean[i] += scores_[r] * a.value();
        for (Matrix::InnerIterator b(rows_, r); b; ++b) {
          const std::uint32_t j = position[static_cast<std::size_t>(b.col())];
          if (j != kOut) result(i, j) += group.multiplicity * scores_[r] * a.value() * b.value();
        }
      }
    }
    std::ranges::sort(touched);
    touched.erase(std::unique(touched.begin(), touched.end()), touched.end());
    for (const std::uint32_t i : touched) {
      for (const std::uint32_t j : touched) result(i, j) -= group.multiplicity * mean[i] * mean[j];
    }
    for (const std::uint32_t i : touched) mean[i] = 0.0;
  }
  return result;
}

}  // namespace sherlog
