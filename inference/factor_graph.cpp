#include "inference/factor_graph.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <tuple>
#include <unordered_map>
#include <utility>

#include "inference/at_most_one.h"
#include "inference/factor_graph_builder.h"
#include "inference/gate_support.h"
#include "inference/propagation.h"

namespace sherlog {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr std::uint64_t kSharedJoint = 4096;  // one whose variables have many formulas
constexpr std::uint32_t kNone = FactorGraphBuilder::kNone;

class Compiler {
 public:
  Compiler(const GroundNetwork& network, ComponentId component, const FactorGraphOptions& options)
      : network_(network), component_(component), options_(options), propagation_(network, component) {}

  FactorGraph run() {
    if (!propagation_.run()) {
      graph_.possible = false;
      graph_.conflict = propagation_.conflict();
      return std::move(graph_);
    }
    bind_variables();
    if (!collect_gates()) return std::move(graph_);
    add_groups();
    if (!stopped()) collect_roots();
    for (const Root& root : roots_) {
      if (graph_.table_bytes > options_.max_bytes || out_of_time()) break;
      add_root(root);
    }
    if (stopped()) return std::move(graph_);
    if (options_.with_queries) {
      for (const std::uint32_t q : network_.component_queries(component_)) {
        graph_.queries.push_back(test_of(network_.queries()[q].literal));
      }
    }
    graph_.too_large = graph_.table_bytes > options_.max_bytes;
    builder_.make_sweep();
    return std::move(graph_);
  }

 private:
  using Gate = GateSupports::Gate;
  static constexpr std::uint32_t kFormulasPerStopCheck = 4096;

  bool stopped() { return graph_.stopped = graph_.stopped || (options_.stop != nullptr && options_.stop->reached()); }
  // Asks the clock now and then.
  bool out_of_time() { return ++since_check_ % kFormulasPerStopCheck == 0 && stopped(); }

  // --- variables

  void bind_variables() {
    for (const VariableId v : network_.component_variables(component_)) {
      FactorGraph::Binding binding;
      for (std::uint32_t value = 0; value < network_.value_count(v); ++value) {
        if (propagation_.allowed(v, value)) binding.values.push_back(value);
      }
      if (binding.values.size() > 1) {
        binding.variable = builder_.add_variable(static_cast<std::uint32_t>(binding.values.size()), v.value);
      }
      supports_.bind(v, static_cast<std::uint32_t>(graph_.bindings.size()));
      add_bias(v, binding);
      graph_.bindings.push_back(std::move(binding));
    }
  }

  void add_bias(VariableId v, const FactorGraph::Binding& binding) {
    if (options_.atom_bias.empty()) return;
    std::vector<double> table;
    bool any = false;
    for (const std::uint32_t value : binding.values) {
      const std::size_t atom = network_.first_atom(v).index() + value;
      table.push_back(value < network_.candidate_count(v) ? options_.atom_bias[atom] : 0.0);
      any = any || table.back() != 0.0;
    }
    if (!any) return;
    if (binding.variable == kNone) {
      builder_.add_constant(table[0], kNone);
    } else {
      builder_.add_table({binding.variable}, table);
    }
  }

  bool collect_gates() {
    std::vector<Literal> roots;
    for (const std::uint32_t f : network_.component_features(component_)) {
      roots.push_back(network_.features()[f].literal);
    }
    for (const std::uint32_t c : network_.component_constraints(component_)) {
      roots.push_back(network_.constraints()[c].literal);
    }
    if (options_.with_queries) {
      for (const std::uint32_t q : network_.component_queries(component_)) {
        roots.push_back(network_.queries()[q].literal);
      }
    }
    const bool finished = supports_.collect(roots, [&] { return out_of_time(); });
    tests_.resize(supports_.gates().size());
    return finished && !stopped();
  }

  // --- roots: what scores or must hold

  struct Root {
    Literal literal;
    double when_true = 0.0, when_false = 0.0;
    std::uint32_t recorded = kNone;  // a feature to be noted, not weighed; then when_true = 1 and when_false = 0
  };

