#include "inference/explain.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace sherlog {
namespace {

constexpr std::uint32_t kNone = 0xffffffffu;
constexpr std::size_t kMaxConstraintsLeftOut =
    32;  // each costs two runs; beyond the nearest few the influence is small
constexpr double kInfinity = std::numeric_limits<double>::infinity();

// The target's component once more, with the target held at one value and maybe one constraint less. A constraint of the copy
// remembers its number in the original as its binding. Its queries are features, in the component's order, or the target.
class ComponentCopy {
 public:
  ComponentCopy(const GroundNetwork& original, Literal target)
      : original_(original), target_(target), component_(original.component_of(target)) {}

  struct Made {
    std::optional<GroundNetwork> network;  // nothing where two demands contradict each other at a glance
  };

  // Positions in the component's list of features.
  struct Range {
    std::size_t begin = 0, end = 0;
    std::size_t size() const { return end - begin; }
  };

  // `held`: demand the target (true), its negation (false), or neither. `queried`: features that are asked for; none: the
  // target is.
  Made make(std::optional<bool> held, std::uint32_t left_out, Range queried) const {
    NetworkBuilder builder(original_.names());
    std::vector<std::uint32_t> atoms(original_.atom_count(), kNone);
    for (VariableId variable : original_.component_variables(component_)) copy_variable(variable, builder, atoms);
    std::vector<Literal> gates = copy_gates(builder, atoms);
    const auto map = [&](Literal literal) { return mapped(literal, atoms, gates); };

    const auto features = original_.component_features(component_);
    for (std::size_t i = 0; i < features.size(); ++i) {
      const Feature& feature = original_.features()[features[i]];
      // A weight of its own for each feature keeps them apart in the copy.
      const WeightId weight = builder.add_weight({FormulaId(0), {}, feature.weight});
      builder.add_feature(map(feature.literal), feature.weight, weight);
      if (queried.begin <= i && i < queried.end) builder.add_query({map(feature.literal), true, ""});
    }
    for (std::uint32_t c : original_.component_constraints(component_)) {
      if (c == left_out) continue;
      const Constraint& constraint = original_.constraints()[c];
      const ConstantIndex number[] = {c};
      if (!builder.add_constraint(map(constraint.literal), constraint.formula, number)) return {};
    }
    if (queried.size() == 0) builder.add_query({map(target_), false, ""});
    if (held && !builder.add_constraint(*held ? map(target_) : ~map(target_), FormulaId(kNone))) return {};
    return {builder.build()};
  }

  // The original's constraints among those of a conflict in the copy.
  static std::vector<std::uint32_t> original_constraints(const GroundNetwork& copy,
                                                         const std::vector<std::uint32_t>& conflict) {
    std::vector<std::uint32_t> result;
    for (std::uint32_t c : conflict) {
      const Constraint& constraint = copy.constraints()[c];
      if (constraint.binding != kNoBinding && !copy.binding(constraint.binding).empty()) {
        result.push_back(copy.binding(constraint.binding).front());
      }
    }
    std::sort(result.begin(), result.end());
    result.erase(std::unique(result.begin(), result.end()), result.end());
    return result;
  }

 private:
  void copy_variable(VariableId variable, NetworkBuilder& builder, std::vector<std::uint32_t>& atoms) const {
    const AtomId first = original_.first_atom(variable);
    const std::uint32_t count = original_.candidate_count(variable);
    std::vector<ConstantIndex> arguments;
    for (std::uint32_t i = 0; i < count; ++i) {
      const auto of_atom = original_.arguments_of(AtomId(first.value + i));
      arguments.insert(arguments.end(), of_atom.begin(), of_atom.end());
    }
    const VariableId copy =
        builder.add_variable(original_.predicate_of(first), arguments, count, original_.has_none(variable));
    for (std::uint32_t i = 0; i < count; ++i) atoms[first.value + i] = builder.first_atom(copy).value + i;
  }

