#include "inference/information.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <unordered_map>
#include <vector>

#include "inference/rng.h"

namespace sherlog {
namespace {

constexpr double kLeftOut = 1e-9;     // probability of all outcomes that are left out
constexpr double kSameBelief = 1e-9;  // beliefs that differ by less, relatively, are merged

constexpr const char* kNeedsMarginals = "this method finds no marginal probabilities: use exact, mcsat or gibbs";

using Values = std::vector<std::uint32_t>;  // by variable of the network

bool evaluate(const GroundNetwork& network, Literal literal, const Values& values) {
  if (literal.is_constant()) return literal == Literal::constant(true);
  if (literal.is_atom()) {
    const AtomId atom = literal.atom();
    return (values[network.variable_of(atom).index()] == network.value_of(atom)) != literal.negated();
  }
  std::uint32_t true_inputs = 0;
  for (const Literal input : network.gate_inputs(literal.gate())) true_inputs += evaluate(network, input, values);
  return gate_truth(network.gate_kind(literal.gate()), true_inputs) != literal.negated();
}

void collect_variables(const GroundNetwork& network, Literal literal, std::vector<VariableId>& found) {
  if (literal.is_constant()) return;
  if (literal.is_atom()) {
    found.push_back(network.variable_of(literal.atom()));
    return;
  }
  for (const Literal input : network.gate_inputs(literal.gate())) collect_variables(network, input, found);
}

// A feature or constraint and the variables that it is about.
struct Term {
  Literal literal;
  double weight = 0.0;  // +infinity: a constraint
  std::vector<VariableId> variables;
};

std::vector<Term> terms_of(const GroundNetwork& network) {
  std::vector<Term> terms;
  const auto add = [&](Literal literal, double weight) {
    Term term{literal, weight, {}};
    collect_variables(network, literal, term.variables);
    std::sort(term.variables.begin(), term.variables.end());
    term.variables.erase(std::unique(term.variables.begin(), term.variables.end()), term.variables.end());
    if (!term.variables.empty()) terms.push_back(std::move(term));
  };
  for (const Feature& feature : network.features()) add(feature.literal, feature.weight);
  for (const Constraint& constraint : network.constraints()) {
    add(constraint.literal, std::numeric_limits<double>::infinity());
  }
  return terms;
}

enum class Role : std::uint8_t { kHidden, kQueried, kOutcome };

// What the outcome depends on, and what is summed out beside it.
struct Frontier {
  std::vector<VariableId> context;  // F
  std::vector<VariableId> local;    // O, and hidden variables beside it
};

double joint_count(const GroundNetwork& network, std::span<const VariableId> variables) {
  double count = 1.0;
  for (const VariableId v : variables) count *= network.value_count(v);
  return count;
}

// Steps through all joint values, the first variable fastest; false after the last.
bool next_values(const GroundNetwork& network, std::span<const VariableId> variables, Values& values) {
  for (const VariableId v : variables) {
    if (++values[v.index()] < network.value_count(v)) return true;
    values[v.index()] = 0;
  }
  return false;
}

// One factor of P(o | F): outcome variables that depend on each other given F, hidden ones summed out.
struct Factor {
  std::vector<std::vector<double>> likelihood;  // [outcome][context value]
};

// Everything that one question needs. Made in steps, each of which can end it with a termination and a message.
class InformationRun {
 public:
  InformationRun(const GroundNetwork& network, std::span<const VariableId> outcome, const InformationOptions& options,
                 Monitor& monitor)
      : network_(network), outcome_(outcome), options_(options), stop_(monitor, options.inference.max_seconds) {}

  Information run() {
    if (check() && find_frontier() && find_context_probabilities() && find_factors()) {
      sum_over_outcomes();
    }
    return std::move(result_);
  }

 private:
  bool fail(Termination termination, std::string message) {
    result_.termination = termination;
    result_.message = std::move(message);
    return false;
  }

