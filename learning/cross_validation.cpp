#include "learning/cross_validation.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <numeric>

#include "inference/rng.h"
#include "learning/methods.h"
#include "learning/optimiser.h"
#include "learning/predict.h"

namespace sherlog {
namespace {

using Databases = std::vector<std::uint32_t>;

class CrossValidation {
 public:
  CrossValidation(const Model& model, std::span<const Evidence> databases, const CrossValidationOptions& options,
                  Monitor& monitor)
      : options_(options),
        learning_(options.learning),
        stop_(monitor, options.learning.max_seconds),
        set_(model, databases) {
    result_.method = learning_.method;
  }

  CrossValidationResult run() {
    if (check() && prepare()) run_folds();
    result_.seconds = stop_.seconds();
    result_.evaluation = evaluate(result_.labels, result_.predictions);
    return std::move(result_);
  }

 private:
  bool fail(Termination termination, std::string message) {
    result_.termination = termination;
    result_.message = std::move(message);
    return false;
  }
  bool fail(TrainingProblem problem) { return fail(problem.termination, std::move(problem.message)); }

  bool check() {
    const LearningMethod* method = find_learning_method(learning_.method);
    if (method != nullptr && method->info.discriminative) learning_.discriminative = {options_.target};
    if (std::string problem = validate(learning_); !problem.empty()) return fail(Termination::kRefused, problem);
    if (std::string problem = validate(options_.inference); !problem.empty()) {
      return fail(Termination::kRefused, problem);
    }
    if (!set_.weights.problem().empty()) return fail(Termination::kMemoryLimit, set_.weights.problem());
    if (!set_.mentioned[options_.target.index()]) {
      return fail(Termination::kRefused, fmt::format("no formula mentions '{}': there is nothing to learn about it",
                                                     set_.model.predicate(options_.target).name));
    }
    if (std::string problem = training_problem(set_.model, set_.databases, set_.mentioned); !problem.empty()) {
      return fail(Termination::kRefused, std::move(problem));
    }
    for (const TuningGroup& group : options_.tuning) {
      const bool good = !group.stdevs.empty() && std::ranges::all_of(group.stdevs, [](double s) { return s > 0.0; });
      if (!good) return fail(Termination::kRefused, "the standard deviations to choose from must be above 0");
    }
    const bool chosen = options_.chosen_stdevs.empty() ||
                        (options_.chosen_stdevs.size() == options_.folds &&
                         std::ranges::all_of(options_.chosen_stdevs,
                                             [&](const auto& s) { return s.size() <= options_.tuning.size(); }));
    if (!chosen) return fail(Termination::kRefused, "chosen_stdevs has not one row for each fold, of a number a group");
    return check_folds();
  }

  bool check_folds() {
    const std::size_t count = set_.databases.size();
    if (options_.folds < 2) {
      return fail(Termination::kRefused, fmt::format("--folds: {} is less than 2", options_.folds));
    }
    if (options_.fold_of.empty() && options_.folds > count) {
      return fail(Termination::kRefused,
                  fmt::format("--folds: {} folds cannot be made of {} databases", options_.folds, count));
    }
    fold_of_ = options_.fold_of.empty() ? deal_folds(count, options_.folds, options_.seed) : options_.fold_of;
    if (fold_of_.size() != count) {
      return fail(Termination::kRefused,
                  fmt::format("the fold file has {} entries, there are {} databases", fold_of_.size(), count));
    }
    for (std::uint32_t fold = 0; fold < options_.folds; ++fold) {
      if (std::ranges::find(fold_of_, fold) == fold_of_.end()) {
        return fail(Termination::kRefused, fmt::format("fold {} has no database", fold + 1));
      }
    }
    return true;
  }

  // Counts and grounds every database once.
  bool prepare() {
    result_.labels = target_labels(set_.model, options_.target);
    PreparedOrProblem made = find_learning_method(learning_.method)->prepare(set_, learning_, true, stop_);
    if (!made.data) return fail(std::move(made.problem));
    data_ = std::move(made.data);
    tuning_data_ = data_.get();
    if (!options_.tuning.empty() && !options_.tuning_method.empty() && options_.tuning_method != learning_.method) {
      LearningOptions tuning = learning_;
      tuning.method = options_.tuning_method;
      tuning.discriminative.clear();
      const LearningMethod* method = find_learning_method(tuning.method);
      if (method != nullptr && method->info.discriminative) tuning.discriminative = {options_.target};
      if (std::string problem = validate(tuning); !problem.empty()) return fail(Termination::kRefused, problem);
      PreparedOrProblem second = method->prepare(set_, tuning, true, stop_);
      if (!second.data) return fail(std::move(second.problem));
      own_tuning_data_ = std::move(second.data);
      tuning_data_ = own_tuning_data_.get();
    }
    tasks_.resize(set_.databases.size());
    GroundingOptions limits;
    limits.max_memory = learning_.max_memory;
    TrainingProblem problem = for_each_database(
        set_.databases.size(), learning_.threads, stop_, "grounding",
        [&](std::size_t d) -> TrainingProblem {
          GroundingOptions own = limits;
          own.max_seconds = std::max(0.0, stop_.max_seconds() - stop_.seconds());
          TaskOrProblem task =
              make_prediction_task(set_, static_cast<std::uint32_t>(d), options_.target, own, stop_.monitor());
          if (task.task) tasks_[d] = std::move(*task.task);
          return task.problem;
        },
        [](std::size_t) {});
    result_.count_seconds = stop_.seconds();
    if (problem.termination != Termination::kCompleted) return fail(std::move(problem));
    if (std::string warning = target_warning(set_, options_.target); !warning.empty()) {
      result_.warnings.push_back(std::move(warning));
    }
    warn_about_classes();
    return true;
  }