  // Gates of other components have no copied atoms and are left at constant false, which nothing here refers to.
  std::vector<Literal> copy_gates(NetworkBuilder& builder, const std::vector<std::uint32_t>& atoms) const {
    std::vector<Literal> gates(original_.gate_count(), Literal::constant(false));
    for (std::size_t g = 0; g < gates.size(); ++g) {
      const auto inputs = original_.gate_inputs(GateId(g));
      if (original_.component_of(Literal::gate(GateId(g))) != component_) continue;
      std::vector<Literal> copied;
      for (Literal input : inputs) copied.push_back(mapped(input, atoms, gates));
      gates[g] = original_.gate_kind(GateId(g)) == GateKind::kIff ? builder.make_iff(copied[0], copied[1])
                                                                  : builder.make_or(copied);
    }
    return gates;
  }

  static Literal mapped(Literal literal, const std::vector<std::uint32_t>& atoms, const std::vector<Literal>& gates) {
    if (literal.is_constant()) return literal;
    if (literal.is_atom()) return Literal::atom(AtomId(atoms[literal.atom().index()]), literal.negated());
    const Literal gate = gates[literal.gate().index()];
    return literal.negated() ? ~gate : gate;
  }

  const GroundNetwork& original_;
  Literal target_;
  ComponentId component_;
};

// log E[exp(-w f)] for P(f) = p, and its derivative in p.
double log_expectation(double p, double weight) {
  // Where p rounds to 1 and w is large, 1 - p is lost to rounding anyway; log1p keeps small p and small w exact.
  return std::log1p(p * std::expm1(-weight));
}
double slope(double p, double weight) { return std::expm1(-weight) / (1.0 + p * std::expm1(-weight)); }

// Runs inference with the rest of the time.
class Runner {
 public:
  Runner(const InferenceOptions& options, Monitor& monitor)
      : options_(options), monitor_(monitor), stop_(monitor, options.max_seconds) {}

  InferenceResult run(const GroundNetwork& network) const {
    InferenceOptions options = options_;
    options.max_seconds = std::max(0.0, options_.max_seconds - stop_.seconds());
    return infer(network, options, monitor_);
  }
  void set_method(const std::string& method) { options_.method = method; }
  const StopCondition& stop() const { return stop_; }