  bool check() {
    role_.assign(network_.variable_count(), Role::kHidden);
    for (const QueryTarget& target : network_.queries()) {
      if (target.is_formula) return fail(Termination::kRefused, "the entropy of atoms is asked for, not of formulas");
      role_[network_.variable_of(target.literal.atom()).index()] = Role::kQueried;
    }
    if (!network_.soft_targets().empty()) {
      return fail(Termination::kRefused, "not with Jeffrey evidence: read degrees as virtual evidence");
    }
    for (const VariableId v : outcome_) {
      if (role_[v.index()] == Role::kQueried)
        return fail(Termination::kRefused, "what is queried cannot be the outcome");
      role_[v.index()] = Role::kOutcome;
    }
    return true;
  }

  // Hidden variables beside the outcome are summed out with it where they are few, else they join the frontier.
  bool find_frontier() {
    terms_ = terms_of(network_);
    terms_of_variable_.resize(network_.variable_count());
    for (std::uint32_t t = 0; t < terms_.size(); ++t) {
      for (const VariableId v : terms_[t].variables) terms_of_variable_[v.index()].push_back(t);
    }
    const double limit = static_cast<double>(options_.max_joint);
    frontier_ = reach(true);
    make_groups();
    const bool narrow = std::all_of(groups_.begin(), groups_.end(),
                                    [&](const auto& group) { return joint_count(network_, group) <= limit; });
    if (narrow && joint_count(network_, frontier_.context) <= limit) return true;

    frontier_ = reach(false);
    make_groups();
    std::vector<bool> component(network_.component_count(), false);
    for (const VariableId v : frontier_.context) component[network_.component_of(v).index()] = true;
    for (std::uint32_t v = 0; v < network_.variable_count(); ++v) {
      const VariableId id(v);
      const auto& context = frontier_.context;
      if (role_[v] != Role::kQueried || !component[network_.component_of(id).index()]) continue;
      if (std::find(context.begin(), context.end(), id) == context.end()) frontier_.context.push_back(id);
    }
    const double joint = joint_count(network_, frontier_.context);
    if (joint > limit) {
      return fail(Termination::kTooWide, fmt::format("the outcome depends on {:.3g} joint values at once, more than {}",
                                                     joint, options_.max_joint));
    }
    for (const auto& group : groups_) {
      if (joint_count(network_, group) > limit) {
        return fail(Termination::kTooWide, fmt::format("{:.3g} outcomes depend on each other, more than {}",
                                                       joint_count(network_, group), options_.max_joint));
      }
    }
    return true;
  }

  Frontier reach(bool through_hidden) const {
    Frontier frontier;
    std::vector<bool> seen(network_.variable_count(), false);
    frontier.local.assign(outcome_.begin(), outcome_.end());
    for (const VariableId v : outcome_) seen[v.index()] = true;
    for (std::size_t at = 0; at < frontier.local.size(); ++at) {
      for (const std::uint32_t t : terms_of_variable_[frontier.local[at].index()]) {
        for (const VariableId v : terms_[t].variables) {
          if (seen[v.index()]) continue;
          seen[v.index()] = true;
          const bool absorbed = through_hidden && role_[v.index()] == Role::kHidden;
          (absorbed ? frontier.local : frontier.context).push_back(v);
        }
      }
    }
    return frontier;
  }

  // Local variables that share a term, by a search over terms.
  void make_groups() {
    groups_.clear();
    std::vector<bool> is_local(network_.variable_count(), false), seen(network_.variable_count(), false);
    for (const VariableId v : frontier_.local) is_local[v.index()] = true;
    for (const VariableId start : frontier_.local) {
      if (seen[start.index()]) continue;
      seen[start.index()] = true;
      std::vector<VariableId> group{start};
      for (std::size_t at = 0; at < group.size(); ++at) {
        for (const std::uint32_t t : terms_of_variable_[group[at].index()]) {
          for (const VariableId v : terms_[t].variables) {
            if (!is_local[v.index()] || seen[v.index()]) continue;
            seen[v.index()] = true;
            group.push_back(v);
          }
        }
      }
      groups_.push_back(std::move(group));
    }
  }

