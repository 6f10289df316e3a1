// Pseudo-log-likelihood: the sum over variables of log P(observed value | everything else as observed).
//
// Idea      No partition function over worlds: each term normalises over the values of one variable. The terms need only
//           how many groundings of each formula are true under each of these values, which does not depend on the
//           weights and is counted once (conditional_counts.h). With D the sparse matrix of these counts (a row for each
//           value of each variable, a column for each weight), m the multiplicity of a variable's group:
//             value     sum over groups of m (s_obs - log sum_r exp(s_r)),   s = D w
//             gradient  D' (m (1[r = obs] - p_r)),                           p_r = exp(s_r) / sum exp(s)
//             information  sum over groups of m (sum_r p_r d_r d_r' - e e'), e = sum_r p_r d_r
//           Concave in w. The same for single variables (pll, dpll) and for joint ones (bpll).
// Source    Besag, Statistician 24, 1975; for Markov logic Richardson & Domingos, Machine Learning 62, 2006, Sec. 4.
// Cost      an evaluation is linear in the entries of D.
#pragma once

#include <Eigen/SparseCore>
#include <vector>

#include "learning/conditional_counts.h"
#include "learning/objective.h"

namespace sherlog {

class PseudoLikelihood : public Objective {
 public:
  PseudoLikelihood(const ConditionalCounts& counts, std::size_t weight_count);

  std::size_t dimension() const override { return support_.size(); }
  double evaluate(std::span<const double> weights, std::span<double> gradient) override;
  Eigen::MatrixXd information(std::span<const double> weights, std::span<const std::uint32_t> subset) override;
  std::span<const double> support() const override { return support_; }
  std::vector<std::vector<std::uint32_t>> indistinguishable() const override { return equal_columns_; }

 private:
  // Which weights matter, and which are the same: only differences within a group count.
  void look_at_columns(const ConditionalCounts& counts);
  // Turns scores_ into probabilities by group; returns the value.
  double normalise();

  using Matrix = Eigen::SparseMatrix<double, Eigen::RowMajor, std::int64_t>;
  Matrix rows_;
  std::vector<ConditionalCounts::Group> groups_;
  double constant_ = 0.0;
  Eigen::VectorXd scores_;    // by row: s, then p
  Eigen::VectorXd residual_;  // by row: m (1[r = obs] - p)
  std::vector<double> support_;
  std::vector<std::vector<std::uint32_t>> equal_columns_;
};

}  // namespace sherlog