 private:
  InferenceOptions options_;
  Monitor& monitor_;
  StopCondition stop_;
};

// log Z(a) - log Z(!a) on a copy with one constraint less; nothing where a run did not finish.
std::optional<double> log_odds_without(const ComponentCopy& copy, std::uint32_t left_out, const Runner& runner) {
  double log_z[2] = {-kInfinity, -kInfinity};
  for (const bool held : {false, true}) {
    const auto made = copy.make(held, left_out, {});
    if (!made.network) continue;
    const InferenceResult result = runner.run(*made.network);
    if (result.termination == Termination::kNoPossibleWorld) continue;
    if (result.termination != Termination::kCompleted || !result.log_partition) return std::nullopt;
    log_z[held ? 1 : 0] = *result.log_partition;
  }
  if (std::isinf(log_z[0]) && std::isinf(log_z[1])) return std::nullopt;
  return log_z[1] - log_z[0];
}

void add_feature_contributions(const GroundNetwork& network, std::span<const std::uint32_t> features,
                               const InferenceResult& if_true, const InferenceResult& if_false,
                               Explanation& explanation) {
  for (std::size_t i = 0; i < features.size(); ++i) {
    const double weight = network.features()[features[i]].weight;
    const Marginal& p1 = if_true.marginals[i];
    const Marginal& p0 = if_false.marginals[i];
    Contribution contribution;
    contribution.index = features[i];
    contribution.log_odds = log_expectation(p0.probability, weight) - log_expectation(p1.probability, weight);
    if (p1.mcse && p0.mcse) {
      contribution.mcse =
          std::hypot(slope(p1.probability, weight) * *p1.mcse, slope(p0.probability, weight) * *p0.mcse);
    }
    if (contribution.log_odds != 0.0) explanation.contributions.push_back(contribution);
  }
}

bool gives_marginals(const InferenceResult& result, std::size_t queries) {
  return result.marginals.size() == queries &&
         (result.termination == Termination::kCompleted || result.termination == Termination::kTimeLimit ||
          result.termination == Termination::kInterrupted);
}

// The features in `range` given the target's truth. A query widens the elimination, so many of them can be too wide together
// where few are not: then each half is asked for itself.
InferenceResult run_held(const ComponentCopy& copy, bool held, ComponentCopy::Range range, const Runner& runner) {
  const auto made = copy.make(held, kNone, range);
  InferenceResult result;
  if (!made.network) {
    result.termination = Termination::kNoPossibleWorld;
    return result;
  }
  result = runner.run(*made.network);
  if (result.termination == Termination::kNoPossibleWorld) {
    result.conflict = ComponentCopy::original_constraints(*made.network, result.conflict);
  }
  if (result.termination != Termination::kTooWide || range.size() < 2) return result;
  const std::size_t middle = range.begin + range.size() / 2;
  result = run_held(copy, held, {range.begin, middle}, runner);
  if (result.termination != Termination::kCompleted) return result;
  InferenceResult rest = run_held(copy, held, {middle, range.end}, runner);
  if (!gives_marginals(rest, range.end - middle)) return rest;
  result.termination = rest.termination;
  result.message = std::move(rest.message);
  result.marginals.insert(result.marginals.end(), rest.marginals.begin(), rest.marginals.end());
  return result;
}

// The constraints of the target's component, those that share a variable with it first, then their neighbours, ...
std::vector<std::uint32_t> nearest_constraints(const GroundNetwork& network, Literal target) {
  const ComponentId component = network.component_of(target);
  const auto variables_of = [&](Literal literal) {
    std::vector<std::uint32_t> variables;
    std::vector<Literal> open{literal};
    while (!open.empty() && variables.size() < 10000) {
      const Literal next = open.back();
      open.pop_back();
      if (next.is_atom()) {
        variables.push_back(network.variable_of(next.atom()).value);
      } else if (next.is_gate()) {
        const auto inputs = network.gate_inputs(next.gate());
        open.insert(open.end(), inputs.begin(), inputs.end());
      }
    }
    return variables;
  };
  std::vector<bool> reached(network.variable_count(), false);
  for (std::uint32_t v : variables_of(target)) reached[v] = true;

  struct Factor {
    std::uint32_t constraint;  // or kNone: a feature
    std::vector<std::uint32_t> variables;
    bool taken = false;
  };
  std::vector<Factor> factors;
  for (std::uint32_t c : network.component_constraints(component)) {
    factors.push_back({c, variables_of(network.constraints()[c].literal)});
  }
  for (std::uint32_t f : network.component_features(component)) {
    factors.push_back({kNone, variables_of(network.features()[f].literal)});
  }
  std::vector<std::uint32_t> result;
  for (bool grew = true; grew && result.size() < kMaxConstraintsLeftOut;) {
    grew = false;
    std::vector<std::uint32_t> next;  // reached by this round; seen from the following one on
    for (Factor& factor : factors) {
      if (factor.taken) continue;
      if (std::none_of(factor.variables.begin(), factor.variables.end(), [&](std::uint32_t v) { return reached[v]; }))
        continue;
      factor.taken = true;
      grew = true;
      if (factor.constraint != kNone && result.size() < kMaxConstraintsLeftOut) result.push_back(factor.constraint);
      next.insert(next.end(), factor.variables.begin(), factor.variables.end());
    }
    for (std::uint32_t v : next) reached[v] = true;
  }
  return result;
}

void add_constraint_contributions(const GroundNetwork& network, Literal target, const ComponentCopy& copy,
                                  const Runner& runner, Explanation& explanation) {
  for (std::uint32_t c : nearest_constraints(network, target)) {
    if (runner.stop().reached()) break;
    const std::optional<double> without = log_odds_without(copy, c, runner);
    if (!without) break;  // wider without it, or out of time: the features' contributions stand all the same
    ++explanation.constraints_left_out;
    const double contribution = explanation.log_odds - *without;
    // Two sums over the same worlds in another order: what is below their rounding is nothing.
    if (std::abs(contribution) > 1e-9) explanation.contributions.push_back({true, c, contribution, {}});
  }
}

// Hard formulas leave only one value: those of the contradiction with the other value explain it.
void explain_decided(bool value, const std::vector<std::uint32_t>& conflict, Explanation& explanation) {
  explanation.probability = value ? 1.0 : 0.0;
  explanation.log_odds = value ? kInfinity : -kInfinity;
  explanation.message = "hard formulas alone decide the atom";
  for (std::uint32_t c : conflict) explanation.contributions.push_back({true, c, explanation.log_odds, {}});
}

void sort_contributions(Explanation& explanation) {
  std::stable_sort(
      explanation.contributions.begin(), explanation.contributions.end(),
      [](const Contribution& a, const Contribution& b) { return std::abs(a.log_odds) > std::abs(b.log_odds); });
}

}  // namespace

