#include "learning/joint_likelihood.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <thread>

#include "inference/parallel.h"
#include "inference/world.h"
#include "learning/column_signatures.h"

namespace sherlog {
namespace {

constexpr std::size_t kRowsForThreads = 20000;  // fewer are summed before a thread has started
constexpr double kConstantCount = 1e-8;         // share of a column by which rounding may move an expectation
constexpr double kDifference = 1e-4;            // of a weight, for second derivatives

}  // namespace

JointPartsOrProblem make_joint_parts(const ObservedNetwork& observed, const InferenceOptions& options,
                                     double search_gap, const StopCondition& stop) {
  ComponentSumOptions sums;
  sums.relative_gap = search_gap;
  JointPartsOrProblem out;
  const GroundNetwork& network = observed.network;
  const WorldIndex index(network);
  World world(index);
  world.assign(observed.values);
  out.parts.free_log_count = network.free_log_count();
  for (std::size_t c = 0; c < network.component_count(); ++c) {
    CompiledComponent compiled = compile_component_sum(network, ComponentId(c), options, stop, {}, sums);
    if (!compiled.sum) {
      out.termination = compiled.termination;
      out.message = std::move(compiled.message);
      return out;
    }
    for (const ComponentSum::Feature& f : compiled.sum->features()) {
      const Feature& feature = network.features()[f.feature];
      if (feature.weight_id == kVirtualEvidence) continue;
      const std::uint32_t weight = observed.weight_of[feature.weight_id.index()];
      // A count of the negation differs by a constant, which cancels between the observed world and log Z.
      const double count = feature.turned != f.negated ? -static_cast<double>(feature.count) : feature.count;
      for (const std::uint32_t entry : compiled.sum->entries(f)) {
        out.parts.entries.push_back({out.parts.row_count + entry, weight, count});
      }
      if (world.is_true(feature.literal) != f.negated) out.parts.observed.emplace_back(weight, count);
    }
    out.parts.first_row.push_back(out.parts.row_count);
    out.parts.row_count += static_cast<std::uint32_t>(compiled.sum->entry_count());
    out.parts.sums.push_back(std::move(*compiled.sum));
  }
  // Equal (row, weight) pairs become one entry of the matrix.
  std::ranges::sort(out.parts.entries, {}, [](const JointParts::Entry& e) { return std::pair(e.row, e.weight); });
  return out;
}

JointLikelihood::JointLikelihood(std::span<const JointParts* const> databases, std::size_t weight_count,
                                 std::uint32_t threads, const StopCondition& stop)
    : support_(weight_count, 0.0),
      threads_(threads != 0 ? threads : std::max(1u, std::thread::hardware_concurrency())),
      stop_(stop) {
  std::int64_t row_count = 0, entry_count = 0;
  for (const JointParts* parts : databases) {
    row_count += parts->row_count;
    entry_count += static_cast<std::int64_t>(parts->entries.size());
  }
  rows_.resize(row_count, static_cast<std::int64_t>(weight_count));
  rows_.reserve(entry_count);
  observed_ = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(weight_count));
  std::int64_t first = 0;
  for (const JointParts* pointer : databases) {
    const JointParts& parts = *pointer;
    std::size_t next = 0;
    for (std::uint32_t row = 0; row < parts.row_count; ++row) {
      rows_.startVec(first + row);
      while (next < parts.entries.size() && parts.entries[next].row == row) {
        const std::uint32_t weight = parts.entries[next].weight;
        double count = 0.0;
        for (; next < parts.entries.size() && parts.entries[next].row == row && parts.entries[next].weight == weight;
             ++next) {
          count += parts.entries[next].count;
        }
        if (count == 0.0) continue;
        rows_.insertBack(first + row, weight) = count;
        support_[weight] += 1.0;
      }
    }
    for (const auto& [weight, count] : parts.observed) observed_[weight] += count;
    for (std::size_t s = 0; s < parts.sums.size(); ++s) {
      parts_.push_back({&parts.sums[s], first + parts.first_row[s]});
    }
    first += parts.row_count;
    free_log_count_ += parts.free_log_count;
  }
  rows_.finalize();
  potentials_.resize(row_count);
  beliefs_.resize(row_count);
  log_partitions_.resize(parts_.size());
  terminations_.resize(parts_.size());
  look_for_constants();
}

