#include "learning/sampled_gradient.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <unordered_map>

#include "inference/inference.h"
#include "inference/world.h"
#include "learning/noisy_ascent.h"

namespace sherlog {
namespace {

constexpr std::uint32_t kMostIterations = 200;

// A database whose queries are its distinct feature literals.
struct SampledDatabase {
  GroundNetwork network;
  std::vector<std::uint32_t> weight_of;
  std::vector<std::uint32_t> query_of;  // by feature
  std::vector<double> observed;         // truth of each feature's literal, 0 or 1
};

SampledDatabase make_database(ObservedNetwork source) {
  SampledDatabase result;
  const WorldIndex index(source.network);
  World world(index);
  world.assign(source.values);
  NetworkBuilder builder(source.network);
  std::unordered_map<std::uint32_t, std::uint32_t> query_of;  // by literal
  for (const Feature& feature : source.network.features()) {
    const auto [it, fresh] = query_of.emplace(feature.literal.code(), static_cast<std::uint32_t>(query_of.size()));
    if (fresh) builder.add_query({feature.literal, true, ""});
    result.query_of.push_back(it->second);
    result.observed.push_back(world.is_true(feature.literal) ? 1.0 : 0.0);
  }
  result.weight_of = std::move(source.weight_of);
  result.network = builder.build();
  return result;
}

// Knows which weights matter; its value is unknown.
class SampledObjective : public Objective {
 public:
  explicit SampledObjective(std::vector<double> support) : support_(std::move(support)) {}
  std::size_t dimension() const override { return support_.size(); }
  double evaluate(std::span<const double>, std::span<double> gradient) override {
    std::ranges::fill(gradient, 0.0);
    return std::numeric_limits<double>::quiet_NaN();
  }
  Eigen::MatrixXd information(std::span<const double>, std::span<const std::uint32_t> subset) override {
    const auto size = static_cast<Eigen::Index>(subset.size());
    return Eigen::MatrixXd::Zero(size, size);
  }
  std::span<const double> support() const override { return support_; }

 private:
  std::vector<double> support_;
};

class PreparedSampled : public PreparedData {
 public:
  PreparedSampled(std::vector<SampledDatabase> databases, std::size_t weight_count, const InferenceOptions& inference)
      : databases_(std::move(databases)), weight_count_(weight_count), inference_(inference) {}

  std::unique_ptr<Objective> objective(std::span<const std::uint32_t> databases) override {
    std::vector<double> support(weight_count_, 0.0);
    for (const std::uint32_t d : databases) {
      for (const Feature& feature : databases_[d].network.features()) {
        if (feature.weight_id != kVirtualEvidence) support[databases_[d].weight_of[feature.weight_id.index()]] += 1.0;
      }
    }
    return std::make_unique<SampledObjective>(std::move(support));
  }

  std::optional<OptimiserResult> search(std::span<const std::uint32_t> databases, const StartingPoint& start,
                                        const OptimiserOptions& options, const StopCondition& stop) override {
    OptimiserResult result;
    result.objective = result.objective_with_prior = std::numeric_limits<double>::quiet_NaN();
    result.weights = start.weights;
    std::vector<std::uint32_t> free;
    for (std::uint32_t w = 0; w < weight_count_; ++w) {
      if (start.free[w]) free.push_back(w);
    }
    if (free.empty()) {
      result.converged = true;
      result.reason = "no weight is free";
      return result;
    }
    const auto spread = [&](const std::vector<double>& x) {
      for (std::size_t i = 0; i < free.size(); ++i) result.weights[free[i]] = x[i];
    };
    const auto evaluate = [&](const std::vector<double>& x, std::uint32_t number, SampledSlope& slope) {
      spread(x);
      if (!gradient(databases, result.weights, number, stop, result)) return false;
      slope.slope.resize(free.size());
      slope.curvature.resize(free.size());
      slope.draws = draws_;
      for (std::size_t i = 0; i < free.size(); ++i) {
        const Prior& prior = start.priors[free[i]];
        slope.slope[i] = gradient_[free[i]] + prior.slope(x[i]);
        slope.curvature[i] = std::max(curvature_[free[i]] + prior.precision(), 1e-3);
        result.gradient_norm =
            i == 0 ? std::abs(slope.slope[0]) : std::max(result.gradient_norm, std::abs(slope.slope[i]));
      }
      stop.monitor().progress(fmt::format("learning: gradient {:.2g}", result.gradient_norm), number + 1.0, 0.0);
      return true;
    };
    std::vector<double> x;
    x.reserve(free.size());
    for (const std::uint32_t w : free) x.push_back(start.weights[w]);
    NoisyAscentOutcome outcome = noisy_ascent(
        std::move(x), evaluate, {std::min(options.max_iterations, kMostIterations), options.gradient_tolerance});
    spread(outcome.x);
    result.gradient_norm = outcome.slope_norm;
    result.iterations = outcome.evaluations;
    result.converged = outcome.converged;
    if (!outcome.cut_short) result.reason = outcome.reason;
    return result;
  }

