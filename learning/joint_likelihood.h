// Exact conditional log-likelihood: log P(open atoms as observed | the rest), component by component.
//
// Idea      With n_obs the observed counts and log Z(w) summed exactly for each component of each database's ground
//           network (inference/component_sum.h):
//             value     n_obs . w - log Z(w)
//             gradient  n_obs - E_w[n]
//           The features are compiled once to a sparse matrix A with a row for each table entry of each component and a
//           column for each weight; the potentials are A w, the expected counts A' b with b the entries' probabilities.
//           Where the open predicates are all there are, this is the log-likelihood of the database.
// Source    Della Pietra, Della Pietra & Lafferty, PAMI 19, 1997 (gradient); Lafferty et al., ICML 2001 (conditional).
// Cost      of an evaluation: that of the exact sums, plus the entries of A.
#pragma once

#include <Eigen/SparseCore>
#include <vector>

#include "inference/component_sum.h"
#include "learning/objective.h"
#include "learning/observed_network.h"

namespace sherlog {

// What one database adds; made on any thread, joined in order.
struct JointParts {
  struct Entry {
    std::uint32_t row;  // table entry, counted within this database
    std::uint32_t weight;
    double count;
  };
  std::vector<ComponentSum> sums;
  std::vector<std::uint32_t> first_row;  // of each sum
  std::uint32_t row_count = 0;
  std::vector<Entry> entries;
  std::vector<std::pair<std::uint32_t, double>> observed;  // (weight, count)
  double free_log_count = 0.0;
};

struct JointPartsOrProblem {
  JointParts parts;
  Termination termination = Termination::kCompleted;
  std::string message;
};

// Errors: kTooWide (with the width and what to use instead), kMemoryLimit, or as stopped.
// `search_gap`: share of a sum that a bounded search may leave out.
JointPartsOrProblem make_joint_parts(const ObservedNetwork& observed, const InferenceOptions& options,
                                     double search_gap, const StopCondition& stop);

class JointLikelihood : public Objective {
 public:
  // The parts must outlive this, and no two objectives over the same parts may be evaluated at the same time.
  JointLikelihood(std::span<const JointParts* const> databases, std::size_t weight_count, std::uint32_t threads,
                  const StopCondition& stop);

  std::size_t dimension() const override { return support_.size(); }
  double evaluate(std::span<const double> weights, std::span<double> gradient) override;
  // By central differences of the gradient.
  Eigen::MatrixXd information(std::span<const double> weights, std::span<const std::uint32_t> subset) override;
  std::span<const double> support() const override { return support_; }
  std::vector<std::vector<std::uint32_t>> indistinguishable() const override;
  Termination termination() const override { return termination_; }
  std::string message() const override { return message_; }

 private:
  void sum_all();
  void look_for_constants();

  using Matrix = Eigen::SparseMatrix<double, Eigen::RowMajor, std::int64_t>;
  struct Part {
    const ComponentSum* sum;
    std::int64_t first_row;
  };
  std::vector<Part> parts_;
  Matrix rows_;
  Eigen::VectorXd observed_;
  Eigen::VectorXd potentials_, beliefs_;  // by row
  std::vector<double> log_partitions_;    // by part
  std::vector<Termination> terminations_;
  double free_log_count_ = 0.0;
  std::vector<double> support_;
  std::uint32_t threads_;
  StopCondition stop_;
  Termination termination_ = Termination::kCompleted;
  std::string message_;
};

}  // namespace sherlog
