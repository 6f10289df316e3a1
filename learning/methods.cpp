#include "learning/methods.h"

#include "learning/sampled_gradient.h"

namespace sherlog {
namespace {

constexpr LearningMethod kMethods[] = {
    {{"pll", "pseudo-log-likelihood of every variable given all others", false}, prepare_pll},
    {{"bpll", "the same with the variables of a --block taken jointly", false}, prepare_bpll},
    {{"dpll", "pseudo-log-likelihood of the --discriminative predicates", true}, prepare_dpll},
    {{"cll", "exact log-likelihood of the --discriminative predicates together, given the rest", true}, prepare_cll},
    {{"ll", "exact log-likelihood of the whole database, for small models", false}, prepare_ll},
    {{"mcsat", "the likelihood of cll by sampling, for components too wide for exact sums", true}, prepare_mcsat},
};

}  // namespace

std::span<const LearningMethod> learning_method_table() { return kMethods; }

const LearningMethod* find_learning_method(std::string_view name) {
  for (const LearningMethod& method : kMethods) {
    if (method.info.name == name) return &method;
  }
  return nullptr;
}

OptimiserResult maximise(PreparedData& data, std::span<const std::uint32_t> databases, Objective& objective,
                         const StartingPoint& start, const OptimiserOptions& options, const StopCondition& stop) {
  if (auto found = data.search(databases, start, options, stop)) return std::move(*found);
  const std::unique_ptr<Objective> nearby = data.nearby(databases);
  if (!nearby) return maximise(objective, start.weights, start.free, start.priors, options, stop);
  OptimiserOptions rough = options;
  rough.gradient_tolerance = std::max(1e-2, options.gradient_tolerance);
  rough.function_tolerance = std::max(1e-6, options.function_tolerance);
  const OptimiserResult near = maximise(*nearby, start.weights, start.free, start.priors, rough, stop);
  return maximise(objective, near.weights, start.free, start.priors, options, stop);
}

std::span<const LearningMethodInfo> learning_methods() {
  static const std::vector<LearningMethodInfo> infos = [] {
    std::vector<LearningMethodInfo> result;
    for (const LearningMethod& method : kMethods) result.push_back(method.info);
    return result;
  }();
  return infos;
}

}  // namespace sherlog
