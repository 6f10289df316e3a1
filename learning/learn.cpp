#include "learning/learn.h"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <numeric>

#include "learning/learned_model.h"
#include "learning/methods.h"
#include "learning/optimiser.h"

namespace sherlog {
namespace {

constexpr std::uint32_t kMostIterations = 1000000000;
constexpr std::size_t kMostErrors = 4000;  // standard errors take the cube of this

class Learning {
 public:
  Learning(const Model& model, std::span<const Evidence> databases, const LearningOptions& options, Monitor& monitor)
      : options_(options), stop_(monitor, options.max_seconds), set_(model, databases) {
    result_.method = options.method;
    result_.options = options;
    result_.databases = databases.size();
  }

  LearningResult run() {
    if (check()) work();
    result_.seconds.total = stop_.seconds();
    result_.model = std::move(set_.model);
    return std::move(result_);
  }

 private:
  bool fail(Termination termination, std::string message) {
    result_.termination = termination;
    result_.message = std::move(message);
    return false;
  }

  bool check() {
    if (std::string problem = validate(options_); !problem.empty()) return fail(Termination::kRefused, problem);
    if (!set_.weights.problem().empty()) return fail(Termination::kMemoryLimit, set_.weights.problem());
    if (set_.databases.empty()) return fail(Termination::kRefused, "there is no training data");
    // What a method opens has to be stated, whether or not a formula mentions it.
    std::vector<bool> needed = options_.method == "ll" ? set_.varying() : set_.mentioned;
    for (const PredicateId p : options_.discriminative) needed[p.index()] = true;
    for (std::size_t p = 0; p < needed.size(); ++p) needed[p] = needed[p] || set_.mentioned[p];
    if (std::string problem = training_problem(set_.model, set_.databases, needed); !problem.empty()) {
      return fail(Termination::kRefused, std::move(problem));
    }
    if (set_.weights.size() == 0) {
      result_.warnings.push_back("there is no weight to learn: no soft formula, or no constants for its templates");
    }
    for (const PredicateId p : options_.discriminative) warn_about_target(p);
    return true;
  }

  void warn_about_target(PredicateId p) {
    if (!set_.mentioned[p.index()]) {
      result_.warnings.push_back(fmt::format("no formula mentions '{}'", set_.model.predicate(p).name));
    }
    if (std::string warning = target_warning(set_, p); !warning.empty()) result_.warnings.push_back(warning);
  }

  void work() {
    PreparedOrProblem made = find_learning_method(options_.method)->prepare(set_, options_, false, stop_);
    result_.seconds.count = stop_.seconds();
    if (!made.data) {
      fail(made.problem.termination, std::move(made.problem.message));
      return;
    }
    std::vector<std::uint32_t> all(set_.databases.size());
    std::iota(all.begin(), all.end(), 0u);
    const std::unique_ptr<Objective> objective = made.data->objective(all);
    start_ = starting_point(set_, options_, *objective);
    for (std::size_t w = 0; w < set_.weights.size(); ++w) {
      LearnedWeight weight;
      weight.fixed = set_.model.formula(set_.weights.formula(w)).fixed;
      weight.identified = weight.fixed || objective->support()[w] > 0.0;
      result_.weights.push_back(weight);
    }
    OptimiserResult best = maximise(*made.data, all, *objective, start_, options_.optimiser, stop_);
    result_.seconds.optimise = stop_.seconds() - result_.seconds.count;
    report(best, *objective);
    if (options_.standard_errors && result_.termination == Termination::kCompleted) add_errors(best, *objective);
  }