  // Labels that are true in one fold only: the model of that fold has never seen them.
  void warn_about_classes() {
    std::vector<std::int64_t> only_fold(result_.labels.size(), -1);
    std::vector<bool> several(result_.labels.size(), false);
    for (const PredictionTask& task : tasks_) {
      for (const PredictionTask::Example& example : task.examples) {
        const std::uint32_t fold = fold_of_[task.database];
        if (example.truth >= only_fold.size()) continue;
        if (only_fold[example.truth] >= 0 && only_fold[example.truth] != fold) several[example.truth] = true;
        only_fold[example.truth] = fold;
      }
    }
    std::string names;
    std::size_t count = 0;
    for (std::size_t label = 0; label < result_.labels.size(); ++label) {
      if (only_fold[label] < 0 || several[label]) continue;
      if (++count <= 5) names += (names.empty() ? "" : ", ") + result_.labels[label];
    }
    if (count == 0) return;
    result_.warnings.push_back(
        fmt::format("{} labels are in one fold only, so the model that is tested on them has never "
                    "seen them: {}{}",
                    count, names, count > 5 ? ", ..." : ""));
  }

  void run_folds() {
    for (std::uint32_t fold = 0; fold < options_.folds; ++fold) {
      Databases train, test;
      for (std::uint32_t d = 0; d < fold_of_.size(); ++d) (fold_of_[d] == fold ? test : train).push_back(d);
      stop_.monitor().progress("cross-validation", fold, options_.folds);
      if (!run_fold(train, test)) return;
    }
    std::ranges::stable_sort(result_.predictions, {}, &Prediction::database);
  }

  bool run_fold(const Databases& train, const Databases& test) {
    FoldResult fold;
    const double start = stop_.seconds();
    LearningOptions chosen = learning_;
    if (!tune(train, chosen, fold)) return false;
    std::vector<double> weights;
    if (!fit(*data_, train, chosen, weights, fold.converged)) return false;
    fold.train_seconds = stop_.seconds() - start;
    std::vector<Prediction> predictions;
    if (!predict_all(test, weights, options_.inference, predictions)) return false;
    fold.test_seconds = stop_.seconds() - start - fold.train_seconds;
    fold.databases = static_cast<std::uint32_t>(test.size());
    fold.examples = static_cast<std::uint32_t>(predictions.size());
    const Evaluation evaluation = evaluate(result_.labels, predictions);
    fold.accuracy = evaluation.accuracy;
    fold.log_loss = evaluation.log_loss;
    if (!fold.converged) {
      result_.warnings.push_back(fmt::format("the weights of fold {} have not converged", result_.folds.size() + 1));
    }
    result_.folds.push_back(std::move(fold));
    result_.predictions.insert(result_.predictions.end(), predictions.begin(), predictions.end());
    return true;
  }

  bool fit(PreparedData& data, const Databases& train, const LearningOptions& learning, std::vector<double>& weights,
           bool& converged) {
    const std::unique_ptr<Objective> objective = data.objective(train);
    const StartingPoint start = starting_point(set_, learning, *objective);
    const OptimiserResult best = maximise(data, train, *objective, start, learning.optimiser, stop_);
    if (best.termination != Termination::kCompleted) {
      return fail(best.termination, objective->message().empty() ? best.reason : objective->message());
    }
    weights = best.weights;
    converged = best.converged;
    return true;
  }

  bool predict_all(const Databases& test, const std::vector<double>& weights, InferenceOptions inference,
                   std::vector<Prediction>& predictions) {
    for (const std::uint32_t d : test) {
      inference.max_seconds = std::max(0.0, stop_.max_seconds() - stop_.seconds());
      TrainingProblem problem = predict(tasks_[d], weights, inference, stop_.monitor(), predictions);
      if (problem.termination != Termination::kCompleted) return fail(std::move(problem));
    }
    return true;
  }

  // --- priors by a cross-validation inside the training databases

