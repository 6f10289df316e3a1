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
#include "inference/propagation.h"

namespace sherlog {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr std::uint64_t kPairJoint = 65536;  // a formula over two variables with so many joint values becomes one table
constexpr std::uint64_t kSharedJoint = 4096;  // one whose variables have many formulas
constexpr std::uint32_t kNone = FactorGraphBuilder::kNone;

// Truth for each joint value of a scope, 64 to a word.
using BitTable = std::vector<std::uint64_t>;

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
    collect_gates();
    if (!stopped()) add_groups();
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
      binding_of_.emplace(v.value, static_cast<std::uint32_t>(graph_.bindings.size()));
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

  const FactorGraph::Binding& binding(VariableId v) const { return graph_.bindings[binding_of_.at(v.value)]; }

  ValueTest value_test(VariableId v, std::uint32_t value) const {
    const FactorGraph::Binding& b = binding(v);
    const auto found = std::lower_bound(b.values.begin(), b.values.end(), value);
    if (found == b.values.end() || *found != value) return ValueTest::constant(false);
    if (b.variable == kNone) return ValueTest::constant(true);
    ValueTest test{b.variable, std::vector<std::uint8_t>(b.values.size(), 0)};
    test.accepted[static_cast<std::size_t>(found - b.values.begin())] = 1;
    return test;
  }

  // --- gates of the component: constants and supports

  struct GateInfo {
    GateId id;
    Truth truth = Truth::kOpen;          // by propagation, or as its inputs say
    bool demanded = false;               // propagation says so, its inputs do not: to be enforced
    bool wide = false;                   // too many joint values to list: `support` is not kept
    std::vector<std::uint32_t> support;  // variables of the graph, sorted
    std::uint64_t joint = 1;
    std::optional<ValueTest> test;
  };

  void collect_gates() {
    std::vector<std::uint32_t> stack;
    const auto push = [&](Literal literal) {
      if (literal.is_gate() && local_gate_.emplace(literal.gate().value, 0).second)
        stack.push_back(literal.gate().value);
    };
    for (const std::uint32_t f : network_.component_features(component_)) push(network_.features()[f].literal);
    for (const std::uint32_t c : network_.component_constraints(component_)) push(network_.constraints()[c].literal);
    if (options_.with_queries) {
      for (const std::uint32_t q : network_.component_queries(component_)) push(network_.queries()[q].literal);
    }
    std::vector<std::uint32_t> ids;
    while (!stack.empty() && !out_of_time()) {
      const std::uint32_t g = stack.back();
      stack.pop_back();
      ids.push_back(g);
      for (const Literal input : network_.gate_inputs(GateId(g))) push(input);
    }
    if (stopped()) return;
    std::sort(ids.begin(), ids.end());  // inputs before gates
    gates_.reserve(ids.size());
    for (const std::uint32_t g : ids) {
      if (out_of_time()) return;
      local_gate_[g] = static_cast<std::uint32_t>(gates_.size());
      GateInfo info;
      info.id = GateId(g);
      look_at(info);
      gates_.push_back(std::move(info));
    }
  }

  GateInfo& info(GateId g) { return gates_[local_gate_.at(g.value)]; }

  Truth truth(Literal literal) {
    if (literal.is_constant()) return literal.negated() ? Truth::kFalse : Truth::kTrue;
    Truth plain = Truth::kOpen;
    if (literal.is_gate()) {
      plain = info(literal.gate()).truth;
    } else {
      const ValueTest test = value_test(network_.variable_of(literal.atom()), network_.value_of(literal.atom()));
      if (test.is_constant()) plain = test.value() ? Truth::kTrue : Truth::kFalse;
    }
    if (plain == Truth::kOpen) return plain;
    return (plain == Truth::kTrue) != literal.negated() ? Truth::kTrue : Truth::kFalse;
  }

  // Truth by the inputs' truths.
  Truth derived(GateId g) {
    const auto inputs = network_.gate_inputs(g);
    if (network_.gate_kind(g) == GateKind::kIff) {
      const Truth a = truth(inputs[0]), b = truth(inputs[1]);
      if (a == Truth::kOpen || b == Truth::kOpen) return Truth::kOpen;
      return a == b ? Truth::kTrue : Truth::kFalse;
    }
    std::uint32_t satisfied = 0, open = 0;
    for (const Literal input : inputs) {
      const Truth t = truth(input);
      if (t == Truth::kTrue) ++satisfied;
      if (t == Truth::kOpen) ++open;
    }
    // Both kinds are monotone in the number of true inputs.
    const bool least = gate_truth(network_.gate_kind(g), satisfied),
               most = gate_truth(network_.gate_kind(g), satisfied + open);
    if (least != most) return Truth::kOpen;
    return least ? Truth::kTrue : Truth::kFalse;
  }

