#include "learning/optimiser.h"

#include <ceres/first_order_function.h>
#include <ceres/gradient_problem.h>
#include <ceres/gradient_problem_solver.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "learning/orthant_wise.h"

namespace sherlog {
namespace {

constexpr double kFlatGradient = 1e-4;  // at an objective of one nat; grows with its root

// Prior terms count for free weights only: a fixed one adds a constant.
class Problem {
 public:
  Problem(Objective& objective, std::span<const double> start, const std::vector<bool>& free,
          std::span<const Prior> priors, const StopCondition& stop)
      : objective_(objective), priors_(priors), stop_(stop), weights_(start.begin(), start.end()) {
    for (std::uint32_t w = 0; w < start.size(); ++w) {
      if (free[w]) free_.push_back(w);
    }
    gradient_.resize(start.size());
    result_.weights = weights_;
    result_.objective_with_prior = -std::numeric_limits<double>::infinity();
  }

  const std::vector<std::uint32_t>& free() const { return free_; }
  const Prior& prior(std::size_t i) const { return priors_[free_[i]]; }
  const StopCondition& stop() const { return stop_; }

  // Minus the objective and the smooth part of the prior. False where it could not be computed.
  bool evaluate(const double* x, double* cost, double* slope) {
    for (std::size_t i = 0; i < free_.size(); ++i) weights_[free_[i]] = x[i];
    const double value = objective_.evaluate(weights_, gradient_);
    if (objective_.termination() != Termination::kCompleted || !std::isfinite(value)) return false;
    double smooth = value, l1 = 0.0, norm = 0.0;
    for (std::size_t i = 0; i < free_.size(); ++i) {
      const Prior& p = prior(i);
      smooth += p.log_density(x[i]);
      l1 += p.l1 * std::abs(x[i]);
      const double g = gradient_[free_[i]] + p.slope(x[i]);
      if (slope != nullptr) slope[i] = -g;
      norm = std::max(norm, std::abs(l1_slope(g, x[i], p.l1)));
    }
    *cost = -smooth;
    if (smooth - l1 > result_.objective_with_prior) {
      result_.weights = weights_;
      result_.objective = value;
      result_.objective_with_prior = smooth - l1;
      result_.gradient_norm = norm;
    }
    return true;
  }

  // After each iteration: records it and says whether to go on.
  bool go_on(std::uint32_t iteration, double cost) {
    result_.iterations = iteration;
    result_.trace.push_back(-cost);
    stop_.monitor().progress(fmt::format("learning: objective {:.6f}, gradient {:.2g}", -cost, result_.gradient_norm),
                             static_cast<double>(iteration), 0.0);
    return !stop_.reached();
  }

  OptimiserResult& result() { return result_; }
  Objective& objective() { return objective_; }

 private:
  Objective& objective_;
  std::span<const Prior> priors_;
  const StopCondition& stop_;
  std::vector<std::uint32_t> free_;
  std::vector<double> weights_, gradient_;
  OptimiserResult result_;
};

class CeresFunction : public ceres::FirstOrderFunction {
 public:
  explicit CeresFunction(Problem& problem) : problem_(problem) {}
  bool Evaluate(const double* parameters, double* cost, double* gradient) const override {
    return problem_.evaluate(parameters, cost, gradient);
  }
  int NumParameters() const override { return static_cast<int>(problem_.free().size()); }

 private:
  Problem& problem_;
};

class CeresCallback : public ceres::IterationCallback {
 public:
  explicit CeresCallback(Problem& problem) : problem_(problem) {}
  ceres::CallbackReturnType operator()(const ceres::IterationSummary& summary) override {
    const bool on = problem_.go_on(static_cast<std::uint32_t>(summary.iteration), summary.cost);
    return on ? ceres::SOLVER_CONTINUE : ceres::SOLVER_ABORT;
  }

