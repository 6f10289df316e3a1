#include "inference/component_sum.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>
#include <utility>

#include "inference/bounded_sum.h"
#include "inference/prepared_component.h"

namespace sherlog {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kFewJoint = 4096;          // up to so many joint values it is asked how many of them are possible,
constexpr std::size_t kListedSteps = 4096;  // and up to so many worlds times tables they are listed
// Elimination over so many joined entries is worth a try by search first, which gets so many steps for each: half of the
// time or so.
constexpr double kTrialLog2 = 17.0;
constexpr std::uint64_t kTrialSteps = 12;
constexpr std::uint32_t kLongestPause = 5;  // after failures: 31 sums

}  // namespace

Termination ComponentSum::sum(std::span<const double> log_potentials, double& log_partition, std::span<double> beliefs,
                              const StopCondition& stop) const {
  assert(log_potentials.size() == entry_count() && (beliefs.empty() || beliefs.size() == entry_count()));
  const Termination termination = way_ == Way::kWorlds ? sum_worlds(log_potentials, log_partition, beliefs)
                                  : way_ == Way::kElimination
                                      ? sum_by_either(log_potentials, log_partition, beliefs, stop)
                                      : sum_by_search(log_potentials, log_partition, beliefs, options_.max_steps, stop);
  log_partition += constant_;
  return termination;
}

Termination ComponentSum::sum_worlds(std::span<const double> log_potentials, double& log_partition,
                                     std::span<double> beliefs) const {
  double top = -kInfinity;
  const std::uint32_t* entry = world_entries_.data();
  for (std::size_t w = 0; w < world_static_.size(); ++w) {
    double score = world_static_[w];
    for (std::size_t t = 0; t < table_count_; ++t) score += log_potentials[*entry++];
    world_score_[w] = score;
    top = std::max(top, score);
  }
  log_partition = -kInfinity;
  if (top == -kInfinity) return Termination::kNoPossibleWorld;
  double total = 0.0;
  for (double& score : world_score_) {
    score = std::exp(score - top);
    total += score;
  }
  log_partition = top + std::log(total);
  if (beliefs.empty()) return Termination::kCompleted;
  std::ranges::fill(beliefs, 0.0);
  entry = world_entries_.data();
  for (const double share : world_score_) {
    const double p = share / total;
    for (std::size_t t = 0; t < table_count_; ++t) beliefs[*entry++] += p;
  }
  return Termination::kCompleted;
}

void ComponentSum::fill_tables(std::span<const double> log_potentials) const {
  std::size_t entry = 0;
  for (auto& table : tables_) {
    for (double& value : table) {
      value = static_[entry] + log_potentials[entry];
      ++entry;
    }
  }
}

Termination ComponentSum::sum_by_elimination(std::span<const double> log_potentials, double& log_partition,
                                             std::span<double> beliefs, const StopCondition& stop) const {
  fill_tables(log_potentials);
  const SumProductResult result = sum_product(tree_, tables_, stop, false, !beliefs.empty());
  log_partition = result.log_partition;
  if (result.termination != Termination::kCompleted) return result.termination;
  if (log_partition == -kInfinity) return Termination::kNoPossibleWorld;
  auto out = beliefs.begin();
  for (const auto& marginals : result.table_marginals) out = std::ranges::copy(marginals, out).out;
  return Termination::kCompleted;
}

