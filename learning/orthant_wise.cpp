#include "learning/orthant_wise.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <deque>

namespace sherlog {
namespace {

constexpr std::size_t kMemory = 20;  // pairs of steps kept
constexpr double kSufficientDecrease = 1e-4;
constexpr int kMostHalvings = 40;

double dot(const std::vector<double>& a, const std::vector<double>& b) {
  double sum = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += a[i] * b[i];
  return sum;
}

double penalty(const std::vector<double>& x, const std::vector<double>& l1) {
  double sum = 0.0;
  for (std::size_t i = 0; i < x.size(); ++i) sum += l1[i] * std::abs(x[i]);
  return sum;
}

// Steps and changes of the gradient: an approximation of the inverse curvature.
class Memory {
 public:
  void add(std::vector<double> step, std::vector<double> change) {
    const double curvature = dot(step, change);
    if (curvature <= 1e-14 * dot(change, change)) return;
    pairs_.push_back({std::move(step), std::move(change), 1.0 / curvature});
    if (pairs_.size() > kMemory) pairs_.pop_front();
  }
  // The two-loop recursion (Nocedal & Wright, Alg. 7.4).
  void multiply(std::vector<double>& v) const {
    std::vector<double> alpha(pairs_.size());
    for (std::size_t i = pairs_.size(); i-- > 0;) {
      alpha[i] = pairs_[i].rho * dot(pairs_[i].step, v);
      for (std::size_t k = 0; k < v.size(); ++k) v[k] -= alpha[i] * pairs_[i].change[k];
    }
    if (!pairs_.empty()) {
      const Pair& last = pairs_.back();
      const double scale = 1.0 / (last.rho * dot(last.change, last.change));
      for (double& entry : v) entry *= scale;
    }
    for (std::size_t i = 0; i < pairs_.size(); ++i) {
      const double beta = pairs_[i].rho * dot(pairs_[i].change, v);
      for (std::size_t k = 0; k < v.size(); ++k) v[k] += (alpha[i] - beta) * pairs_[i].step[k];
    }
  }
  bool empty() const { return pairs_.empty(); }
  void clear() { pairs_.clear(); }

 private:
  struct Pair {
    std::vector<double> step, change;
    double rho;
  };
  std::deque<Pair> pairs_;
};

}  // namespace

double l1_slope(double slope, double w, double l1) {
  if (l1 == 0.0) return slope;
  if (w != 0.0) return slope - std::copysign(l1, w);
  if (slope > l1) return slope - l1;
  return slope < -l1 ? slope + l1 : 0.0;
}

OrthantWiseOutcome minimise_orthant_wise(
    std::vector<double>& x, const std::vector<double>& l1, std::uint32_t max_iterations, double gradient_tolerance,
    double function_tolerance,
    const std::function<bool(const std::vector<double>&, double&, std::vector<double>&)>& evaluate,
    const std::function<bool(std::uint32_t, double)>& go_on) {
  const std::size_t n = x.size();
  std::vector<double> gradient(n), next_gradient(n), pseudo(n), direction(n), next(n);
  double f = 0.0;
  if (!evaluate(x, f, gradient)) return {false, "the objective could not be computed"};
  double value = f + penalty(x, l1);
  Memory memory;
  for (std::uint32_t iteration = 1; iteration <= max_iterations; ++iteration) {
    double norm = 0.0;
    for (std::size_t i = 0; i < n; ++i) {
      pseudo[i] = -l1_slope(-gradient[i], x[i], l1[i]);
      norm = std::max(norm, std::abs(pseudo[i]));
    }
    if (norm <= gradient_tolerance) return {true, fmt::format("the gradient is below {:g}", gradient_tolerance)};
    direction = pseudo;
    memory.multiply(direction);
    for (std::size_t i = 0; i < n; ++i) {
      direction[i] = direction[i] * pseudo[i] > 0.0 ? -direction[i] : 0.0;
    }
    double step = memory.empty() ? 1.0 / std::max(1.0, std::sqrt(dot(pseudo, pseudo))) : 1.0;
    bool found = false;
    double next_f = 0.0, next_value = 0.0;
    for (int halving = 0; halving < kMostHalvings && !found; ++halving, step *= 0.5) {
      double gain = 0.0;
      for (std::size_t i = 0; i < n; ++i) {
        const double orthant = x[i] != 0.0 ? x[i] : -pseudo[i];
        const double moved = x[i] + step * direction[i];
        next[i] = l1[i] == 0.0 || moved * orthant > 0.0 ? moved : 0.0;
        gain += pseudo[i] * (next[i] - x[i]);
      }
      if (!evaluate(next, next_f, next_gradient)) return {false, "the objective could not be computed"};
      next_value = next_f + penalty(next, l1);
      found = next_value <= value + kSufficientDecrease * gain;
    }
    if (!found) {
      if (memory.empty()) return {true, "no step improves the objective any more"};
      memory.clear();  // once more along the steepest descent
      continue;
    }
    std::vector<double> moved(n), change(n);
    for (std::size_t i = 0; i < n; ++i) {
      moved[i] = next[i] - x[i];
      change[i] = next_gradient[i] - gradient[i];
    }
    memory.add(std::move(moved), std::move(change));
    const double before = value;
    x = next;
    gradient = next_gradient;
    value = next_value;
    if (!go_on(iteration, value)) return {false, "it was stopped"};
    if (std::abs(before - value) <= function_tolerance * std::abs(value)) {
      return {true, fmt::format("the objective changes by less than a share of {:g}", function_tolerance)};
    }
  }
  return {false, fmt::format("the limit of {} iterations was reached", max_iterations)};
}

}  // namespace sherlog
