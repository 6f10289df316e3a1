#include "learning/sampled_gradient.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <unordered_map>

#include "inference/inference.h"
#include "inference/world.h"

namespace sherlog {
namespace {

constexpr std::uint32_t kMostIterations = 200;
constexpr std::uint32_t kLeastIterations = 40;
constexpr double kSmallMove = 2e-3;  // of the averaged weights in ten iterations: then it is enough

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
  PreparedSampled(std::vector<SampledDatabase> databases, std::size_t weight_count, const LearningOptions& options)
      : databases_(std::move(databases)), weight_count_(weight_count) {
    inference_.samples = options.samples;
    inference_.threads = options.threads;
    inference_.max_memory = options.max_memory;
    inference_.search_gap = options.search_gap;
    inference_.seed = options.seed;
  }

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
    std::vector<double> weights = start.weights, sum(weights.size(), 0.0), averaged = weights, before = weights;
    const std::uint32_t iterations = std::min(options.max_iterations, kMostIterations);
    double averaged_count = 0.0;
    result.reason = fmt::format("the limit of {} iterations was reached", iterations);
    for (std::uint32_t t = 0; t < iterations; ++t) {
      if (!gradient(databases, weights, t, stop, result)) break;
      const double norm = step(start, 1.0 / (1.0 + t / 10.0), weights);
      result.iterations = t + 1;
      result.gradient_norm = norm;
      stop.monitor().progress(fmt::format("learning: gradient {:.2g}", norm), t + 1.0, iterations);
      if (2 * t < iterations && t < kLeastIterations) {
        averaged = weights;
        continue;
      }
      averaged_count += 1.0;
      for (std::size_t w = 0; w < weights.size(); ++w) {
        sum[w] += weights[w];
        averaged[w] = sum[w] / averaged_count;
      }
      if (static_cast<std::uint32_t>(averaged_count) % 10 != 0) continue;
      double moved = 0.0;
      for (std::size_t w = 0; w < weights.size(); ++w) moved = std::max(moved, std::abs(averaged[w] - before[w]));
      before = averaged;
      if (averaged_count > 10.0 && moved < kSmallMove) {
        result.converged = true;
        result.reason = fmt::format("the averaged weights move by less than {:g} in ten iterations", kSmallMove);
        break;
      }
    }
    result.weights = averaged;
    return result;
  }

 private:
  // Fills gradient_ and curvature_; false where inference did not come to an end.
  bool gradient(std::span<const std::uint32_t> databases, const std::vector<double>& weights, std::uint32_t iteration,
                const StopCondition& stop, OptimiserResult& result) {
    gradient_.assign(weight_count_, 0.0);
    curvature_.assign(weight_count_, 0.0);
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
        result.reason = found.message.empty() ? "it was stopped" : found.message;
        return false;
      }
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

  // Returns the largest entry of the gradient with the prior.
  double step(const StartingPoint& start, double rate, std::vector<double>& weights) const {
    double norm = 0.0;
    for (std::size_t w = 0; w < weights.size(); ++w) {
      if (!start.free[w]) continue;
      const double slope = gradient_[w] + start.priors[w].slope(weights[w]);
      norm = std::max(norm, std::abs(slope));
      const double curvature = std::max(curvature_[w] + start.priors[w].precision(), 1e-3);
      weights[w] += std::clamp(rate * slope / curvature, -1.0, 1.0);
    }
    return norm;
  }

  std::vector<SampledDatabase> databases_;
  std::size_t weight_count_;
  InferenceOptions inference_;
  std::vector<double> gradient_, curvature_;
};

}  // namespace

PreparedOrProblem prepare_mcsat(const TrainingSet& set, const LearningOptions& options, bool,
                                const StopCondition& stop) {
  std::vector<bool> open(set.mentioned.size(), false);
  for (const PredicateId p : options.discriminative) open[p.index()] = true;
  std::vector<std::optional<SampledDatabase>> made(set.databases.size());
  std::vector<SampledDatabase> all;
  TrainingProblem problem = for_each_database(
      set.databases.size(), options.threads, stop, "counting",
      [&](std::size_t d) -> TrainingProblem {
        GroundingOptions limits;
        limits.max_memory = options.max_memory;
        limits.max_seconds = std::max(0.0, stop.max_seconds() - stop.seconds());
        const TrueAtoms truth(set.model, set.databases[d]);
        Observation observation =
            observe(set.model, set.databases[d], truth, open, {}, set.weights, limits, stop.monitor());
        if (!observation.result) return {observation.termination, observation.message};
        made[d] = make_database(std::move(*observation.result));
        return {};
      },
      [&](std::size_t d) { all.push_back(std::move(*made[d])); });
  if (problem.termination != Termination::kCompleted) return {nullptr, std::move(problem)};
  return {std::make_unique<PreparedSampled>(std::move(all), set.weights.size(), options), {}};
}

}  // namespace sherlog