Termination ComponentSum::sum_by_search(std::span<const double> log_potentials, double& log_partition,
                                        std::span<double> beliefs, std::uint64_t max_steps,
                                        const StopCondition& stop) const {
  fill_tables(log_potentials);
  const BoundedSumOptions options{options_.relative_gap, max_steps, !beliefs.empty(), threshold_};
  const BoundedSumResult result = bounded_sum(cardinalities_, scopes_, tables_, options, stop);
  log_partition = result.log_partition;
  threshold_ = 0.0;  // after a failure the next one starts afresh
  if (result.termination != Termination::kCompleted) return result.termination;
  if (log_partition == -kInfinity) return Termination::kNoPossibleWorld;
  // Weights change between sums; where much less was dropped than allowed, the next one may drop more.
  const double slack = 0.5 * options_.relative_gap / std::max(result.relative_gap, 1e-300);
  threshold_ = result.relative_gap > 0.0 ? result.threshold * std::clamp(slack, 1.0, 1e3) : 0.0;
  auto out = beliefs.begin();
  for (const auto& marginals : result.table_marginals) out = std::ranges::copy(marginals, out).out;
  return Termination::kCompleted;
}

Termination ComponentSum::sum_by_either(std::span<const double> log_potentials, double& log_partition,
                                        std::span<double> beliefs, const StopCondition& stop) const {
  if (trial_steps_ > 0 && sums_to_trial_ == 0) {
    const Termination found = sum_by_search(log_potentials, log_partition, beliefs, trial_steps_, stop);
    failed_trials_ = found == Termination::kTooWide ? std::min(failed_trials_ + 1, kLongestPause) : 0;
    sums_to_trial_ = (1u << failed_trials_) - 1;
    if (found != Termination::kTooWide) return found;
  } else if (sums_to_trial_ > 0) {
    --sums_to_trial_;
  }
  return sum_by_elimination(log_potentials, log_partition, beliefs, stop);
}

// ---------------------------------------------------------------------------------------------------------------------

class ComponentSumCompiler {
 public:
  ComponentSumCompiler(const GroundNetwork& network, ComponentId component, const InferenceOptions& options,
                       const StopCondition& stop, std::span<const double> atom_bias,
                       const ComponentSumOptions& sum_options)
      : network_(network), component_(component), options_(options), stop_(stop) {
    sum_.options_ = sum_options;
    FactorGraphOptions compilation{atom_bias, false, options.max_memory};
    compilation.keep_features = true;
    prepared_ = prepare_component(network, component, options, compilation);
  }

  CompiledComponent run() {
    if (!prepared_.graph.possible) return impossible(std::move(prepared_.graph.conflict));
    if (prepared_.graph.too_large || !list_worlds()) {
      const std::size_t variables = prepared_.graph.cardinalities.size();
      Obstacle found = obstacle(network_, component_, prepared_, options_);
      const bool too_wide = found.termination == Termination::kTooWide;
      if (found.termination != Termination::kCompleted &&
          (!too_wide || variables > sum_.options_.max_searched_variables))
        return {std::nullopt, found.termination, std::move(found.message), {}};
      sum_.way_ = too_wide ? ComponentSum::Way::kSearch : ComponentSum::Way::kElimination;
    }
    take_graph();
    // Whether there is a world at all shows before any weight is known. Bounded search says it with the first sum: to
    // ask at weights of zero, where nothing is likelier than anything else, would be the hardest question of all.
    double log_partition = 0.0;
    const Termination termination =
        sum_.way_ == ComponentSum::Way::kSearch
            ? Termination::kCompleted
            : sum_.sum(std::vector<double>(sum_.entry_count(), 0.0), log_partition, {}, stop_);
    sum_.failed_trials_ = sum_.sums_to_trial_ = 0;
    if (termination == Termination::kNoPossibleWorld) {
      const auto constraints = network_.component_constraints(component_);
      return impossible({constraints.begin(), constraints.end()});
    }
    if (termination != Termination::kCompleted) return {std::nullopt, termination, "stopped while compiling", {}};
    CompiledComponent out;
    out.sum = std::move(sum_);
    return out;
  }

 private:
  static CompiledComponent impossible(std::vector<std::uint32_t> conflict) {
    return {std::nullopt, Termination::kNoPossibleWorld, "no world meets all hard formulas", std::move(conflict)};
  }