// A count that is the same in every world (one value of a block each, say, or what a hard formula fixes) equals its
// expectation at any weights. Two points without a pattern tell: elsewhere they would both have to meet it by chance.
void JointLikelihood::look_for_constants() {
  std::vector<double> size(support_.size(), 1.0);
  for (std::int64_t r = 0; r < rows_.rows(); ++r) {
    for (Matrix::InnerIterator e(rows_, r); e; ++e) size[static_cast<std::size_t>(e.col())] += std::abs(e.value());
  }
  std::vector<double> weights(support_.size()), gradient(support_.size());
  std::vector<bool> constant(support_.size(), true);
  for (const double step : {0.6180339887, 0.7548776662}) {
    double position = 0.0;
    for (double& w : weights) {
      position += step;
      position -= std::floor(position);
      w = position - 0.5;
    }
    evaluate(weights, gradient);
    if (termination_ != Termination::kCompleted) return;
    for (std::size_t w = 0; w < weights.size(); ++w) {
      constant[w] = constant[w] && std::abs(gradient[w]) <= kConstantCount * size[w];
    }
  }
  for (std::size_t w = 0; w < weights.size(); ++w) {
    if (constant[w]) support_[w] = 0.0;
  }
}

void JointLikelihood::sum_all() {
  std::atomic<std::size_t> next{0};
  const auto run = [&] {
    for (std::size_t p = next++; p < parts_.size(); p = next++) {
      const Part& part = parts_[p];
      const std::size_t count = part.sum->entry_count();
      terminations_[p] = part.sum->sum({potentials_.data() + part.first_row, count}, log_partitions_[p],
                                       {beliefs_.data() + part.first_row, count}, stop_);
      if (terminations_[p] != Termination::kCompleted) return;
    }
  };
  std::fill(terminations_.begin(), terminations_.end(), Termination::kCompleted);
  const std::size_t wanted = static_cast<std::size_t>(potentials_.size()) < kRowsForThreads ? 1 : threads_;
  run_on_threads(std::min(wanted, parts_.size()), run);
  for (std::size_t p = 0; p < parts_.size(); ++p) {
    if (terminations_[p] == Termination::kCompleted) continue;
    termination_ = terminations_[p];
    message_ =
        termination_ == Termination::kTooWide ? "a component became too wide for exact sums; use --method mcsat" : "";
    return;
  }
}

double JointLikelihood::evaluate(std::span<const double> weights, std::span<double> gradient) {
  const Eigen::Map<const Eigen::VectorXd> w(weights.data(), static_cast<Eigen::Index>(weights.size()));
  Eigen::Map<Eigen::VectorXd> g(gradient.data(), static_cast<Eigen::Index>(gradient.size()));
  termination_ = Termination::kCompleted;  // a trial point that is too much for the sums does not end the search
  message_.clear();
  potentials_.noalias() = rows_ * w;
  sum_all();
  if (termination_ != Termination::kCompleted) return 0.0;
  double value = observed_.dot(w) - free_log_count_;
  for (const double log_partition : log_partitions_) value -= log_partition;
  g = observed_;
  g.noalias() -= rows_.transpose() * beliefs_;
  return value;
}

Eigen::MatrixXd JointLikelihood::information(std::span<const double> weights, std::span<const std::uint32_t> subset) {
  const auto size = static_cast<Eigen::Index>(subset.size());
  Eigen::MatrixXd result = Eigen::MatrixXd::Zero(size, size);
  std::vector<double> at(weights.begin(), weights.end()), above(weights.size()), below(weights.size());
  for (Eigen::Index i = 0; i < size; ++i) {
    const std::uint32_t moved = subset[static_cast<std::size_t>(i)];
    at[moved] = weights[moved] + kDifference;
    evaluate(at, above);
    at[moved] = weights[moved] - kDifference;
    evaluate(at, below);
    at[moved] = weights[moved];
    if (termination_ != Termination::kCompleted || stop_.reached()) return Eigen::MatrixXd(0, 0);
    for (Eigen::Index j = 0; j < size; ++j) {
      const std::uint32_t other = subset[static_cast<std::size_t>(j)];
      result(i, j) = (below[other] - above[other]) / (2.0 * kDifference);
    }
  }
  return 0.5 * (result + result.transpose().eval());
}

std::vector<std::vector<std::uint32_t>> JointLikelihood::indistinguishable() const {
  std::vector<std::uint64_t> signatures(support_.size(), 0);
  for (std::int64_t r = 0; r < rows_.rows(); ++r) {
    const std::uint64_t factor = row_factor(static_cast<std::uint64_t>(r));
    for (Matrix::InnerIterator e(rows_, r); e; ++e) {
      signatures[static_cast<std::size_t>(e.col())] += signature_term(factor, e.value());
    }
  }
  return equal_signatures(signatures);
}

}  // namespace sherlog