  bool tune(const Databases& train, LearningOptions& learning, FoldResult& fold) {
    if (options_.tuning.empty()) return true;
    const std::uint32_t inner_folds =
        std::min<std::uint32_t>(options_.tuning_folds, static_cast<std::uint32_t>(train.size()));
    const std::vector<std::uint32_t> inner = deal_folds(train.size(), inner_folds, options_.seed);
    fold.stdevs.clear();
    for (const TuningGroup& group : options_.tuning) fold.stdevs.push_back(group.stdevs.front());
    std::size_t given = 0;
    if (!options_.chosen_stdevs.empty()) {
      const std::vector<double>& chosen = options_.chosen_stdevs[result_.folds.size()];
      std::ranges::copy(chosen, fold.stdevs.begin());
      given = chosen.size();
    }
    for (std::uint32_t round = 0; round < options_.tuning_rounds; ++round) {
      for (std::size_t g = given; g < options_.tuning.size(); ++g) {
        double best_loss = std::numeric_limits<double>::infinity(), best = fold.stdevs[g];
        if (options_.tuning[g].stdevs.size() < 2) continue;
        for (const double stdev : options_.tuning[g].stdevs) {
          std::vector<double> stdevs = fold.stdevs;
          stdevs[g] = stdev;
          double loss = best_loss;
          if (!inner_loss(train, inner, inner_folds, with_stdevs(learning, stdevs), loss)) return false;
          if (loss < best_loss) best_loss = loss, best = stdev;
        }
        fold.stdevs[g] = best;
      }
    }
    learning = with_stdevs(learning, fold.stdevs);
    return true;
  }

  LearningOptions with_stdevs(LearningOptions learning, const std::vector<double>& stdevs) const {
    for (std::size_t g = 0; g < stdevs.size(); ++g) {
      for (const FormulaId formula : options_.tuning[g].formulas) {
        Prior prior = learning.prior;
        prior.stdev = stdevs[g];
        learning.formula_priors.emplace_back(formula, prior);
      }
    }
    return learning;
  }

  // The choice between priors needs fewer digits than the answer. `loss`: in, the best so far, at which there is no need
  // to go on; out, the log-loss, or a bound from below that is no better than the best.
  bool inner_loss(const Databases& train, const std::vector<std::uint32_t>& inner, std::uint32_t folds,
                  LearningOptions learning, double& loss) {
    learning.optimiser.gradient_tolerance = std::max(learning.optimiser.gradient_tolerance, 1e-2);
    learning.optimiser.function_tolerance = std::max(learning.optimiser.function_tolerance, 1e-6);
    InferenceOptions inference = options_.inference;
    inference.search_gap = std::max(inference.search_gap, 1e-2);
    inference.samples = std::min<decltype(inference.samples)>(inference.samples, 2000);
    const double best = loss;
    std::size_t examples = 0;
    for (const std::uint32_t d : train) examples += tasks_[d].examples.size();
    double sum = 0.0;
    for (std::uint32_t f = 0; f < folds; ++f) {
      Databases part, rest;
      for (std::size_t i = 0; i < train.size(); ++i) (inner[i] == f ? part : rest).push_back(train[i]);
      std::vector<double> weights;
      std::vector<Prediction> predictions;
      bool converged = false;
      if (!fit(*tuning_data_, rest, learning, weights, converged)) return false;
      if (!predict_all(part, weights, inference, predictions)) return false;
      for (const Prediction& prediction : predictions) sum += log_loss(prediction);
      loss = sum / static_cast<double>(std::max<std::size_t>(examples, 1));
      if (loss >= best) return true;
    }
    return true;
  }

  const CrossValidationOptions& options_;
  LearningOptions learning_;
  StopCondition stop_;
  TrainingSet set_;
  std::unique_ptr<PreparedData> data_, own_tuning_data_;
  PreparedData* tuning_data_ = nullptr;
  std::vector<PredictionTask> tasks_;  // by database
  std::vector<std::uint32_t> fold_of_;
  CrossValidationResult result_;
};

}  // namespace

std::vector<std::uint32_t> deal_folds(std::size_t databases, std::uint32_t folds, std::uint64_t seed) {
  std::vector<std::uint32_t> order(databases), result(databases);
  std::iota(order.begin(), order.end(), 0u);
  Rng rng(seed, 0);
  for (std::size_t i = databases; i > 1; --i) std::swap(order[i - 1], order[rng.below(static_cast<std::uint32_t>(i))]);
  for (std::size_t i = 0; i < databases; ++i) result[order[i]] = static_cast<std::uint32_t>(i % folds);
  return result;
}

CrossValidationResult cross_validate(const Model& model, std::span<const Evidence> databases,
                                     const CrossValidationOptions& options, Monitor& monitor) {
  return CrossValidation(model, databases, options, monitor).run();
}

}  // namespace sherlog
