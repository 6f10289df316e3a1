#include "inference/map.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <thread>

#include "inference/conflict.h"
#include "inference/exact.h"
#include "inference/integer_program.h"
#include "inference/map_reduction.h"
#include "inference/matching.h"
#include "inference/max_walk_sat.h"
#include "inference/min_cut.h"

namespace sherlog {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
// A component with at most this many joint values (log2) goes to elimination unseen: no order can make it expensive.
constexpr double kTinyLog2 = 12.0;
// Beyond this table size (log2), or in total, the relaxation is the better bet.
constexpr double kNarrowLog2 = 16.0;
constexpr double kNarrowTotalLog2 = 23.0;
// Effort of the integer program: size of the program x iterations. 1e9 of it takes a second or two in the relaxation and, with
// cuts, about 30 times that in the tree. The first look decides most matchings before elimination has been considered.
constexpr double kFirstWork = 2e8;
constexpr double kRelaxationWork = 1.5e9;
constexpr double kTreeWork = 1e8;
constexpr std::uint32_t kTreeNodes = 5000;
constexpr std::size_t kLeastMatching = 32;    // components with fewer variables need no look at their structure
constexpr std::uint64_t kShortFlips = 20000;  // of the search for an incumbent
constexpr std::uint64_t kConflictDecisions = 100000;
// Gaps below this share of the score are rounding.
constexpr double kGapTolerance = 1e-7;

// A world of a network, or the lack of one.
struct Outcome {
  bool possible = true;               // false: proved that no world meets the hard formulas
  bool found = true;                  // values meet them
  std::vector<std::uint32_t> values;  // by variable
  double gap = 0.0;                   // no world scores more than this one plus the gap

  static Outcome impossible() {
    Outcome out;
    out.possible = out.found = false;
    return out;
  }
};

// Sum of the components' features; minus infinity where a hard formula of theirs is broken.
double score_of(const GroundNetwork& network, std::span<const ComponentId> components,
                std::span<const std::uint32_t> values, std::span<const double> atom_bias) {
  std::vector<std::uint8_t> truth(network.gate_count(), 0);
  const auto is_true = [&](Literal l) {
    if (l.is_gate()) return (truth[l.gate().index()] != 0) != l.negated();
    return (values[network.variable_of(l.atom()).index()] == network.value_of(l.atom())) != l.negated();
  };
  for (std::size_t g = 0; g < network.gate_count(); ++g) {
    const auto inputs = network.gate_inputs(GateId(g));
    const auto count = std::ranges::count_if(inputs, is_true);
    truth[g] = (network.gate_kind(GateId(g)) == GateKind::kOr ? count > 0 : count != 1) ? 1 : 0;
  }
  double score = 0.0;
  for (ComponentId c : components) {
    for (std::uint32_t k : network.component_constraints(c)) {
      if (!is_true(network.constraints()[k].literal)) return -kInfinity;
    }
    for (std::uint32_t f : network.component_features(c)) {
      if (is_true(network.features()[f].literal)) score += network.features()[f].weight;
    }
    if (atom_bias.empty()) continue;
    for (VariableId v : network.component_variables(c)) {
      if (values[v.index()] < network.candidate_count(v))
        score += atom_bias[network.first_atom(v).index() + values[v.index()]];
    }
  }
  return score;
}

std::vector<ComponentId> all_components(const GroundNetwork& network) {
  std::vector<ComponentId> all(network.component_count());
  for (std::size_t c = 0; c < all.size(); ++c) all[c] = ComponentId(c);
  return all;
}

class MapSearch {
 public:
  MapSearch(const InferenceOptions& options, const StopCondition& stop) : options_(options), stop_(stop) {
    narrow_options_ = options;
    narrow_options_.max_table_log2 = std::min(options.max_table_log2, kNarrowLog2);
    threads_ = options.threads != 0 ? options.threads : std::max(1u, std::thread::hardware_concurrency());
  }