 private:
  Problem& problem_;
};

// Near the optimum of a large objective, rounding hides what a step would gain while the gradient is not yet tiny.
bool flat(const OptimiserResult& result) {
  return result.gradient_norm <= kFlatGradient * std::sqrt(std::max(1.0, std::abs(result.objective_with_prior)));
}

void solve_smooth(Problem& problem, std::vector<double>& x, const OptimiserOptions& options) {
  const ceres::GradientProblem gradient_problem(new CeresFunction(problem));
  ceres::GradientProblemSolver::Options solver;
  CeresCallback callback(problem);
  solver.callbacks.push_back(&callback);
  solver.logging_type = ceres::SILENT;
  solver.line_search_direction_type = ceres::LBFGS;
  solver.max_lbfgs_rank = 20;
  solver.max_num_iterations = static_cast<int>(options.max_iterations);
  solver.gradient_tolerance = options.gradient_tolerance;
  solver.function_tolerance = options.function_tolerance;
  solver.parameter_tolerance = 0.0;
  ceres::GradientProblemSolver::Summary summary;
  ceres::Solve(solver, gradient_problem, x.data(), &summary);
  OptimiserResult& result = problem.result();
  const bool small = result.gradient_norm <= options.gradient_tolerance;
  result.converged = small || (flat(result) && summary.termination_type != ceres::NO_CONVERGENCE);
  if (small) {
    result.reason = fmt::format("the gradient is below {:g}", options.gradient_tolerance);
  } else if (summary.termination_type == ceres::CONVERGENCE) {
    result.reason = fmt::format("the objective changes by less than a share of {:g}", options.function_tolerance);
  } else if (summary.termination_type == ceres::NO_CONVERGENCE) {
    result.reason = fmt::format("the limit of {} iterations was reached", options.max_iterations);
  } else {
    result.reason = "no step improves the objective any more";
  }
}

}  // namespace

OptimiserResult maximise(Objective& objective, std::span<const double> start, const std::vector<bool>& free,
                         std::span<const Prior> priors, const OptimiserOptions& options, const StopCondition& stop) {
  Problem problem(objective, start, free, priors, stop);
  OptimiserResult& result = problem.result();
  std::vector<double> x, l1;
  for (std::size_t i = 0; i < problem.free().size(); ++i) {
    x.push_back(start[problem.free()[i]]);
    l1.push_back(problem.prior(i).l1);
  }
  double cost = 0.0;
  std::vector<double> slope(x.size());
  const bool good_start = problem.evaluate(x.data(), &cost, slope.data());
  if (good_start && x.empty()) {
    result.converged = true;
    result.reason = "no weight is free";
  } else if (good_start && std::ranges::all_of(l1, [](double rate) { return rate == 0.0; })) {
    solve_smooth(problem, x, options);
  } else if (good_start) {
    const auto evaluate = [&](const std::vector<double>& at, double& value, std::vector<double>& gradient) {
      return problem.evaluate(at.data(), &value, gradient.data());
    };
    const auto go_on = [&](std::uint32_t iteration, double value) { return problem.go_on(iteration, value); };
    const OrthantWiseOutcome outcome = minimise_orthant_wise(x, l1, options.max_iterations, options.gradient_tolerance,
                                                             options.function_tolerance, evaluate, go_on);
    result.converged = outcome.converged && (result.gradient_norm <= options.gradient_tolerance || flat(result));
    result.reason = outcome.reason;
  }
  // An optimum that was reached stays one; anything else that a limit or an interrupt ended was cut short.
  const bool cut = objective.termination() == Termination::kInterrupted ||
                   objective.termination() == Termination::kTimeLimit || stop.reached();
  const bool at_optimum = result.converged && result.gradient_norm <= options.gradient_tolerance;
  if (!good_start) {
    result.termination = objective.termination();
  } else if (cut && !at_optimum && !x.empty()) {
    result.termination = objective.termination() != Termination::kCompleted ? objective.termination() : stop.reason();
    result.reason = "it was stopped before the optimum was reached";
  }
  if (result.termination != Termination::kCompleted) result.converged = false;
  return std::move(result);
}

}  // namespace sherlog