  // P(F), by asking for every joint value of the frontier; those of probability 0 are dropped.
  bool find_context_probabilities() {
    const auto& context = frontier_.context;
    Values values(network_.variable_count(), 0);
    do {
      std::uint64_t told = 0;  // the queried part, as a number
      Values own;
      for (const VariableId v : context) {
        own.push_back(values[v.index()]);
        if (role_[v.index()] == Role::kQueried) told = told * network_.value_count(v) + values[v.index()];
      }
      context_values_.push_back(std::move(own));
      told_.push_back(told);
    } while (next_values(network_, context, values));
    if (context.empty()) {
      context_probability_.assign(1, 1.0);
      return true;
    }

    NetworkBuilder builder(network_);
    const std::size_t first = network_.queries().size();
    for (const Values& own : context_values_) {
      std::vector<Literal> parts;
      for (std::size_t i = 0; i < context.size(); ++i) append_value(context[i], own[i], parts);
      builder.add_query({builder.make_and(parts), true, ""});
    }
    InferenceOptions inference = options_.inference;
    inference.max_seconds = std::max(0.0, options_.inference.max_seconds - stop_.seconds());
    const InferenceResult answer = infer(builder.build(), inference, stop_.monitor());
    result_.method = answer.method;
    if (answer.termination != Termination::kCompleted) return fail(answer.termination, answer.message);
    if (answer.marginals.size() < first + context_values_.size()) return fail(Termination::kRefused, kNeedsMarginals);
    double sum = 0.0;
    for (std::size_t i = 0; i < context_values_.size(); ++i) {
      context_probability_.push_back(std::max(0.0, answer.marginals[first + i].probability));
      sum += context_probability_.back();
    }
    if (!(sum > 0.0)) return fail(Termination::kRefused, kNeedsMarginals);
    std::size_t kept = 0;
    for (std::size_t i = 0; i < context_values_.size(); ++i) {
      if (context_probability_[i] <= 0.0) continue;
      context_probability_[kept] = context_probability_[i] / sum;
      context_values_[kept] = context_values_[i];
      told_[kept++] = told_[i];
    }
    context_probability_.resize(kept);
    context_values_.resize(kept);
    told_.resize(kept);
    return true;
  }

  // "This variable has this value" as literals that are all true.
  void append_value(VariableId v, std::uint32_t value, std::vector<Literal>& parts) const {
    const std::uint32_t first = network_.first_atom(v).value;
    if (value < network_.candidate_count(v)) {
      parts.push_back(Literal::atom(AtomId(first + value)));
      return;
    }
    for (std::uint32_t i = 0; i < network_.candidate_count(v); ++i) {
      parts.push_back(Literal::atom(AtomId(first + i), true));
    }
  }

  bool find_factors() {
    for (const auto& group : groups_) {
      if (stop_.reached()) return fail(stop_.reason(), "stopped while outcomes were weighed");
      std::vector<std::uint32_t> terms;
      for (const VariableId v : group) {
        const auto& own = terms_of_variable_[v.index()];
        terms.insert(terms.end(), own.begin(), own.end());
      }
      std::sort(terms.begin(), terms.end());
      terms.erase(std::unique(terms.begin(), terms.end()), terms.end());
      add_factor(group, terms);
    }
    return true;
  }

  void add_factor(const std::vector<VariableId>& group, const std::vector<std::uint32_t>& terms) {
    Factor factor;
    std::unordered_map<std::uint64_t, std::size_t> outcome_of;  // the outcome variables' part of the joint values
    std::vector<std::size_t> outcome_at;                        // by joint value of the group
    Values values(network_.variable_count(), 0);
    do {
      std::uint64_t key = 0;
      for (const VariableId v : group) {
        if (role_[v.index()] == Role::kOutcome) key = key * network_.value_count(v) + values[v.index()];
      }
      outcome_at.push_back(outcome_of.try_emplace(key, outcome_of.size()).first->second);
    } while (next_values(network_, group, values));
    if (outcome_of.size() < 2) return;  // hidden variables only

    factor.likelihood.assign(outcome_of.size(), std::vector<double>(context_values_.size(), 0.0));
    std::vector<double> scores(outcome_at.size());
    for (std::size_t s = 0; s < context_values_.size(); ++s) {
      for (std::size_t i = 0; i < frontier_.context.size(); ++i) {
        values[frontier_.context[i].index()] = context_values_[s][i];
      }
      std::size_t at = 0;
      do {
        scores[at] = 0.0;
        for (const std::uint32_t t : terms) scores[at] += score(terms_[t], values);
        ++at;
      } while (next_values(network_, group, values));
      const double best = *std::max_element(scores.begin(), scores.end());
      if (!std::isfinite(best)) continue;  // a frontier value that sampling believes possible, and that is not
      double sum = 0.0;
      for (double& value : scores) sum += value = std::exp(value - best);
      for (std::size_t i = 0; i < scores.size(); ++i) factor.likelihood[outcome_at[i]][s] += scores[i] / sum;
    }
    if (!says_nothing(factor)) factors_.push_back(std::move(factor));
  }