  // All components of a network. `pairwise`: minimum cuts may help.
  Outcome solve(const GroundNetwork& network, bool pairwise) {
    Outcome out;
    out.values.assign(network.variable_count(), 0);
    std::vector<ComponentId> tiny, others;
    for (ComponentId c : all_components(network)) (is_tiny(network, c) ? tiny : others).push_back(c);
    if (!tiny.empty() && !solve_tiny(network, tiny, others, out)) return Outcome::impossible();
    if (others.size() == 1 && tiny.empty()) return solve_component(network, pairwise);
    if (others.empty()) return out;
    MapReduction parts(network);
    for (std::size_t i = 0; i < others.size(); ++i) {
      if (!parts.reduce({&others[i], 1})) return Outcome::impossible();
      Outcome part = solve(parts.rest(), pairwise);
      if (!part.possible) return part;
      out.found = out.found && part.found;
      out.gap += part.gap;
      parts.lift(part.values, out.values);
      stop_.monitor().progress("map", static_cast<double>(i + 1), static_cast<double>(others.size()));
    }
    return out;
  }

 private:
  static bool is_tiny(const GroundNetwork& network, ComponentId c) {
    double log2 = 0.0;
    for (VariableId v : network.component_variables(c)) {
      log2 += std::log2(static_cast<double>(network.value_count(v)));
      if (log2 > kTinyLog2) return false;
    }
    return true;
  }

  // False where a component has no possible world. What elimination leaves open is moved to `others`.
  bool solve_tiny(const GroundNetwork& network, std::span<const ComponentId> tiny, std::vector<ComponentId>& others,
                  Outcome& out) {
    const MethodResult result = run_exact_map({network, tiny, options_, stop_, {}});
    if (result.termination == Termination::kNoPossibleWorld) return false;
    if (result.termination == Termination::kCompleted) {
      out.values = result.values;
    } else {
      others.insert(others.end(), tiny.begin(), tiny.end());
    }
    return true;
  }

  // A network of one component.
  Outcome solve_component(const GroundNetwork& network, bool pairwise) {
    double bound = kInfinity;
    if (pairwise) {
      MinCutResult cut = min_cut(network, stop_);
      if (cut.status == MinCutStatus::kImpossible) return Outcome::impossible();
      if (cut.status == MinCutStatus::kOptimal) {
        Outcome out;
        out.values = std::move(cut.values);
        return out;
      }
      if (cut.status == MinCutStatus::kPartial) {
        bound = cut.bound;
        if (std::ranges::any_of(cut.values, [](std::uint32_t v) { return v != MinCutResult::kUndecided; })) {
          return solve_decided(network, cut);
        }
      }
    }
    return solve_wide(network, bound);
  }

  // Elimination, if it is cheap. False where it is not.
  bool solve_narrow(const GroundNetwork& network, Outcome& out) {
    if (stop_.reached()) return false;
    const ExactCost cost = exact_cost(network, ComponentId(0), narrow_options_, stop_);
    if (cost.possible && (!cost.feasible || cost.total_log2 > kNarrowTotalLog2)) return false;
    const std::vector<ComponentId> all = all_components(network);
    MethodResult result = run_exact_map({network, all, narrow_options_, stop_, {}});
    if (result.termination == Termination::kNoPossibleWorld) {
      out = Outcome::impossible();
      return true;
    }
    if (result.termination != Termination::kCompleted) return false;
    out.values = std::move(result.values);
    return true;
  }

  // Values that some most probable world has are put in, and what is left is looked at anew.
  Outcome solve_decided(const GroundNetwork& network, const MinCutResult& cut) {
    MapReduction reduction(network);
    const std::vector<ComponentId> all = all_components(network);
    if (!reduction.reduce(all, cut.values)) return Outcome::impossible();
    Outcome rest = solve(reduction.rest(), false);
    if (!rest.possible) return rest;
    Outcome out;
    out.found = rest.found;
    out.values.assign(network.variable_count(), 0);
    reduction.lift(rest.values, out.values);
    out.gap = rest.gap;
    if (out.found) out.gap = std::min(out.gap, std::max(0.0, cut.bound - score_of(network, all, out.values, {})));
    return out;
  }

