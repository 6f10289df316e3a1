#include "inference/soft_targets.h"

#include <algorithm>
#include <limits>
#include <map>
#include <string_view>
#include <utility>

#include "inference/exact.h"
#include "inference/jeffrey.h"
#include "inference/map.h"
#include "inference/mcsat.h"

namespace sherlog {
namespace {

constexpr std::uint32_t kFewestSamples = 1000;  // of one evaluation

class SoftTargets {
 public:
  SoftTargets(const GroundNetwork& network, const Method* method, const InferenceOptions& options,
              const StopCondition& stop)
      : options_(options), stop_(stop), method_(method) {
    NetworkBuilder with_queries(network);
    for (std::size_t t = 0; t < network.soft_targets().size(); ++t) {
      query_of_.push_back(static_cast<std::uint32_t>(with_queries.so_far().queries().size()));
      with_queries.add_query({Literal::atom(network.soft_targets()[t].atom), false, ""});
    }
    network_ = with_queries.build();
    NetworkBuilder bare(network);
    (void)bare.take_features();
    bare_ = bare.build();
    fit_.biases.assign(network.atom_count(), 0.0);
  }

  SoftTargetFit run() {
    std::map<std::uint32_t, std::vector<std::size_t>> by_component;
    for (std::size_t t = 0; t < network_.soft_targets().size(); ++t) {
      by_component[component_of(network_, network_.soft_targets()[t].atom).value].push_back(t);
    }
    for (const auto& [component, targets] : by_component) {
      if (!fit_component(ComponentId(component), targets)) break;
    }
    return std::move(fit_);
  }

 private:
  static ComponentId component_of(const GroundNetwork& network, AtomId atom) {
    return network.component_of(network.variable_of(atom));
  }

  // A most probable world has no marginals to fit: the biases are those of the distribution.
  bool chooses() const { return method_ == nullptr || method_->finds_map; }

  auto runner_of(ComponentId component) const {
    if (!chooses() && std::string_view(method_->name) == "exact") return run_exact;
    const ExactCost cost = exact_cost(network_, component, options_, stop_);
    if (!cost.possible || (cost.feasible && cost.total_log2 <= kQuickLog2)) return run_exact;
    return chooses() ? run_mcsat : method_->run;
  }

  bool fit_component(ComponentId component, const std::vector<std::size_t>& chosen) {
    std::vector<SoftTarget> targets;
    targets.reserve(chosen.size());
    for (std::size_t t : chosen) targets.push_back(network_.soft_targets()[t]);
    const auto method = runner_of(component);
    InferenceOptions fitting = options_;
    std::vector<double> biases(network_.atom_count(), 0.0);
    JeffreyModel model;
    model.evaluate = [&](std::span<const double> values, std::uint32_t round, double share) {
      for (std::size_t i = 0; i < values.size(); ++i) biases[targets[i].atom.index()] = values[i];
      fitting.seed = options_.seed + round;
      fitting.samples = std::max(kFewestSamples, static_cast<std::uint32_t>(options_.samples * share));
      MethodResult run = method({network_, {&component, 1}, fitting, stop_, biases});
      JeffreyEvaluation evaluation{run.termination, {}, run.log_partition, {}};
      if (run.termination != Termination::kCompleted) {
        fit_.message = std::move(run.message);
        fit_.conflict = std::move(run.conflict);
        return evaluation;
      }
      for (std::size_t t : chosen) {
        const Marginal& marginal = run.marginals[query_of_[t]];
        evaluation.marginals.push_back(marginal.probability);
        evaluation.standard_errors.push_back(marginal.mcse.value_or(0.0));
      }
      return evaluation;
    };
    model.largest = [&](std::span<const double> direction) { return largest(targets, direction); };
    JeffreyFit found = fit_jeffrey(network_, targets, model);
    fit_.termination = found.termination;
    if (!found.message.empty()) fit_.message = std::move(found.message);
    if (!found.warning.empty()) fit_.warnings.push_back(std::move(found.warning));
    for (std::size_t i = 0; i < found.biases.size(); ++i) fit_.biases[targets[i].atom.index()] = found.biases[i];
    return fit_.termination == Termination::kCompleted;
  }

  // The best score of a possible world where nothing but the direction has weight.
  double largest(std::span<const SoftTarget> targets, std::span<const double> direction) const {
    std::vector<double> weights(bare_.atom_count(), 0.0);
    std::vector<ComponentId> components;
    for (std::size_t i = 0; i < targets.size(); ++i) {
      weights[targets[i].atom.index()] = direction[i];
      components.push_back(component_of(bare_, targets[i].atom));
    }
    std::ranges::sort(components);
    components.erase(std::unique(components.begin(), components.end()), components.end());
    const MethodResult best = run_map({bare_, components, options_, stop_, weights});
    if (best.termination == Termination::kNoPossibleWorld) return std::numeric_limits<double>::infinity();
    return best.map_bound;
  }

  const InferenceOptions& options_;
  const StopCondition& stop_;
  const Method* method_;
  GroundNetwork network_;                // with a query for each target
  GroundNetwork bare_;                   // hard formulas and blocks alone
  std::vector<std::uint32_t> query_of_;  // by target
  SoftTargetFit fit_;
};

}  // namespace

SoftTargetFit fit_soft_targets(const GroundNetwork& network, const Method* method, const InferenceOptions& options,
                               const StopCondition& stop) {
  return SoftTargets(network, method, options, stop).run();
}

}  // namespace sherlog