  void report(const OptimiserResult& best, const Objective& objective) {
    // A method that samples knows no value; all others have one, or never got to their first.
    const bool sampled = std::isnan(best.objective_with_prior);
    if (!sampled && !std::isfinite(best.objective_with_prior)) {
      result_.weights.clear();
      fail(objective.termination() == Termination::kCompleted ? Termination::kRefused : objective.termination(),
           objective.message().empty() ? "the objective could not be computed at the weights of the model"
                                       : objective.message());
      return;
    }
    double prior_of_rest = 0.0;  // what is not free has a prior as well, where it is not fixed
    for (std::size_t w = 0; w < best.weights.size(); ++w) {
      result_.weights[w].weight = best.weights[w];
      if (!start_.free[w] && !result_.weights[w].fixed) {
        prior_of_rest +=
            start_.priors[w].log_density(best.weights[w]) - start_.priors[w].l1 * std::abs(best.weights[w]);
      }
    }
    if (!sampled) {
      result_.objective = best.objective;
      result_.objective_with_prior = best.objective_with_prior + prior_of_rest;
    }
    result_.converged = best.converged;
    result_.reason = best.reason;
    result_.iterations = best.iterations;
    result_.gradient_norm = best.gradient_norm;
    result_.trace = best.trace;
    result_.termination = best.termination;
    if (best.termination != Termination::kCompleted) {
      result_.message = objective.message().empty() ? best.reason : objective.message();
    }
    warn(objective);
  }

  void warn(const Objective& objective) {
    std::vector<std::uint32_t> unseen;
    for (std::uint32_t w = 0; w < result_.weights.size(); ++w) {
      if (!result_.weights[w].identified) unseen.push_back(w);
    }
    if (!unseen.empty()) {
      result_.warnings.push_back(
          fmt::format("the data says nothing about {} of {} weights, so they stay where prior or model put them: {}",
                      unseen.size(), result_.weights.size(), formulas_text(unseen)));
    }
    for (const auto& group : objective.indistinguishable()) {
      result_.warnings.push_back("the data cannot tell apart the weights of " + formulas_text(group));
      for (const std::uint32_t w : group) result_.weights[w].shared = true;
      if (result_.warnings.size() > 20) break;
    }
    if (!result_.converged && result_.termination == Termination::kCompleted) {
      result_.warnings.push_back("the weights have not converged: " + result_.reason);
    }
  }

  // The formulas of these weights, the first few by name.
  std::string formulas_text(std::span<const std::uint32_t> weights) const {
    constexpr std::size_t kNamed = 3;
    std::string names;
    for (std::size_t i = 0; i < std::min(weights.size(), kNamed); ++i) {
      names += fmt::format("{}'{}'", i == 0 ? "" : " and ", weight_text(set_.model, set_.weights, weights[i]));
    }
    if (weights.size() > kNamed) names += fmt::format(" and {} more", weights.size() - kNamed);
    return names;
  }

  // The inverse of the information at the optimum, the prior's included.
  void add_errors(const OptimiserResult& best, Objective& objective) {
    std::vector<std::uint32_t> subset;
    for (std::uint32_t w = 0; w < start_.free.size(); ++w) {
      if (start_.free[w] && !(start_.priors[w].l1 > 0.0 && best.weights[w] == 0.0)) subset.push_back(w);
    }
    if (subset.empty()) return;
    if (subset.size() > kMostErrors) {
      result_.warnings.push_back(fmt::format("no standard errors: they are computed for up to {} weights, these are {}",
                                             kMostErrors, subset.size()));
      return;
    }
    Eigen::MatrixXd information = objective.information(best.weights, subset);
    if (information.rows() != static_cast<Eigen::Index>(subset.size())) {
      result_.termination = stop_.reached() ? stop_.reason() : objective.termination();
      result_.message = "the weights are learned, but their standard errors could not be computed to the end";
      return;
    }
    for (std::size_t i = 0; i < subset.size(); ++i) {
      information(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(i)) += start_.priors[subset[i]].precision();
    }
    const Eigen::LDLT<Eigen::MatrixXd> factor(information);
    const double largest = information.diagonal().size() > 0 ? information.diagonal().maxCoeff() : 0.0;
    if (factor.info() != Eigen::Success || factor.vectorD().minCoeff() <= 1e-12 * largest) {
      result_.warnings.push_back("no standard errors: some weights are not determined by data and prior together");
      return;
    }
    const auto size = static_cast<Eigen::Index>(subset.size());
    const Eigen::MatrixXd covariance = factor.solve(Eigen::MatrixXd::Identity(size, size));
    for (std::size_t i = 0; i < subset.size(); ++i) {
      const double variance = covariance(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(i));
      if (variance >= 0.0) result_.weights[subset[i]].standard_error = std::sqrt(variance);
    }
  }