  Outcome finish(const LocalOptimum& best, double bound) const {
    Outcome out;
    out.values = best.values;
    out.found = best.broken == 0;
    out.gap = std::max(0.0, bound - best.score);
    if (out.gap <= kGapTolerance * (1.0 + std::abs(best.score))) out.gap = 0.0;
    return out;
  }

  MaxWalkSatOptions search_options() const {
    MaxWalkSatOptions search;
    search.flips = options_.flips;
    search.patience = std::max<std::uint64_t>(options_.flips / 4, 1);
    search.restarts = options_.restarts;
    search.seed = options_.seed;
    search.threads = threads_;
    return search;
  }

  // The sum of what every weight wants.
  static double trivial_bound(const GroundNetwork& network) {
    double bound = 0.0;
    for (const Feature& f : network.features()) bound += std::max(0.0, f.weight);
    return bound;
  }

  static void keep_better(LocalOptimum& best, LocalOptimum other) {
    if (other.broken < best.broken || (other.broken == best.broken && other.score > best.score))
      best = std::move(other);
  }

  Outcome solve_wide(const GroundNetwork& network, double bound) {
    bound = std::min(bound, trivial_bound(network));
    std::vector<std::vector<std::uint32_t>> starts;
    if (!stop_.reached()) {
      Outcome out;
      IntegerProgram program(network);
      if (static_cast<double>(program.memory_bytes()) > 0.5 * static_cast<double>(options_.max_memory)) {
        if (solve_narrow(network, out)) return out;
      } else if (solve_program(network, program, bound, starts, out)) {
        return out;
      }
    }
    MaxWalkSatOptions search = search_options();
    search.enough = bound - kGapTolerance * (1.0 + std::abs(bound));
    return finish(max_walk_sat(network, search, stop_, starts), bound);
  }

  // The integer program, and elimination between its first look and its further efforts. True where that decided the matter
  // (`out`). Otherwise `bound` and `starts` are what it left.
  bool solve_program(const GroundNetwork& network, IntegerProgram& program, double& bound,
                     std::vector<std::vector<std::uint32_t>>& starts, Outcome& out) {
    const double size = static_cast<double>(program.entries() + program.rows() + program.columns());
    IntegerProgramStatus status = IntegerProgramStatus::kOpen;
    const auto relax = [&](double work) {
      status = program.relax({static_cast<std::uint64_t>(work / size), 0}, stop_);
    };
    relax(kFirstWork);
    LocalOptimum best;
    if (program.is_relaxed()) {
      bound = std::min(bound, program.bound());
      best = descend(network, program.values(), stop_);
    }
    const auto decided = [&] {
      if (status == IntegerProgramStatus::kImpossible) {
        out = Outcome::impossible();
        return true;
      }
      if (!program.is_relaxed() || !reaches(best, bound)) return false;
      out = finish(best, bound);
      return true;
    };
    if (decided() || solve_narrow(network, out)) return true;
    if (!program.is_relaxed()) {
      relax(kRelaxationWork);
      if (program.is_relaxed()) {
        bound = std::min(bound, program.bound());
        best = descend(network, program.values(), stop_);
      }
      if (decided()) return true;
      if (!program.is_relaxed()) return false;
    }
    starts.push_back(best.values);
    starts.push_back(program.values());
    if (stop_.reached()) return false;
    MaxWalkSatOptions search = search_options();
    search.flips = std::min(search.flips, kShortFlips + 10 * network.variable_count());
    search.patience = search.flips / 2 + 1;
    search.restarts = std::min(search.restarts, 2u);
    search.enough = bound - kGapTolerance * (1.0 + std::abs(bound));
    keep_better(best, max_walk_sat(network, search, stop_, starts));
    if (decided()) return true;
    status = branch(network, program, size, bound, best);
    if (status == IntegerProgramStatus::kOptimal && best.broken == 0) bound = best.score;  // to the solver's tolerance
    starts[0] = best.values;
    return decided();
  }

