#include "inference/bounded_problem.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

namespace sherlog {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr int kGuessRounds = 4;
// How much unlikely values pay for the others' bounds: one of probability p may be bounded by p^-kLean too much.
constexpr double kLean = 0.1;
constexpr double kSafeLog = 650.0;  // exp(-650) is well above the smallest normal double

std::size_t padded(std::size_t count) {
  return (count + BoundedProblem::kLanes - 1) / BoundedProblem::kLanes * BoundedProblem::kLanes;
}

class ProblemBuilder {
 public:
  ProblemBuilder(std::span<const std::uint32_t> cardinalities, std::span<const std::vector<std::uint32_t>> scopes,
                 const LogTables& tables)
      : cardinalities_(cardinalities), scopes_(scopes), tables_(tables) {}

  BoundedProblem run() {
    collect_unary();
    if (problem_.impossible) return std::move(problem_);
    guess_marginals();
    choose_order();
    for (std::uint32_t t = 0; t < scopes_.size(); ++t) {
      if (scopes_[t].size() > 1) place(t);
    }
    std::ranges::stable_sort(problem_.factors, {}, [](const auto& f) { return std::pair(f.second_last(), f.last()); });
    for (auto& factor : problem_.factors) bound(factor);
    finish_base();
    return std::move(problem_);
  }

 private:
  void collect_unary() {
    for (const std::uint32_t k : cardinalities_) unary_.emplace_back(k, 0.0);
    for (std::size_t t = 0; t < scopes_.size(); ++t) {
      const double top = *std::ranges::max_element(tables_[t]);
      if (top == -kInfinity) problem_.impossible = true;
      if (scopes_[t].size() != 1) continue;
      auto& unary = unary_[scopes_[t][0]];
      for (std::size_t v = 0; v < unary.size(); ++v) unary[v] += tables_[t][v];
    }
    for (const auto& unary : unary_) {
      if (*std::ranges::max_element(unary) == -kInfinity) problem_.impossible = true;
    }
  }

  // Calls visit(index, values) for every entry of the table; values by place in its scope.
  template <class Visit>
  void each_entry(std::size_t t, Visit visit) const {
    const auto& scope = scopes_[t];
    std::vector<std::uint32_t> values(scope.size(), 0);
    for (std::size_t i = 0; i < tables_[t].size(); ++i) {
      visit(i, values);
      for (std::size_t d = scope.size(); d-- > 0;) {
        if (++values[d] < cardinalities_[scope[d]]) break;
        values[d] = 0;
      }
    }
  }

  // Every variable sees its tables averaged over the others' guesses, a few times over.
  void guess_marginals() {
    LogTables plain(tables_.size());
    for (std::size_t t = 0; t < tables_.size(); ++t) {
      if (scopes_[t].size() == 1) continue;
      const double top = *std::ranges::max_element(tables_[t]);
      for (const double value : tables_[t]) plain[t].push_back(std::exp(value - top));
    }
    guess_.resize(unary_.size());
    for (std::size_t v = 0; v < unary_.size(); ++v) normalise(unary_[v], guess_[v]);
    for (int round = 0; round < kGuessRounds; ++round) {
      auto scores = unary_;
      for (std::size_t t = 0; t < tables_.size(); ++t) {
        if (scopes_[t].size() > 1) add_averages(t, plain[t], scores);
      }
      for (std::size_t v = 0; v < unary_.size(); ++v) {
        if (*std::ranges::max_element(scores[v]) > -kInfinity) normalise(scores[v], guess_[v]);
      }
    }
  }

  void add_averages(std::size_t t, const std::vector<double>& plain, std::vector<std::vector<double>>& scores) const {
    const auto& scope = scopes_[t];
    std::vector<std::vector<double>> average;
    average.reserve(scope.size());
    for (const std::uint32_t v : scope) average.emplace_back(cardinalities_[v], 0.0);
    each_entry(t, [&](std::size_t i, const std::vector<std::uint32_t>& values) {
      for (std::size_t d = 0; d < scope.size(); ++d) {
        double others = plain[i];
        for (std::size_t e = 0; e < scope.size(); ++e) {
          if (e != d) others *= guess_[scope[e]][values[e]];
        }
        average[d][values[d]] += others;
      }
    });
    for (std::size_t d = 0; d < scope.size(); ++d) {
      for (std::size_t v = 0; v < average[d].size(); ++v) scores[scope[d]][v] += std::log(average[d][v]);
    }
  }

  static void normalise(const std::vector<double>& logs, std::vector<double>& out) {
    const double top = *std::ranges::max_element(logs);
    out.clear();
    double sum = 0.0;
    for (const double x : logs) {
      out.push_back(std::exp(x - top));
      sum += out.back();
    }
    for (double& p : out) p /= sum;
  }

  // Fewest values that matter first. What matters are unlikely values too, as far as the gap asks for them: the sum of
  // square roots of probabilities lies between counting and entropy.
  void choose_order() {
    std::vector<double> spread;
    for (const auto& guess : guess_) {
      double sum = 0.0;
      for (const double p : guess) sum += std::sqrt(p);
      spread.push_back(sum);
    }
    problem_.order.resize(cardinalities_.size());
    std::iota(problem_.order.begin(), problem_.order.end(), 0u);
    std::ranges::stable_sort(problem_.order, {}, [&](std::uint32_t v) { return spread[v]; });
    while (problem_.order.size() < 2) problem_.order.insert(problem_.order.begin(), BoundedProblem::kNone);
    position_.resize(cardinalities_.size());
    for (std::uint32_t p = 0; p < problem_.order.size(); ++p) {
      const std::uint32_t v = problem_.order[p];
      if (v != BoundedProblem::kNone) position_[v] = p;
      problem_.size.push_back(v == BoundedProblem::kNone ? 1 : cardinalities_[v]);
      problem_.width.push_back(padded(problem_.size.back()));
      base_.push_back(v == BoundedProblem::kNone ? std::vector<double>{0.0} : unary_[v]);
    }
  }