  double score(const Term& term, const Values& values) const {
    const bool truth = evaluate(network_, term.literal, values);
    if (std::isinf(term.weight)) return truth ? 0.0 : -std::numeric_limits<double>::infinity();
    return truth ? term.weight : 0.0;
  }

  static bool says_nothing(const Factor& factor) {
    return std::all_of(factor.likelihood.begin(), factor.likelihood.end(), [](const std::vector<double>& row) {
      const auto [low, high] = std::minmax_element(row.begin(), row.end());
      return *high - *low <= 1e-13 * *high;
    });
  }

  // `joint`: P(F, o) for one o. Its part of I(Q; O): p(o) KL(P(Q | o) || P(Q)).
  double part(const std::vector<double>& joint) {
    std::fill(told_joint_.begin(), told_joint_.end(), 0.0);
    double mass = 0.0;
    for (std::size_t s = 0; s < joint.size(); ++s) {
      told_joint_[told_[s]] += joint[s];
      mass += joint[s];
    }
    double sum = 0.0;
    for (std::size_t q = 0; q < told_joint_.size(); ++q) {
      if (told_joint_[q] > 0.0) sum += told_joint_[q] * std::log(told_joint_[q] / (mass * told_probability_[q]));
    }
    return std::max(0.0, sum);  // exactly at least 0; rounding may say otherwise
  }

  void sum_over_outcomes() {
    number_told();
    std::vector<std::vector<double>> outcomes{context_probability_};
    // Tables of beliefs stay below 32 MB.
    const std::size_t most =
        std::clamp<std::size_t>((std::size_t{1} << 22) / context_probability_.size(), 1, options_.max_outcomes);
    std::size_t largest = 1;
    for (const Factor& factor : factors_) largest = std::max(largest, factor.likelihood.size());
    const double smallest = kLeftOut / (static_cast<double>(most) * static_cast<double>(largest) *
                                        static_cast<double>(factors_.size() + 1));
    for (const Factor& factor : factors_) {
      if (stop_.reached()) {
        fail(stop_.reason(), "stopped while outcomes were summed");
        return;
      }
      outcomes = multiplied(outcomes, factor, smallest);
      if (outcomes.size() > most) return draw_outcomes();
    }
    result_.outcomes = outcomes.size();
    for (const auto& joint : outcomes) result_.expected_drop += part(joint);
  }

  // The queried parts of the frontier's values get the numbers 0, 1, ...
  void number_told() {
    std::unordered_map<std::uint64_t, std::uint64_t> number;
    for (std::size_t s = 0; s < told_.size(); ++s) {
      told_[s] = number.try_emplace(told_[s], number.size()).first->second;
      if (told_[s] == told_probability_.size()) told_probability_.push_back(0.0);
      told_probability_[told_[s]] += context_probability_[s];
    }
    told_joint_.resize(told_probability_.size());
  }

  // Every outcome so far with every outcome of the factor; those that lead to the same belief become one.
  static std::vector<std::vector<double>> multiplied(const std::vector<std::vector<double>>& outcomes,
                                                     const Factor& factor, double smallest) {
    std::vector<std::vector<double>> result;
    std::unordered_map<std::uint64_t, std::vector<std::size_t>> by_hash;
    for (const auto& joint : outcomes) {
      for (const auto& likelihood : factor.likelihood) {
        std::vector<double> product(joint.size());
        double mass = 0.0;
        for (std::size_t s = 0; s < joint.size(); ++s) mass += product[s] = joint[s] * likelihood[s];
        if (mass < smallest) continue;
        // The hash is coarse and may put equal beliefs apart at a rounding edge: then they are counted apart, which is as right.
        std::uint64_t hash = 0;
        for (const double p : product) {
          hash = (hash ^ static_cast<std::uint64_t>(std::llround(p / mass * 1e6))) * 0x9e3779b97f4a7c15ULL;
          hash ^= hash >> 29;
        }
        auto& candidates = by_hash[hash];
        const auto same = std::find_if(candidates.begin(), candidates.end(),
                                       [&](std::size_t at) { return same_belief(result[at], product); });
        if (same == candidates.end()) {
          candidates.push_back(result.size());
          result.push_back(std::move(product));
        } else {
          for (std::size_t s = 0; s < product.size(); ++s) result[*same][s] += product[s];
        }
      }
    }
    return result;
  }