  LearningOptions options_;
  StopCondition stop_;
  TrainingSet set_;
  LearningResult result_;
  StartingPoint start_;
};

std::string prior_problem(const Prior& prior) {
  if (!(prior.stdev > 0.0)) {
    return fmt::format("the prior's standard deviation is {}; it must be above 0 ('inf': no prior)", prior.stdev);
  }
  if (!std::isfinite(prior.mean)) return fmt::format("the prior's mean is {}; it must be a finite number", prior.mean);
  if (!(prior.l1 >= 0.0) || std::isinf(prior.l1)) {
    return fmt::format("the L1 prior's rate is {}; it must be a finite number of at least 0", prior.l1);
  }
  return "";
}

}  // namespace

StartingPoint starting_point(const TrainingSet& set, const LearningOptions& options, const Objective& objective) {
  StartingPoint result;
  std::vector<Prior> by_formula(set.model.formulas().size(), options.prior);
  for (const auto& [formula, prior] : options.formula_priors) by_formula[formula.index()] = prior;
  for (std::size_t w = 0; w < set.weights.size(); ++w) {
    const Formula& formula = set.model.formula(set.weights.formula(w));
    const Prior& prior = by_formula[set.weights.formula(w).index()];
    const bool identified = objective.support()[w] > 0.0;
    double value = formula.has_weight ? formula.weight : 0.0;
    // Where the data is silent the prior alone decides, and where there is none the model.
    if (!identified && !formula.fixed && (prior.precision() > 0.0 || prior.l1 > 0.0)) value = prior.mode();
    result.priors.push_back(prior);
    result.weights.push_back(value);
    result.free.push_back(identified && !formula.fixed);
  }
  return result;
}

std::string validate(const LearningOptions& options) {
  const LearningMethod* method = find_learning_method(options.method);
  if (method == nullptr) {
    std::string names;
    for (const LearningMethodInfo& info : learning_methods())
      names += (names.empty() ? "" : ", ") + std::string(info.name);
    return fmt::format("there is no method of learning '{}'; there are {}", options.method, names);
  }
  if (method->info.discriminative && options.discriminative.empty()) {
    return fmt::format("method '{}' needs --discriminative: the predicates that are to be predicted", options.method);
  }
  if (!method->info.discriminative && !options.discriminative.empty()) {
    return fmt::format("method '{}' has no use for --discriminative; dpll and cll have", options.method);
  }
  if (!options.blocks.empty() && options.method != "bpll") {
    return fmt::format("method '{}' has no use for --block; bpll has", options.method);
  }
  if (std::string problem = prior_problem(options.prior); !problem.empty()) return problem;
  if (options.prior.l1 > 0.0 && options.method == "mcsat") return "method 'mcsat' cannot do an L1 prior; cll can";
  for (const auto& [formula, prior] : options.formula_priors) {
    if (std::string problem = prior_problem(prior); !problem.empty()) return problem;
  }
  if (options.optimiser.max_iterations == 0) return "--max-iterations: 0 is less than 1";
  if (options.optimiser.max_iterations > kMostIterations) {
    return fmt::format("--max-iterations: {} is more than {}", options.optimiser.max_iterations, kMostIterations);
  }
  if (!(options.optimiser.gradient_tolerance > 0.0)) {
    return fmt::format("--tolerance: {} is not above 0", options.optimiser.gradient_tolerance);
  }
  if (!(options.search_gap > 0.0 && options.search_gap < 1.0)) {
    return fmt::format("--search-gap: {} is not between 0 and 1", options.search_gap);
  }
  if (options.samples == 0) return "--samples: 0 is less than 1";
  if (options.standard_errors && options.method == "mcsat") {
    return "method 'mcsat' does not see the curvature that standard errors come from; cll does";
  }
  return "";
}

LearningResult learn(const Model& model, std::span<const Evidence> databases, const LearningOptions& options,
                     Monitor& monitor) {
  return Learning(model, databases, options, monitor).run();
}

}  // namespace sherlog