  IntegerProgramStatus branch(const GroundNetwork& network, IntegerProgram& program, double size, double& bound,
                              LocalOptimum& best) {
    // Half of the time that is left, so that local search has the rest.
    const StopCondition tree_stop(stop_.monitor(), 0.5 * (stop_.max_seconds() - stop_.seconds()));
    const std::span<const std::uint32_t> incumbent =
        best.broken == 0 ? std::span<const std::uint32_t>(best.values) : std::span<const std::uint32_t>();
    const IntegerProgramEffort effort{static_cast<std::uint64_t>(kTreeWork / size), kTreeNodes};
    const IntegerProgramStatus status = program.branch_and_cut(incumbent, effort, tree_stop);
    if (status == IntegerProgramStatus::kImpossible) return status;
    bound = std::min(bound, program.bound());
    keep_better(best, descend(network, program.values(), stop_));
    return status;
  }

  static bool reaches(const LocalOptimum& best, double bound) {
    return best.broken == 0 && best.score >= bound - kGapTolerance * (1.0 + std::abs(bound));
  }

  const InferenceOptions& options_;
  InferenceOptions narrow_options_;
  const StopCondition& stop_;
  std::uint32_t threads_ = 1;
};

MethodResult no_possible_world(const MethodContext& context) {
  MethodResult result;
  result.termination = Termination::kNoPossibleWorld;
  result.message = "no world meets all hard formulas";
  result.map_score = result.map_bound = -kInfinity;
  for (ComponentId c : context.components) {
    const auto constraints = context.network.component_constraints(c);
    if (constraints.empty()) continue;
    const auto answer = check_constraints(context.network, constraints, kConflictDecisions, context.stop);
    if (!answer || answer->possible) continue;
    result.conflict = small_conflict(context.network, answer->core, context.stop);
    break;
  }
  return result;
}

MethodResult run_map_by_search(const MethodContext& context) {
  MapReduction reduction(context.network, context.atom_bias);
  if (!reduction.reduce(context.components)) return no_possible_world(context);
  MapSearch search(context.options, context.stop);
  const Outcome outcome = search.solve(reduction.rest(), true);
  if (!outcome.possible) return no_possible_world(context);
  MethodResult result;
  result.values.assign(context.network.variable_count(), 0);
  reduction.lift(outcome.values, result.values);
  result.map_score = score_of(context.network, context.components, result.values, context.atom_bias);
  result.map_bound = result.map_score + outcome.gap;
  // The last word has the network itself.
  const bool found = outcome.found && result.map_score > -kInfinity;
  result.termination = outcome.gap == 0.0 && found ? Termination::kCompleted : context.stop.reason();
  if (!found) {
    result.values.clear();
    result.map_score = -kInfinity;
    result.map_bound = kInfinity;
    if (result.termination == Termination::kCompleted) result.termination = Termination::kTimeLimit;
    result.message = "no world that meets the hard formulas was found; whether there is one was not settled";
  } else if (result.termination != Termination::kCompleted) {
    result.message = "the best world found so far; a better one has not been ruled out";
  }
  return result;
}

}  // namespace

MethodResult run_map(const MethodContext& context) {
  std::vector<ComponentId> others;
  std::vector<MatchingOptimum> matchings;
  for (ComponentId c : context.components) {
    std::optional<MatchingOptimum> best;
    if (context.network.component_variables(c).size() >= kLeastMatching) {
      const MatchingStructure structure = find_matching(context.network, c);
      if (structure.found()) best = best_matching_world(context.network, structure, context.atom_bias);
    }
    if (best) {
      matchings.push_back(*std::move(best));
    } else {
      others.push_back(c);
    }
  }
  if (matchings.empty()) return run_map_by_search(context);
  MethodResult result;
  if (others.empty()) {
    result.values.assign(context.network.variable_count(), 0);
  } else {
    result = run_map_by_search({context.network, others, context.options, context.stop, context.atom_bias});
    if (result.values.empty()) return result;
  }
  for (const MatchingOptimum& best : matchings) {
    for (const auto& [variable, value] : best.values) result.values[variable.index()] = value;
    result.map_score += best.score;
    result.map_bound += best.score;
  }
  return result;
}

}  // namespace sherlog