  void look_at(GateInfo& gate) {
    gate.truth = derived(gate.id);
    if (gate.truth != Truth::kOpen) return;
    gate.truth = propagation_.truth(Literal::gate(gate.id));
    gate.demanded = gate.truth != Truth::kOpen;
    for (const Literal input : network_.gate_inputs(gate.id)) {
      if (truth(input) != Truth::kOpen) continue;
      if (input.is_gate()) {
        const GateInfo& child = info(input.gate());
        gate.wide = gate.wide || child.wide;
        if (gate.wide) break;
        extend(gate, child.support);
      } else {
        const std::uint32_t variable = binding(network_.variable_of(input.atom())).variable;
        extend(gate, {&variable, 1});
      }
      if (gate.wide) break;
    }
    if (gate.wide) gate.support.clear();
  }

  void extend(GateInfo& gate, std::span<const std::uint32_t> variables) {
    for (const std::uint32_t v : variables) {
      const auto place = std::lower_bound(gate.support.begin(), gate.support.end(), v);
      if (place != gate.support.end() && *place == v) continue;
      gate.support.insert(place, v);
      gate.joint *= graph_.cardinalities[v];
      if (gate.joint > kPairJoint) {
        gate.wide = true;
        return;
      }
    }
  }

  // --- roots: what scores or must hold

  struct Root {
    Literal literal;
    double when_true = 0.0, when_false = 0.0;
    std::uint32_t recorded = kNone;  // a feature to be noted, not weighed; then when_true = 1 and when_false = 0
  };

  void collect_roots() {
    for (GateInfo& gate : gates_) {
      if (!gate.demanded || std::binary_search(covered_gates_.begin(), covered_gates_.end(), gate.id.value)) continue;
      const bool value = gate.truth == Truth::kTrue;
      roots_.push_back({Literal::gate(gate.id), value ? 0.0 : -kInfinity, value ? -kInfinity : 0.0});
    }
    for (const std::uint32_t f : network_.component_features(component_)) {
      const Feature& feature = network_.features()[f];
      const Truth t = truth(feature.literal);
      const std::uint32_t recorded = options_.keep_features ? f : kNone;
      const double weight = options_.keep_features ? 1.0 : feature.weight;
      if (t == Truth::kTrue) builder_.add_constant(weight, recorded);
      if (t == Truth::kOpen) roots_.push_back({feature.literal, weight, 0.0, recorded});
    }
    for (const Root& root : roots_) {
      if (!root.literal.is_gate()) continue;
      const GateInfo& gate = info(root.literal.gate());
      if (!gate.wide && gate.joint > options_.small_joint) ++formulas_on_[gate.support];
    }
  }

