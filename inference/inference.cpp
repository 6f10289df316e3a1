#include "inference/inference.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <new>

#include "inference/block_recognition.h"
#include "inference/exact.h"
#include "inference/group_lifting.h"
#include "inference/matching.h"
#include "inference/mcsat.h"
#include "inference/soft_targets.h"

namespace sherlog {
namespace {

// It tries bounded search on wide components until that has failed so often.
constexpr int kAutoFailedSearches = 16;
// Components with fewer variables than this are summed at once anyway.
constexpr std::size_t kLeastMatching = 32;
constexpr double kConvergedRhat = 1.01;  // Vehtari et al. 2021, section 4
constexpr double kConvergedEssPerChain = 100.0;

// Takes over what `part` says about these components, which `result` leaves alone.
void merge(const GroundNetwork& network, std::span<const ComponentId> components, MethodResult part,
           MethodResult& result) {
  for (ComponentId c : components) {
    for (std::uint32_t q : network.component_queries(c)) {
      if (q < part.marginals.size()) result.marginals[q] = part.marginals[q];
    }
  }
  if (!part.log_partition) result.log_partition.reset();
  if (result.log_partition) *result.log_partition += *part.log_partition;
  result.samples += part.samples;
  result.termination = part.termination;
  result.message = std::move(part.message);
  result.conflict = std::move(part.conflict);
}

// Marginals, by the chosen method or by `auto`'s choice for each component.
MethodResult run_marginals(const MethodContext& context, const Method* method, std::string& used) {
  if (method != nullptr) {
    used = method->name;
    return method->run(context);
  }
  std::vector<ComponentId> matchings, narrow, wide;
  std::vector<MatchingStructure> structures;
  int failed_searches = 0;
  for (ComponentId c : context.components) {
    if (context.network.component_variables(c).size() >= kLeastMatching) {
      if (auto structure = quick_matching(context.network, c)) {
        matchings.push_back(c);
        structures.push_back(*std::move(structure));
        continue;
      }
    }
    const ExactCost cost = exact_cost(context.network, c, context.options, context.stop);
    bool exact = !cost.possible || (cost.feasible && cost.total_log2 <= kQuickLog2);
    if (!exact && !cost.feasible && failed_searches < kAutoFailedSearches) {
      exact = search_is_cheap(context.network, c, context.options, context.atom_bias, context.stop);
      failed_searches += exact ? 0 : 1;
    }
    (exact ? narrow : wide).push_back(c);
  }
  used = wide.empty() ? "exact" : narrow.empty() && matchings.empty() ? "mcsat" : "exact+mcsat";
  const InferenceOptions& options = context.options;
  MethodResult result = run_exact({context.network, narrow, options, context.stop, context.atom_bias});
  if (result.termination == Termination::kCompleted && !matchings.empty()) {
    if (wide.empty()) used = "matching";
    merge(context.network, matchings,
          run_matching({context.network, matchings, options, context.stop, context.atom_bias}, std::move(structures)),
          result);
  }
  if (wide.empty()) return result;
  if (result.termination != Termination::kCompleted) {
    for (ComponentId c : wide) {
      for (std::uint32_t q : context.network.component_queries(c))
        result.marginals[q].probability = std::numeric_limits<double>::quiet_NaN();
    }
    return result;
  }
  MethodResult sampled = run_mcsat({context.network, wide, options, context.stop, context.atom_bias});
  for (ComponentId c : wide) {
    for (std::uint32_t q : context.network.component_queries(c)) result.marginals[q] = sampled.marginals[q];
  }
  result.log_partition.reset();
  result.samples += sampled.samples;
  result.termination = sampled.termination;
  result.message = std::move(sampled.message);
  result.conflict = std::move(sampled.conflict);
  std::ranges::move(sampled.warnings, std::back_inserter(result.warnings));
  return result;
}

ChainDiagnostics judge(const std::vector<Marginal>& marginals, std::uint32_t chains) {
  ChainDiagnostics diagnostics;
  for (const Marginal& m : marginals) {
    if (!m.mcse) continue;    // not sampled
    if (!m.ess || !m.rhat) {  // too few draws to tell
      ++diagnostics.not_converged;
      continue;
    }
    const double rhat = *m.rhat, ess = *m.ess;
    diagnostics.rhat_max = std::max(diagnostics.rhat_max.value_or(rhat), rhat);
    diagnostics.ess_min = std::min(diagnostics.ess_min.value_or(ess), ess);
    if (!(rhat < kConvergedRhat) || ess < kConvergedEssPerChain * chains) ++diagnostics.not_converged;
  }
  diagnostics.converged = diagnostics.not_converged == 0;
  return diagnostics;
}

std::string convergence_warning(const ChainDiagnostics& diagnostics, std::size_t marginals) {
  const std::string figures =
      diagnostics.rhat_max && diagnostics.ess_min
          ? fmt::format("largest R-hat {:.3f}, smallest ESS {:.0f}", *diagnostics.rhat_max, *diagnostics.ess_min)
          : "too few draws to tell";
  return fmt::format("{} of {} marginals have not converged ({}): take more --samples, or another method",
                     diagnostics.not_converged, marginals, figures);
}

struct Bounds {
  const char* name;
  double value, least, most;
};

}  // namespace

std::string validate(const InferenceOptions& options) {
  if (options.method != "auto" && find_method(options.method) == nullptr) {
    std::string known = "auto";
    for (const Method& m : methods()) known += std::string(", ") + m.name;
    return fmt::format("unknown method '{}': expected one of {}", options.method, known);
  }
  const Bounds bounds[] = {
      {"samples", static_cast<double>(options.samples), 1, 4e9},
      {"chains", static_cast<double>(options.chains), 1, 1024},
      {"burn-in", static_cast<double>(options.burn_in), 0, 4e9},
      {"threads", static_cast<double>(options.threads), 0, 4096},
      {"max-seconds", options.max_seconds, 0, std::numeric_limits<double>::infinity()},
      {"max-memory", static_cast<double>(options.max_memory), 1, std::numeric_limits<double>::infinity()},
      {"max-table-log2", options.max_table_log2, 1, 31},
      {"search-gap", options.search_gap, 0, 1},
      {"flips", static_cast<double>(options.flips), 1, 1e18},
      {"restarts", static_cast<double>(options.restarts), 1, 1e6},
  };
  for (const Bounds& b : bounds) {
    if (!(b.value >= b.least))
      return fmt::format("option '{}' is {}, but must be at least {}", b.name, b.value, b.least);
    if (!(b.value <= b.most)) return fmt::format("option '{}' is {}, but must be at most {}", b.name, b.value, b.most);
  }
  return {};
}

namespace {

std::vector<ComponentId> all_components(const GroundNetwork& network) {
  std::vector<ComponentId> components;
  for (std::size_t c = 0; c < network.component_count(); ++c) components.emplace_back(c);
  return components;
}

// From the values of a network with blocks to those of the network in which they were spelled out.
std::vector<std::uint32_t> values_before(const GroundNetwork& network, const RecognisedBlocks& blocks,
                                         std::span<const std::uint32_t> values) {
  std::vector<std::uint32_t> out;
  for (std::size_t v = 0; v < network.variable_count(); ++v) {
    const VariableId variable(v);
    const std::uint32_t candidates = network.candidate_count(variable);
    std::uint32_t value = 0;
    for (; value < candidates; ++value) {
      const AtomId atom = blocks.atom[network.first_atom(variable).index() + value];
      if (values[blocks.network.variable_of(atom).index()] == blocks.network.value_of(atom)) break;
    }
    out.push_back(value);  // past the candidates: none
  }
  return out;
}

MethodResult run_method(const GroundNetwork& network, const Method* method, const InferenceOptions& options,
                        const StopCondition& stop, std::span<const double> biases, std::string& used) {
  const std::vector<ComponentId> components = all_components(network);
  const MethodContext context{network, components, options, stop, biases};
  if (method != nullptr && method->finds_map) return method->run(context);
  MethodResult run = run_marginals(context, method, used);
  // A formula that the evidence decides has no component: nobody asked a method.
  for (std::size_t q = 0; q < network.queries().size(); ++q) {
    const Literal literal = network.queries()[q].literal;
    if (literal.is_constant()) run.marginals[q] = {literal == Literal::constant(true) ? 1.0 : 0.0, {}, {}, {}};
  }
  return run;
}

void infer_into(InferenceResult& result, const GroundNetwork& original, const InferenceOptions& options,
                const StopCondition& stop) {
  // With their sum every sum of some of them is finite, too.
  double sum = std::abs(original.constant_score()) + original.free_log_count();
  for (const Feature& feature : original.features()) sum += std::abs(feature.weight);
  if (!std::isfinite(sum)) {
    result.termination = Termination::kRefused;
    result.message = "the weights of ground formulas add up to more than a number can hold";
    return;
  }
  const Method* method = options.method == "auto" ? nullptr : find_method(options.method);
  const bool wants_map = method != nullptr && method->finds_map;
  // Constraints, variables and queries keep their numbers, so nothing in the result has to be translated back.
  const std::optional<GroundNetwork> lifted = lift_over_groups(original, &stop);
  const GroundNetwork& network = lifted ? *lifted : original;
  std::vector<double> biases;
  std::vector<std::string> warnings;
  if (!network.soft_targets().empty()) {
    SoftTargetFit fit = fit_soft_targets(network, method, options, stop);
    result.termination = fit.termination;
    result.message = std::move(fit.message);
    result.conflict = std::move(fit.conflict);
    if (result.termination != Termination::kCompleted) return;
    biases = std::move(fit.biases);
    warnings = std::move(fit.warnings);
  }
  MethodResult run;
  std::optional<RecognisedBlocks> blocks;
  if (network.soft_targets().empty()) blocks = recognise_blocks(network);
  if (blocks && blocks->possible) {
    run = run_method(blocks->network, method, options, stop, {}, result.method);
    if (!run.values.empty()) run.values = values_before(network, *blocks, run.values);
    const double moved = blocks->network.constant_score();
    if (run.log_partition) *run.log_partition += moved;
    run.map_score += moved;
    run.map_bound += moved;
  }
  // What contradicts what is named by the network itself.
  if (!blocks || !blocks->possible || run.termination == Termination::kNoPossibleWorld) {
    run = run_method(network, method, options, stop, biases, result.method);
  }
  result.termination = run.termination;
  result.message = std::move(run.message);
  result.conflict = std::move(run.conflict);
  result.warnings = std::move(warnings);
  std::ranges::move(run.warnings, std::back_inserter(result.warnings));
  result.samples = run.samples;
  // Fitted biases make another distribution of the same worlds, whose partition sum says nothing about the model.
  if (run.log_partition && result.termination == Termination::kCompleted && biases.empty()) {
    result.log_partition = *run.log_partition + network.constant_score() + network.free_log_count();
  }
  if (wants_map) {
    // Where evidence decides everything, the one world has no variables left.
    if (!run.values.empty() || (network.variable_count() == 0 && run.termination == Termination::kCompleted)) {
      MapSolution solution;
      solution.values = std::move(run.values);
      solution.log_score = run.map_score + network.constant_score();
      solution.gap = std::max(0.0, run.map_bound - run.map_score);
      // Sums of weights in different orders differ by rounding; a gap below that is none.
      const double rounding = 1e-9 * (1.0 + std::abs(run.map_score));
      if (solution.gap <= rounding) solution.gap = 0.0;
      solution.optimal = solution.gap == 0.0;
      result.map = std::move(solution);
    }
  } else if (result.termination != Termination::kNoPossibleWorld && result.termination != Termination::kRefused) {
    result.marginals = std::move(run.marginals);
    const bool sampled = std::ranges::any_of(result.marginals, [](const Marginal& m) { return m.mcse.has_value(); });
    if (sampled) {
      result.diagnostics = judge(result.marginals, options.chains);
      if (!result.diagnostics->converged) {
        result.warnings.push_back(convergence_warning(*result.diagnostics, result.marginals.size()));
      }
    }
  }
}

}  // namespace

InferenceResult infer(const GroundNetwork& original, const InferenceOptions& options, Monitor& monitor) {
  const StopCondition stop(monitor, options.max_seconds);
  InferenceResult result;
  result.options = options;
  result.seed = options.seed;
  result.method = options.method;
  result.message = validate(options);
  if (!result.message.empty()) {
    result.termination = Termination::kRefused;
    return result;
  }
  try {
    infer_into(result, original, options, stop);
  } catch (const std::bad_alloc&) {
    result.marginals.clear();
    result.map.reset();
    result.diagnostics.reset();
    result.samples = 0;
    result.termination = Termination::kMemoryLimit;
    result.message = "memory ran out";
  }
  result.seconds = stop.seconds();
  return result;
}

}  // namespace sherlog