  void collect_roots() {
    for (const Gate& gate : supports_.gates()) {
      if (!gate.demanded || std::binary_search(covered_gates_.begin(), covered_gates_.end(), gate.id.value)) continue;
      const bool value = gate.truth == Truth::kTrue;
      roots_.push_back({Literal::gate(gate.id), value ? 0.0 : -kInfinity, value ? -kInfinity : 0.0});
    }
    for (const std::uint32_t f : network_.component_features(component_)) {
      const Feature& feature = network_.features()[f];
      const Truth t = supports_.truth(feature.literal);
      const std::uint32_t recorded = options_.keep_features ? f : kNone;
      const double weight = options_.keep_features ? 1.0 : feature.weight;
      if (t == Truth::kTrue) builder_.add_constant(weight, recorded);
      if (t == Truth::kOpen) roots_.push_back({feature.literal, weight, 0.0, recorded});
    }
    for (const Root& root : roots_) {
      if (!root.literal.is_gate()) continue;
      const Gate& gate = supports_.gate(root.literal.gate());
      if (!gate.wide && gate.joint > options_.small_joint) ++formulas_on_[gate.support];
    }
  }

  bool one_table(const Gate& gate) const {
    if (gate.wide) return false;
    if (gate.joint <= options_.small_joint || gate.support.size() <= 2) return true;
    const auto found = formulas_on_.find(gate.support);
    return gate.joint <= kSharedJoint && found != formulas_on_.end() && gate.joint <= 16 * found->second;
  }

  void add_root(const Root& root) {
    if (root.literal.is_atom()) {
      builder_.add_unary(test_of(root.literal), root.when_true, root.when_false, root.recorded);
      return;
    }
    const Gate& gate = supports_.gate(root.literal.gate());
    const double when_true = root.literal.negated() ? root.when_false : root.when_true;
    const double when_false = root.literal.negated() ? root.when_true : root.when_false;
    if (one_table(gate)) {
      if (add_disjunction(gate, when_true, when_false, root.recorded)) return;
      const BitTable bits = supports_.truth_table(gate);
      std::vector<double> table(gate.joint);
      for (std::size_t i = 0; i < table.size(); ++i) table[i] = bit_of(bits, i) ? when_true : when_false;
      builder_.add_table(gate.support, table, root.recorded);
      return;
    }
    std::vector<ValueTest> tests = input_tests(gate.id);
    if (network_.gate_kind(gate.id) == GateKind::kIff) {
      builder_.add_binary(
          tests[0], tests[1], [&](bool a, bool b) { return a == b ? when_true : when_false; }, root.recorded);
      return;
    }
    if (network_.gate_kind(gate.id) == GateKind::kAtMostOne) {
      builder_.add_unary(builder_.at_most_one_test(std::move(tests)), when_true, when_false, root.recorded);
      return;
    }
    const bool always = !join_tests(tests);
    if (always) {
      builder_.add_constant(when_true, root.recorded);
    } else if (tests.empty()) {
      builder_.add_constant(when_false, root.recorded);
    } else {
      const ValueTest last = tests.back();
      tests.pop_back();
      if (tests.empty()) {
        builder_.add_unary(last, when_true, when_false, root.recorded);
      } else {
        builder_.add_binary(
            builder_.chain(tests, false), last, [&](bool a, bool b) { return a || b ? when_true : when_false; },
            root.recorded);
      }
    }
  }

  // An OR of atoms is false on a box: some values of each variable. Where that is the smaller side, only it is visited.
  // A pair of things that can each be one of 20 makes 400 formulas of 400 joint values: they take 400 steps, not 160,000.
  bool add_disjunction(const Gate& gate, double when_true, double when_false, std::uint32_t recorded) {
    if (network_.gate_kind(gate.id) != GateKind::kOr || std::isinf(when_true)) return false;
    const auto& scope = gate.support;
    std::vector<std::vector<std::uint8_t>> accepted(scope.size());
    for (const Literal input : network_.gate_inputs(gate.id)) {
      if (supports_.truth(input) != Truth::kOpen) continue;  // false, or the gate would be decided
      if (input.is_gate()) return false;
      const ValueTest test = test_of(input);
      auto& joined = accepted[static_cast<std::size_t>(std::ranges::lower_bound(scope, test.variable) - scope.begin())];
      joined.resize(test.accepted.size());
      for (std::size_t k = 0; k < joined.size(); ++k) joined[k] |= test.accepted[k];
    }
    std::vector<std::uint32_t> box{0};  // entries of the table where the OR is false, increasing
    for (const auto& joined : accepted) {
      std::vector<std::uint32_t> wider;
      for (const std::uint32_t entry : box) {
        for (std::uint32_t k = 0; k < joined.size(); ++k) {
          if (joined[k] == 0) wider.push_back(entry * static_cast<std::uint32_t>(joined.size()) + k);
        }
      }
      box = std::move(wider);
    }
    if (2 * box.size() >= gate.joint) return false;
    const std::uint32_t number = builder_.table_over(scope, gate.joint);
    if (recorded != kNone) {
      // The feature is 1 where its literal is true: the gate or its negation.
      builder_.add_feature({recorded, number, when_true != 0.0, std::move(box)});
      return true;
    }
    std::vector<double>& table = graph_.tables[number];
    if (when_true != 0.0) {
      for (double& value : table) value += when_true;
    }
    for (const std::uint32_t entry : box) table[entry] += when_false - when_true;
    return true;
  }