 private:
  // Fills gradient_, curvature_ and draws_; false where inference did not come to an end.
  bool gradient(std::span<const std::uint32_t> databases, const std::vector<double>& weights, std::uint32_t iteration,
                const StopCondition& stop, OptimiserResult& result) {
    gradient_.assign(weight_count_, 0.0);
    curvature_.assign(weight_count_, 0.0);
    draws_ = std::numeric_limits<double>::infinity();
    InferenceOptions inference = inference_;
    inference.seed += iteration * 1000003ULL;
    std::vector<double> by_id;
    for (const std::uint32_t d : databases) {
      const SampledDatabase& database = databases_[d];
      by_id.clear();
      for (const std::uint32_t weight : database.weight_of) by_id.push_back(weights[weight]);
      inference.max_seconds = std::max(0.0, stop.max_seconds() - stop.seconds());
      const InferenceResult found = infer(reweighted(database.network, by_id), inference, stop.monitor());
      if (found.termination != Termination::kCompleted) {
        result.termination = found.termination;
        const bool stopped = stop.reached() || found.message.empty();
        result.reason = stopped ? "it was stopped" : found.message;
        return false;
      }
      if (found.marginals.size() != database.network.queries().size()) {
        result.termination = Termination::kRefused;
        result.reason = fmt::format("method '{}' gives no marginals to count with", inference.method);
        return false;
      }
      if (found.samples > 0) draws_ = std::min(draws_, effective_draws(found));
      for (std::size_t f = 0; f < database.network.features().size(); ++f) {
        const Feature& feature = database.network.features()[f];
        if (feature.weight_id == kVirtualEvidence) continue;
        const std::uint32_t weight = database.weight_of[feature.weight_id.index()];
        const double p = found.marginals[database.query_of[f]].probability;
        const double count = feature.count;
        gradient_[weight] += (feature.turned ? -count : count) * (database.observed[f] - p);
        curvature_[weight] += count * count * p * (1.0 - p);
      }
    }
    return true;
  }

  // A single literal that hardly ever changes tells little about the sums of many.
  static double effective_draws(const InferenceResult& found) {
    const auto draws = static_cast<double>(found.samples);
    const bool known = found.diagnostics && found.diagnostics->ess_min;
    return std::clamp(known ? *found.diagnostics->ess_min : draws, 0.1 * draws, draws);
  }

  std::vector<SampledDatabase> databases_;
  std::size_t weight_count_;
  InferenceOptions inference_;
  std::vector<double> gradient_, curvature_;
  double draws_ = 0.0;  // fewest effective draws behind the gradient of a database; infinity: none were needed
};

}  // namespace

PreparedOrProblem prepare_mcsat(const TrainingSet& set, const LearningOptions& options, bool,
                                const StopCondition& stop) {
  InferenceOptions inference;
  inference.method = options.expectation;
  inference.samples = options.samples;
  inference.threads = options.threads;
  inference.max_memory = options.max_memory;
  inference.search_gap = options.search_gap;
  inference.seed = options.seed;
  if (std::string bad = validate(inference); !bad.empty()) return {nullptr, {Termination::kRefused, std::move(bad)}};
  const std::vector<bool> open = opened(set.model, options.discriminative);
  std::vector<std::optional<SampledDatabase>> made(set.databases.size());
  std::vector<SampledDatabase> all;
  TrainingProblem problem = for_each_database(
      set.databases.size(), options.threads, stop, "counting",
      [&](std::size_t d) -> TrainingProblem {
        const TrueAtoms truth(set.model, set.databases[d]);
        Observation observation = observe_within_limits(set, set.databases[d], truth, open, options, stop);
        if (!observation.result) return {observation.termination, observation.message};
        made[d] = make_database(std::move(*observation.result));
        return {};
      },
      [&](std::size_t d) { all.push_back(std::move(*made[d])); });
  if (problem.termination != Termination::kCompleted) return {nullptr, std::move(problem)};
  return {std::make_unique<PreparedSampled>(std::move(all), set.weights.size(), inference), {}};
}

}  // namespace sherlog
