#include "inference/ergodicity.h"

#include <algorithm>
#include <map>
#include <numeric>

#include "inference/propagation.h"
#include "inference/world.h"

namespace sherlog {
namespace {

constexpr std::size_t kLargestSearch = std::size_t{1} << 16;  // joint values of a group

constexpr std::uint64_t kStepsPerStopCheck = std::uint64_t{1} << 20;

// False where the budget does not allow so many more steps.
bool spend(ErgodicityBudget& budget, std::uint64_t steps) {
  if (budget.steps < steps) {
    budget.steps = 0;
    return false;
  }
  const std::uint64_t before = budget.steps;
  budget.steps -= steps;
  if (budget.stop != nullptr && before / kStepsPerStopCheck != budget.steps / kStepsPerStopCheck &&
      budget.stop->reached())
    budget.steps = 0;
  return true;
}

// Adds the variables below a literal; false where the budget ends.
bool collect_variables(const GroundNetwork& network, Literal root, std::vector<VariableId>& out,
                       ErgodicityBudget& budget) {
  std::vector<Literal> stack{root};
  while (!stack.empty()) {
    const Literal literal = stack.back();
    stack.pop_back();
    if (literal.is_atom()) {
      out.push_back(network.variable_of(literal.atom()));
      continue;
    }
    const auto inputs = network.gate_inputs(literal.gate());
    if (!spend(budget, inputs.size())) return false;
    stack.insert(stack.end(), inputs.begin(), inputs.end());
  }
  return true;
}

class Group {
 public:
  Group(const GroundNetwork& network, const Propagation& propagation, ErgodicityBudget& budget)
      : network_(network), propagation_(propagation), budget_(budget) {}
  std::vector<std::uint32_t> constraints;

  // After connected(): whether the budget was enough to see the variables, and those that are open.
  bool has_variables() const { return !allowed_.empty(); }
  std::vector<VariableId> open_variables() const {
    std::vector<VariableId> open;
    for (std::size_t i = 0; i < allowed_.size(); ++i) {
      if (allowed_[i].size() > 1) open.push_back(variables_[i]);
    }
    return open;
  }

  bool connected() {
    for (std::uint32_t c : constraints) {
      if (!collect_variables(network_, network_.constraints()[c].literal, variables_, budget_)) return false;
    }
    const std::size_t mentioned = variables_.size();
    std::ranges::sort(variables_);
    variables_.erase(std::unique(variables_.begin(), variables_.end()), variables_.end());
    for (VariableId v : variables_) {
      std::vector<std::uint32_t> values;
      for (std::uint32_t i = 0; i < network_.value_count(v); ++i) {
        if (propagation_.allowed(v, i)) values.push_back(i);
      }
      allowed_.push_back(std::move(values));
    }
    return has_common_refuge() || search_connects(mentioned);
  }

 private:
  bool evaluate(Literal literal, const std::vector<std::uint32_t>& choice) const {
    if (literal.is_atom()) {
      const auto position = static_cast<std::size_t>(
          std::ranges::lower_bound(variables_, network_.variable_of(literal.atom())) - variables_.begin());
      return (allowed_[position][choice[position]] == network_.value_of(literal.atom())) != literal.negated();
    }
    std::uint32_t count = 0;
    for (Literal input : network_.gate_inputs(literal.gate())) count += evaluate(input, choice) ? 1u : 0u;
    return gate_truth(network_.gate_kind(literal.gate()), count) != literal.negated();
  }

  // Clauses only: a value for each variable that satisfies every literal on it. At-most-one gates count as their pairs.
  bool has_common_refuge() const {
    std::vector<std::vector<bool>> good;
    for (const auto& values : allowed_) good.emplace_back(values.size(), true);
    const auto require = [&](Literal literal, bool truth) {
      const auto position = static_cast<std::size_t>(
          std::ranges::lower_bound(variables_, network_.variable_of(literal.atom())) - variables_.begin());
      const std::uint32_t value = network_.value_of(literal.atom());
      for (std::size_t i = 0; i < allowed_[position].size(); ++i) {
        if (((allowed_[position][i] == value) != literal.negated()) != truth) good[position][i] = false;
      }
    };
    for (std::uint32_t c : constraints) {
      const Literal literal = network_.constraints()[c].literal;
      if (literal.is_atom()) continue;  // propagation has settled it
      const GateKind kind = network_.gate_kind(literal.gate());
      if (literal.negated() || kind == GateKind::kIff) return false;
      // A formula that holds whatever its open variables are asks nothing of them.
      if (propagation_.truth(literal) == Truth::kTrue && kind == GateKind::kOr &&
          std::ranges::any_of(network_.gate_inputs(literal.gate()),
                              [&](Literal l) { return propagation_.truth(l) == Truth::kTrue; })) {
        continue;
      }
      for (Literal input : network_.gate_inputs(literal.gate())) {
        if (input.is_gate()) return false;
        if (propagation_.truth(input) == Truth::kOpen) require(input, kind == GateKind::kOr);
      }
    }
    return std::ranges::all_of(good,
                               [](const auto& values) { return std::ranges::find(values, true) != values.end(); });
  }