  // Copies a table's logarithms into the layout of the search.
  void place(std::uint32_t t) {
    BoundedProblem::Factor factor;
    factor.table = t;
    factor.begin = problem_.ratios.size();
    for (const std::uint32_t v : scopes_[t]) factor.positions.push_back(position_[v]);
    std::ranges::sort(factor.positions);
    factor.strides.assign(factor.positions.size(), 1);
    std::size_t stride = problem_.width[factor.last()];
    for (std::size_t d = factor.strides.size() - 1; d-- > 0;) {
      factor.strides[d] = stride;
      stride *= problem_.size[factor.positions[d]];
    }
    for (const std::uint32_t v : scopes_[t]) {
      const auto place = std::ranges::lower_bound(factor.positions, position_[v]) - factor.positions.begin();
      factor.scope_strides.push_back(factor.strides[static_cast<std::size_t>(place)]);
    }
    problem_.ratios.resize(factor.begin + stride, -kInfinity);
    each_ratio(factor, cardinalities_, scopes_[t],
               [&](std::size_t i, std::size_t at) { problem_.ratios[at] = tables_[t][i]; });
    problem_.factors.push_back(std::move(factor));
  }

  // Turns the logarithms into ratios to a(second last) * b(last) and puts a and b into base_.
  void bound(const BoundedProblem::Factor& factor) {
    const std::uint32_t s = factor.second_last(), l = factor.last();
    const std::size_t rows = problem_.size[s], columns = problem_.size[l], width = problem_.width[l];
    std::size_t total = rows * width;
    for (std::size_t d = 0; d + 2 < factor.positions.size(); ++d) total *= problem_.size[factor.positions[d]];
    double* const logs = problem_.ratios.data() + factor.begin;
    const auto lean_s = leaning(s), lean_l = leaning(l);
    // Largest entry for each pair of values, discounted where they are unlikely.
    std::vector<double> most(rows * columns, -kInfinity);
    for (std::size_t i = 0; i < total; i += width) {
      const std::size_t row = i / width % rows;
      for (std::size_t v = 0; v < columns; ++v) {
        double& m = most[row * columns + v];
        m = std::max(m, logs[i + v] + lean_s[row] + lean_l[v]);
      }
    }
    std::vector<double> a(rows, -kInfinity), b(columns, -kInfinity);
    for (std::size_t row = 0; row < rows; ++row) {
      for (std::size_t v = 0; v < columns; ++v) b[v] = std::max(b[v], most[row * columns + v]);
    }
    for (std::size_t row = 0; row < rows; ++row) {
      for (std::size_t v = 0; v < columns; ++v) {
        if (b[v] > -kInfinity) a[row] = std::max(a[row], most[row * columns + v] - b[v]);
      }
      a[row] -= lean_s[row];
      base_[s][row] += a[row];
    }
    for (std::size_t v = 0; v < columns; ++v) {
      b[v] -= lean_l[v];
      base_[l][v] += b[v];
    }
    double least = 0.0;
    for (std::size_t i = 0; i < total; i += width) {
      const std::size_t row = i / width % rows;
      for (std::size_t v = 0; v < columns; ++v) {
        if (logs[i + v] == -kInfinity) {
          logs[i + v] = 0.0;
          continue;
        }
        const double ratio = std::min(0.0, logs[i + v] - a[row] - b[v]);
        least = std::min(least, ratio);
        logs[i + v] = std::exp(ratio);
      }
      std::fill(logs + i + columns, logs + i + width, 0.0);
    }
    least_ratio_ += least;
  }

  std::vector<double> leaning(std::uint32_t position) const {
    std::vector<double> out;
    for (const double p : guess_[problem_.order[position]]) out.push_back(kLean * std::log(std::max(p, 1e-30)));
    return out;
  }

  void finish_base() {
    for (std::size_t p = 0; p < base_.size(); ++p) {
      const double top = *std::ranges::max_element(base_[p]);
      if (top == -kInfinity) {
        problem_.impossible = true;
        return;
      }
      std::vector<double> plain;
      normalise(base_[p], plain);
      double sum = 0.0, least = 0.0;
      for (const double x : base_[p]) {
        sum += std::exp(x - top);
        if (x > -kInfinity) least = std::min(least, x - top);
      }
      least_ratio_ += least;
      problem_.log_scale += top + std::log(sum);
      plain.resize(problem_.width[p], 0.0);
      problem_.base.push_back(std::move(plain));
    }
    problem_.may_underflow = least_ratio_ < -kSafeLog;
  }

  std::span<const std::uint32_t> cardinalities_;
  std::span<const std::vector<std::uint32_t>> scopes_;
  const LogTables& tables_;
  std::vector<std::vector<double>> unary_, guess_;  // by variable
  std::vector<std::vector<double>> base_;           // by position, logarithms
  std::vector<std::uint32_t> position_;             // by variable
  double least_ratio_ = 0.0;                        // log of a lower bound of any product of ratios above zero
  BoundedProblem problem_;
};

}  // namespace

BoundedProblem make_bounded_problem(std::span<const std::uint32_t> cardinalities,
                                    std::span<const std::vector<std::uint32_t>> scopes, const LogTables& tables) {
  return ProblemBuilder(cardinalities, scopes, tables).run();
}

}  // namespace sherlog