  bool one_table(const GateInfo& gate) const {
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
    const GateInfo& gate = info(root.literal.gate());
    const double when_true = root.literal.negated() ? root.when_false : root.when_true;
    const double when_false = root.literal.negated() ? root.when_true : root.when_false;
    if (one_table(gate)) {
      if (add_disjunction(gate, when_true, when_false, root.recorded)) return;
      const BitTable bits = truth_table(gate.id, gate.support);
      std::vector<double> table(gate.joint);
      for (std::size_t i = 0; i < table.size(); ++i)
        table[i] = (bits[i / 64] >> (i % 64) & 1u) != 0 ? when_true : when_false;
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
  bool add_disjunction(const GateInfo& gate, double when_true, double when_false, std::uint32_t recorded) {
    if (network_.gate_kind(gate.id) != GateKind::kOr || std::isinf(when_true)) return false;
    const auto& scope = gate.support;
    std::vector<std::vector<std::uint8_t>> accepted(scope.size());
    for (const Literal input : network_.gate_inputs(gate.id)) {
      if (truth(input) != Truth::kOpen) continue;  // false, or the gate would be decided
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

  // --- truth tables

  BitTable truth_table(GateId root, const std::vector<std::uint32_t>& scope) {
    std::vector<std::uint32_t> below{local_gate_.at(root.value)};  // local numbers
    std::map<std::uint32_t, BitTable> tables;                      // by local number: inputs come first
    tables.emplace(below[0], BitTable{});
    for (std::size_t i = 0; i < below.size(); ++i) {
      for (const Literal input : network_.gate_inputs(gates_[below[i]].id)) {
        if (!input.is_gate() || truth(input) != Truth::kOpen) continue;
        const std::uint32_t child = local_gate_.at(input.gate().value);
        if (tables.emplace(child, BitTable{}).second) below.push_back(child);
      }
    }
    std::uint64_t joint = 1;
    for (const std::uint32_t v : scope) joint *= graph_.cardinalities[v];
    const std::size_t words = (joint + 63) / 64;
    for (auto& [number, table] : tables) {
      const GateId g = gates_[number].id;
      const auto input_table = [&](Literal input) {
        BitTable bits(words, 0);
        const Truth t = truth(input);
        if (t != Truth::kOpen) {
          if (t == Truth::kTrue) std::fill(bits.begin(), bits.end(), ~std::uint64_t{0});
          return bits;
        }
        if (input.is_gate()) {
          bits = tables.at(local_gate_.at(input.gate().value));
        } else {
          bits =
              test_table(value_test(network_.variable_of(input.atom()), network_.value_of(input.atom())), scope, joint);
        }
        if (input.negated()) {
          for (auto& word : bits) word = ~word;
        }
        return bits;
      };
      const auto inputs = network_.gate_inputs(g);
      const GateKind kind = network_.gate_kind(g);
      table = input_table(inputs[0]);
      BitTable any = table, two(words, 0);
      for (std::size_t i = 1; i < inputs.size(); ++i) {
        const BitTable other = input_table(inputs[i]);
        for (std::size_t w = 0; w < words; ++w) {
          two[w] |= any[w] & other[w];
          any[w] |= other[w];
          if (kind == GateKind::kIff) table[w] = ~(table[w] ^ other[w]);
        }
      }
      for (std::size_t w = 0; w < words && kind != GateKind::kIff; ++w)
        table[w] = kind == GateKind::kOr ? any[w] : ~two[w];
    }
    return tables.at(below[0]);
  }

  BitTable test_table(const ValueTest& test, const std::vector<std::uint32_t>& scope, std::uint64_t joint) const {
    std::uint64_t stride = 1;
    for (std::size_t i = scope.size(); scope[i - 1] != test.variable; --i) stride *= graph_.cardinalities[scope[i - 1]];
    BitTable bits((joint + 63) / 64, 0);
    const std::uint64_t k = graph_.cardinalities[test.variable];
    for (std::uint64_t i = 0; i < joint; ++i) {
      if (test.accepted[i / stride % k] != 0) bits[i / 64] |= std::uint64_t{1} << (i % 64);
    }
    return bits;
  }

  // --- tests: literals as "this variable's value is among these"

  ValueTest test_of(Literal literal) {
    const Truth t = truth(literal);
    if (t != Truth::kOpen) return ValueTest::constant(t == Truth::kTrue);
    ValueTest plain;
    if (literal.is_atom()) {
      plain = value_test(network_.variable_of(literal.atom()), network_.value_of(literal.atom()));
    } else {
      make_tests_below(literal.gate());
      plain = *info(literal.gate()).test;
    }
    return literal.negated() ? FactorGraphBuilder::negation(plain) : plain;
  }

  // Makes the tests of a gate and of whatever it needs, without recursion.
  void make_tests_below(GateId root) {
    std::vector<GateId> stack{root};
    while (!stack.empty()) {
      const GateId g = stack.back();
      if (info(g).test) {
        stack.pop_back();
        continue;
      }
      const std::size_t before = stack.size();
      if (!is_function(info(g))) {
        for (const Literal leaf : leaves(g)) {
          if (leaf.is_gate() && !info(leaf.gate()).test) stack.push_back(leaf.gate());
        }
      }
      if (stack.size() > before) continue;
      info(g).test = make_test(g);
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
        if (truth(input) != Truth::kOpen) {
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

  bool is_function(const GateInfo& gate) const {
    return !gate.wide && (gate.joint <= options_.small_joint / 2 || gate.support.size() == 1);
  }

  ValueTest make_test(GateId g) {
    const GateInfo& gate = info(g);
    if (is_function(gate)) return function_test(g);
    std::vector<ValueTest> tests = input_tests(g);
    if (network_.gate_kind(g) == GateKind::kIff)
      return builder_.combined(tests[0], tests[1], FactorGraphBuilder::Operation::kIff);
    if (network_.gate_kind(g) == GateKind::kAtMostOne) return builder_.at_most_one_test(std::move(tests));
    if (!join_tests(tests)) return ValueTest::constant(true);
    if (tests.empty()) return ValueTest::constant(false);
    return builder_.chain(tests, false);
  }

  // The truth of a gate over few joint values: a test where it depends on one variable, else an auxiliary variable.
  ValueTest function_test(GateId g) {
    const std::vector<std::uint32_t> support = info(g).support;
    const BitTable bits = truth_table(g, support);
    const std::uint64_t joint = info(g).joint;
    std::vector<std::uint8_t> truths(joint);
    for (std::size_t i = 0; i < joint; ++i) truths[i] = static_cast<std::uint8_t>(bits[i / 64] >> (i % 64) & 1u);
    if (support.size() == 1) return FactorGraphBuilder::simplified({support[0], truths});
    std::uint32_t key = 0;
    for (const std::uint32_t v : support) key = std::max(key, builder_.key(v));
    const ValueTest aux = builder_.auxiliary(key);
    std::vector<std::uint32_t> scope = support;
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
        const ValueTest test = value_test(variable, value);
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
  std::unordered_map<std::uint32_t, std::uint32_t> binding_of_, local_gate_;
  std::vector<GateInfo> gates_;  // sorted by id
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