  // Fills world_entries_ and world_static_ where the possible worlds are few; else false.
  bool list_worlds() {
    const FactorGraph& graph = prepared_.graph;
    double joint = 1.0;
    for (const std::uint32_t k : graph.cardinalities) joint *= k;
    if (joint > kFewJoint) return false;
    std::vector<std::uint32_t> values(graph.cardinalities.size(), 0), entries(graph.tables.size());
    do {
      const double score = look_up(values, entries);
      if (score > -kInfinity) {
        sum_.world_static_.push_back(score);
        sum_.world_entries_.insert(sum_.world_entries_.end(), entries.begin(), entries.end());
        if (sum_.world_static_.size() * (entries.size() + 4) > kListedSteps) {
          sum_.world_static_.clear();
          sum_.world_entries_.clear();
          return false;
        }
      }
    } while (advance(values));
    sum_.world_score_.resize(sum_.world_static_.size());
    return true;
  }

  // The entries that hold at these values; returns the sum of what the tables say there.
  double look_up(const std::vector<std::uint32_t>& values, std::vector<std::uint32_t>& entries) const {
    const FactorGraph& graph = prepared_.graph;
    double score = 0.0;
    std::uint32_t start = 0;
    for (std::size_t t = 0; t < graph.tables.size(); ++t) {
      std::uint32_t index = 0;
      for (const std::uint32_t v : graph.scopes[t]) index = index * graph.cardinalities[v] + values[v];
      score += graph.tables[t][index];
      entries[t] = start + index;
      start += static_cast<std::uint32_t>(graph.tables[t].size());
    }
    return score;
  }

  // The next joint value; false after the last.
  bool advance(std::vector<std::uint32_t>& values) const {
    for (std::size_t v = values.size(); v-- > 0;) {
      if (++values[v] < prepared_.graph.cardinalities[v]) return true;
      values[v] = 0;
    }
    return false;
  }

  void take_graph() {
    FactorGraph& graph = prepared_.graph;
    sum_.constant_ = graph.constant;
    sum_.table_count_ = graph.tables.size();
    std::vector<std::uint32_t> start;
    for (const auto& table : graph.tables) {
      start.push_back(static_cast<std::uint32_t>(sum_.static_.size()));
      sum_.static_.insert(sum_.static_.end(), table.begin(), table.end());
    }
    for (const FactorGraph::OpenFeature& open : graph.features) {
      ComponentSum::Feature feature{open.feature, static_cast<std::uint32_t>(sum_.feature_entries_.size()), 0,
                                    open.negated};
      for (const std::uint32_t entry : open.entries) sum_.feature_entries_.push_back(start[open.scope] + entry);
      feature.entry_end = static_cast<std::uint32_t>(sum_.feature_entries_.size());
      sum_.features_.push_back(feature);
    }
    sum_.true_features_ = std::move(graph.true_features);
    if (sum_.way_ == ComponentSum::Way::kWorlds) return;
    if (sum_.way_ == ComponentSum::Way::kElimination) {
      sum_.tree_ = BucketTree(graph.cardinalities, graph.scopes, prepared_.order.order);
      if (prepared_.order.total_log2 >= kTrialLog2 &&
          graph.cardinalities.size() <= sum_.options_.max_searched_variables)
        sum_.trial_steps_ = kTrialSteps * sum_.tree_.total_joined();
    }
    sum_.tables_ = std::move(graph.tables);
    sum_.cardinalities_ = std::move(graph.cardinalities);
    sum_.scopes_ = std::move(graph.scopes);
  }

  const GroundNetwork& network_;
  const ComponentId component_;
  const InferenceOptions& options_;
  const StopCondition& stop_;
  PreparedComponent prepared_;
  ComponentSum sum_;
};

CompiledComponent compile_component_sum(const GroundNetwork& network, ComponentId component,
                                        const InferenceOptions& options, const StopCondition& stop,
                                        std::span<const double> atom_bias, const ComponentSumOptions& sum_options) {
  return ComponentSumCompiler(network, component, options, stop, atom_bias, sum_options).run();
}

}  // namespace sherlog