Explanation explain(const GroundNetwork& network, Literal target, const InferenceOptions& options, Monitor& monitor) {
  Explanation explanation;
  const auto refuse = [&](std::string message) {
    explanation.termination = Termination::kRefused;
    explanation.message = std::move(message);
    return explanation;
  };
  if (target.is_constant()) return refuse("the atom is decided by the evidence: there is nothing to explain");
  if (!network.soft_targets().empty()) {
    return refuse("'explain' weighs formulas, and Jeffrey evidence is none: use --soft-evidence virtual");
  }
  const Method* method = find_method(options.method);
  if (method != nullptr && method->finds_map) {
    return refuse(
        fmt::format("method '{}' finds the most probable world: use auto, exact, mcsat or gibbs", options.method));
  }

  Runner runner(options, monitor);
  const ComponentCopy copy(network, target);
  const auto features = network.component_features(network.component_of(target));
  explanation.features_in_component = features.size();
  explanation.constraints_in_component = network.component_constraints(network.component_of(target)).size();

  // The probability itself, by the method asked for.
  const auto whole = copy.make(std::nullopt, kNone, {});
  InferenceResult result;
  if (whole.network) {
    result = runner.run(*whole.network);
  } else {
    result.termination = Termination::kNoPossibleWorld;
  }
  explanation.method = result.method;
  explanation.termination = result.termination;
  explanation.message = result.message;
  if (whole.network) explanation.conflict = ComponentCopy::original_constraints(*whole.network, result.conflict);
  explanation.seconds = runner.stop().seconds();
  if (!gives_marginals(result, 1)) return explanation;
  explanation.probability = result.marginals.front().probability;
  explanation.log_odds = std::log(explanation.probability) - std::log1p(-explanation.probability);
  if (result.termination != Termination::kCompleted) return explanation;

  // The two runs. What one run could do exactly, all do exactly.
  if (result.method == "exact") runner.set_method("exact");
  InferenceResult held[2];
  for (const bool value : {false, true}) {
    InferenceResult& run = held[value ? 1 : 0];
    run = run_held(copy, value, {0, features.size()}, runner);
    explanation.seconds = runner.stop().seconds();
    if (run.termination == Termination::kNoPossibleWorld) {
      explain_decided(!value, run.conflict, explanation);
      return explanation;
    }
    if (!gives_marginals(run, features.size())) {
      explanation.termination = run.termination;
      explanation.message = run.message;
      return explanation;
    }
    if (run.termination != Termination::kCompleted) {
      explanation.termination = run.termination;
      explanation.message = run.message;
    }
  }
  if (held[0].log_partition && held[1].log_partition) {
    explanation.log_odds = *held[1].log_partition - *held[0].log_partition;
  }
  add_feature_contributions(network, features, held[1], held[0], explanation);
  if (explanation.method == "exact" && explanation.termination == Termination::kCompleted) {
    add_constraint_contributions(network, target, copy, runner, explanation);
  }
  sort_contributions(explanation);
  explanation.seconds = runner.stop().seconds();
  return explanation;
}

}  // namespace sherlog