  // `mentioned`: how many atoms the formulas have together.
  bool search_connects(std::size_t mentioned) const {
    std::size_t total = 1;
    for (const auto& values : allowed_) {
      total *= std::max<std::size_t>(values.size(), 1);
      if (total > kLargestSearch) return false;
    }
    if (!spend(budget_, total * (mentioned + allowed_.size()))) return false;
    std::vector<bool> possible(total), reached(total);
    std::vector<std::uint32_t> choice(variables_.size(), 0);
    std::size_t count = 0, start = 0;
    for (std::size_t state = 0; state < total; ++state) {
      decode(state, choice);
      possible[state] = std::ranges::all_of(
          constraints, [&](std::uint32_t c) { return evaluate(network_.constraints()[c].literal, choice); });
      if (possible[state]) {
        ++count;
        start = state;
      }
    }
    if (count <= 1) return true;
    std::vector<std::size_t> stack{start};
    reached[start] = true;
    std::size_t seen = 1;
    while (!stack.empty()) {
      const std::size_t state = stack.back();
      stack.pop_back();
      std::size_t stride = 1;
      for (const auto& values : allowed_) {
        const std::size_t digit = state / stride % values.size();
        for (std::size_t i = 0; i < values.size(); ++i) {
          const std::size_t other = state + (i - digit) * stride;
          if (possible[other] && !reached[other]) {
            reached[other] = true;
            ++seen;
            stack.push_back(other);
          }
        }
        stride *= values.size();
      }
    }
    return seen == count;
  }

  void decode(std::size_t state, std::vector<std::uint32_t>& choice) const {
    for (std::size_t i = 0; i < choice.size(); ++i) {
      choice[i] = static_cast<std::uint32_t>(state % allowed_[i].size());
      state /= allowed_[i].size();
    }
  }

  const GroundNetwork& network_;
  const Propagation& propagation_;
  ErgodicityBudget& budget_;
  std::vector<VariableId> variables_;
  std::vector<std::vector<std::uint32_t>> allowed_;
};

}  // namespace

std::optional<std::vector<std::vector<VariableId>>> locked_groups(const GroundNetwork& network, ComponentId component,
                                                                  ErgodicityBudget& budget) {
  std::vector<std::vector<VariableId>> locked;
  const auto constraints = network.component_constraints(component);
  Propagation propagation(network, constraints);
  if (!propagation.run()) return locked;  // no world at all: others will say so
  // Groups: constraints that share an open variable.
  std::map<VariableId, std::uint32_t> group_of_variable;
  std::vector<std::uint32_t> parent(constraints.size());
  std::iota(parent.begin(), parent.end(), 0u);
  const auto root = [&](std::uint32_t c) {
    while (parent[c] != c) c = parent[c] = parent[parent[c]];
    return c;
  };
  std::vector<VariableId> variables;
  for (std::uint32_t i = 0; i < constraints.size(); ++i) {
    variables.clear();
    if (!collect_variables(network, network.constraints()[constraints[i]].literal, variables, budget)) {
      return std::nullopt;
    }
    for (VariableId v : variables) {
      std::uint32_t open = 0;
      for (std::uint32_t k = 0; k < network.value_count(v); ++k) open += propagation.allowed(v, k) ? 1u : 0u;
      if (open < 2) continue;
      const auto [found, is_new] = group_of_variable.try_emplace(v, i);
      if (!is_new) parent[root(i)] = root(found->second);
    }
  }
  std::map<std::uint32_t, Group> groups;
  for (std::uint32_t i = 0; i < constraints.size(); ++i) {
    groups.try_emplace(root(i), network, propagation, budget).first->second.constraints.push_back(constraints[i]);
  }
  for (auto& [first, group] : groups) {
    if (group.connected()) continue;
    if (!group.has_variables()) return std::nullopt;
    locked.push_back(group.open_variables());
  }
  return locked;
}

bool single_moves_reach_every_world(const GroundNetwork& network, ComponentId component, ErgodicityBudget& budget) {
  const auto locked = locked_groups(network, component, budget);
  return locked && locked->empty();
}

}  // namespace sherlog