  static bool same_belief(const std::vector<double>& a, const std::vector<double>& b) {
    const double mass_a = std::accumulate(a.begin(), a.end(), 0.0), mass_b = std::accumulate(b.begin(), b.end(), 0.0);
    for (std::size_t s = 0; s < a.size(); ++s) {
      const double p = a[s] / mass_a, q = b[s] / mass_b;
      if (std::abs(p - q) > kSameBelief * std::max(p, q)) return false;
    }
    return true;
  }

  static std::size_t choose(Rng& rng, std::size_t count, const auto& weight_of) {
    double left = rng.uniform();
    for (std::size_t i = 0; i + 1 < count; ++i) {
      left -= weight_of(i);
      if (left < 0.0) return i;
    }
    return count - 1;
  }

  void draw_outcomes() {
    Rng rng(options_.inference.seed, 0x696e666f726dULL);  // a stream of its own
    double sum = 0.0, squares = 0.0;
    std::vector<double> joint;
    // At most about 2e9 multiplications.
    const double work = static_cast<double>(factors_.size()) * static_cast<double>(context_probability_.size());
    const auto draws = static_cast<std::uint32_t>(
        std::clamp(2e9 / work, 1000.0, std::max(1000.0, static_cast<double>(options_.draws))));
    std::uint32_t draw = 0;
    for (; draw < draws; ++draw) {
      if (draw % 64 == 0 && stop_.reached()) break;
      const std::size_t truth =
          choose(rng, context_probability_.size(), [&](std::size_t s) { return context_probability_[s]; });
      joint = context_probability_;
      for (const Factor& factor : factors_) {
        const std::size_t o =
            choose(rng, factor.likelihood.size(), [&](std::size_t i) { return factor.likelihood[i][truth]; });
        double largest = 0.0;
        for (std::size_t s = 0; s < joint.size(); ++s) {
          joint[s] *= factor.likelihood[o][s];
          largest = std::max(largest, joint[s]);
        }
        if (largest > 0.0) {
          for (double& p : joint) p /= largest;  // many factors would underflow
        }
      }
      const double mass = std::accumulate(joint.begin(), joint.end(), 0.0);
      if (!(mass > 0.0)) continue;  // rounding drew an outcome of probability 0
      for (double& p : joint) p /= mass;
      const double divergence = part(joint);
      sum += divergence;
      squares += divergence * divergence;
    }
    if (draw < 2) {
      fail(stop_.reason(), "stopped before outcomes were drawn");
      return;
    }
    const double n = draw;
    result_.termination = draw < draws ? stop_.reason() : Termination::kCompleted;
    result_.outcomes = draw;
    result_.expected_drop = sum / n;
    result_.mcse = std::sqrt(std::max(0.0, squares / n - sum / n * (sum / n)) / (n - 1.0));
  }

  const GroundNetwork& network_;
  std::span<const VariableId> outcome_;
  const InformationOptions& options_;
  StopCondition stop_;
  Information result_;
  std::vector<Role> role_;  // by variable
  std::vector<Term> terms_;
  std::vector<std::vector<std::uint32_t>> terms_of_variable_;
  Frontier frontier_;
  std::vector<std::vector<VariableId>> groups_;
  // By joint value of the frontier that has a positive probability:
  std::vector<Values> context_values_;
  std::vector<double> context_probability_;
  std::vector<std::uint64_t> told_;  // the queried part
  std::vector<Factor> factors_;
  std::vector<double> told_probability_, told_joint_;  // by queried part
};

}  // namespace

Information expected_information(const GroundNetwork& network, std::span<const VariableId> outcome,
                                 const InformationOptions& options, Monitor& monitor) {
  return InformationRun(network, outcome, options, monitor).run();
}

}  // namespace sherlog