  // --- tests: literals as "this variable's value is among these"

  ValueTest test_of(Literal literal) {
    const Truth t = supports_.truth(literal);
    if (t != Truth::kOpen) return ValueTest::constant(t == Truth::kTrue);
    ValueTest plain;
    if (literal.is_atom()) {
      plain = supports_.value_test(literal.atom());
    } else {
      make_tests_below(literal.gate());
      plain = *test(literal.gate());
    }
    return literal.negated() ? FactorGraphBuilder::negation(plain) : plain;
  }

  std::optional<ValueTest>& test(GateId g) { return tests_[supports_.number(g)]; }

  // Makes the tests of a gate and of whatever it needs, without recursion.
  void make_tests_below(GateId root) {
    std::vector<GateId> stack{root};
    while (!stack.empty()) {
      const GateId g = stack.back();
      if (test(g)) {
        stack.pop_back();
        continue;
      }
      const std::size_t before = stack.size();
      if (!is_function(supports_.gate(g))) {
        for (const Literal leaf : leaves(g)) {
          if (leaf.is_gate() && !test(leaf.gate())) stack.push_back(leaf.gate());
        }
      }
      if (stack.size() > before) continue;
      test(g) = make_test(g);
      stack.pop_back();
    }
  }

  // Open inputs; those of an OR with ORs among its inputs are taken from these.
  std::vector<Literal> leaves(GateId root) {
    std::vector<Literal> out;
    std::vector<GateId> stack{root};
    std::unordered_map<std::uint32_t, bool> seen;
    const bool is_or = network_.gate_kind(root) == GateKind::kOr;
    while (!stack.empty()) {
      const GateId g = stack.back();
      stack.pop_back();
      for (const Literal input : network_.gate_inputs(g)) {
        if (supports_.truth(input) != Truth::kOpen) {
          if (!is_or) out.push_back(input);
          continue;
        }
        const bool nested =
            is_or && input.is_gate() && !input.negated() && network_.gate_kind(input.gate()) == GateKind::kOr;
        if (!nested) {
          out.push_back(input);
        } else if (seen.emplace(input.gate().value, true).second) {
          stack.push_back(input.gate());
        }
      }
    }
    return out;
  }

  std::vector<ValueTest> input_tests(GateId g) {
    std::vector<ValueTest> tests;
    for (const Literal leaf : leaves(g)) tests.push_back(test_of(leaf));
    return tests;
  }

  bool is_function(const Gate& gate) const {
    return !gate.wide && (gate.joint <= options_.small_joint / 2 || gate.support.size() == 1);
  }

  ValueTest make_test(GateId g) {
    const Gate& gate = supports_.gate(g);
    if (is_function(gate)) return function_test(gate);
    std::vector<ValueTest> tests = input_tests(g);
    if (network_.gate_kind(g) == GateKind::kIff)
      return builder_.combined(tests[0], tests[1], FactorGraphBuilder::Operation::kIff);
    if (network_.gate_kind(g) == GateKind::kAtMostOne) return builder_.at_most_one_test(std::move(tests));
    if (!join_tests(tests)) return ValueTest::constant(true);
    if (tests.empty()) return ValueTest::constant(false);
    return builder_.chain(tests, false);
  }

  // The truth of a gate over few joint values: a test where it depends on one variable, else an auxiliary variable.
  ValueTest function_test(const Gate& gate) {
    const BitTable bits = supports_.truth_table(gate);
    std::vector<std::uint8_t> truths(gate.joint);
    for (std::size_t i = 0; i < truths.size(); ++i) truths[i] = bit_of(bits, i) ? 1 : 0;
    if (gate.support.size() == 1) return FactorGraphBuilder::simplified({gate.support[0], truths});
    std::uint32_t key = 0;
    for (const std::uint32_t v : gate.support) key = std::max(key, builder_.key(v));
    ValueTest aux = builder_.auxiliary(key);
    std::vector<std::uint32_t> scope = gate.support;
    scope.push_back(aux.variable);
    std::vector<double> table;
    for (const std::uint8_t t : truths) {
      table.push_back(t != 0 ? -kInfinity : 0.0);
      table.push_back(t != 0 ? 0.0 : -kInfinity);
    }
    builder_.add_table(scope, table);
    return aux;
  }

  // Joins tests of the same variable and whole at-most-one groups, drops constants, sorts by the variables' order.
  // False: the OR is true for certain.
  bool join_tests(std::vector<ValueTest>& tests) {
    std::map<std::uint32_t, ValueTest> by_variable;
    for (const ValueTest& test : tests) {
      if (test.is_constant()) {
        if (test.value()) return false;
        continue;
      }
      const auto [it, fresh] = by_variable.emplace(test.variable, test);
      if (fresh) continue;
      for (std::size_t k = 0; k < test.accepted.size(); ++k) it->second.accepted[k] |= test.accepted[k];
    }
    replace_groups(by_variable);
    tests.clear();
    for (auto& [variable, test] : by_variable) {
      ValueTest plain = FactorGraphBuilder::simplified(std::move(test));
      if (!plain.is_constant()) {
        tests.push_back(std::move(plain));
      } else if (plain.value()) {
        return false;
      }
    }
    std::stable_sort(tests.begin(), tests.end(), [&](const ValueTest& a, const ValueTest& b) {
      return builder_.key(a.variable) < builder_.key(b.variable);
    });
    return true;
  }

  void replace_groups(std::map<std::uint32_t, ValueTest>& by_variable) {
    std::vector<std::uint32_t> candidates;
    for (const auto& [variable, test] : by_variable) {
      const auto found = groups_starting_at_.find(variable);
      if (found != groups_starting_at_.end())
        candidates.insert(candidates.end(), found->second.begin(), found->second.end());
    }
    for (const std::uint32_t g : candidates) {
      const Group& group = groups_[g];
      const bool contained = std::all_of(group.tests.begin(), group.tests.end(), [&](const ValueTest& test) {
        const auto found = by_variable.find(test.variable);
        return found != by_variable.end() && found->second == test;
      });
      if (!contained) continue;
      for (const ValueTest& test : group.tests) by_variable.erase(test.variable);
      by_variable.emplace(group.any.variable, group.any);
    }
  }

  // --- at-most-one groups

  struct Group {
    std::vector<ValueTest> tests;
    ValueTest any;
  };

  void add_groups() {
    const AtMostOne found = find_at_most_one(network_, component_, options_.stop);
    for (const std::uint32_t c : found.covered)
      covered_gates_.push_back(network_.constraints()[c].literal.gate().value);
    std::sort(covered_gates_.begin(), covered_gates_.end());
    for (const auto& literals : found.groups) {
      std::vector<ValueTest> tests;
      for (const auto& [variable, value] : literals) {
        const ValueTest test = supports_.value_test(variable, value);
        if (test.is_constant()) continue;  // a true one has made the others false by propagation
        if (!tests.empty() && tests.back().variable == test.variable) {
          for (std::size_t k = 0; k < test.accepted.size(); ++k) tests.back().accepted[k] |= test.accepted[k];
        } else {
          tests.push_back(test);
        }
      }
      // A variable with all its values in the group leaves nothing to the others.
      for (ValueTest& test : tests) test = FactorGraphBuilder::simplified(std::move(test));
      std::stable_partition(tests.begin(), tests.end(), [](const ValueTest& test) { return test.is_constant(); });
      groups_.push_back({std::move(tests), {}});
    }
    for (std::uint32_t g = 0; g < groups_.size() && !out_of_time(); ++g) {
      Group& group = groups_[g];
      if (group.tests.size() < 2) continue;
      group.any = builder_.chain(group.tests, true);
      if (!group.any.is_constant()) groups_starting_at_[group.tests[0].variable].push_back(g);
    }
  }

  const GroundNetwork& network_;
  const ComponentId component_;
  const FactorGraphOptions& options_;
  Propagation propagation_;
  FactorGraphBuilder builder_;
  FactorGraph& graph_ = builder_.graph;
  GateSupports supports_{network_, propagation_, graph_};
  std::vector<std::optional<ValueTest>> tests_;  // by gate, in the order of supports_
  std::vector<Root> roots_;
  std::unordered_map<std::vector<std::uint32_t>, std::uint64_t, WordsHash> formulas_on_;
  std::vector<Group> groups_;
  std::unordered_map<std::uint32_t, std::vector<std::uint32_t>> groups_starting_at_;
  std::vector<std::uint32_t> covered_gates_;
  std::uint32_t since_check_ = 0;
};

}  // namespace

FactorGraph compile_factor_graph(const GroundNetwork& network, ComponentId component,
                                 const FactorGraphOptions& options) {
  return Compiler(network, component, options).run();
}

}  // namespace sherlog
