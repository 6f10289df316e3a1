#include "inference/gate_support.h"

#include <algorithm>
#include <map>

namespace sherlog {

bool GateSupports::collect(std::span<const Literal> roots, const std::function<bool()>& out_of_time) {
  std::vector<std::uint32_t> ids, stack;
  const auto push = [&](Literal literal) {
    if (literal.is_gate() && number_.emplace(literal.gate().value, 0).second) stack.push_back(literal.gate().value);
  };
  for (const Literal root : roots) push(root);
  while (!stack.empty()) {
    if (out_of_time()) return false;
    const std::uint32_t g = stack.back();
    stack.pop_back();
    ids.push_back(g);
    for (const Literal input : network_.gate_inputs(GateId(g))) push(input);
  }
  std::sort(ids.begin(), ids.end());  // inputs before gates
  gates_.reserve(ids.size());
  for (const std::uint32_t g : ids) {
    if (out_of_time()) return false;
    number_[g] = static_cast<std::uint32_t>(gates_.size());
    Gate gate;
    gate.id = GateId(g);
    look_at(gate);
    gates_.push_back(std::move(gate));
  }
  return true;
}

Truth GateSupports::truth(Literal literal) const {
  if (literal.is_constant()) return literal.negated() ? Truth::kFalse : Truth::kTrue;
  Truth plain = Truth::kOpen;
  if (literal.is_gate()) {
    plain = gate(literal.gate()).truth;
  } else {
    const FactorGraph::Binding& b = binding(network_.variable_of(literal.atom()));
    const bool left = std::ranges::binary_search(b.values, network_.value_of(literal.atom()));
    if (!left) plain = Truth::kFalse;
    if (left && b.variable == ValueTest::kConstant) plain = Truth::kTrue;
  }
  if (plain == Truth::kOpen) return plain;
  return (plain == Truth::kTrue) != literal.negated() ? Truth::kTrue : Truth::kFalse;
}

ValueTest GateSupports::value_test(VariableId variable, std::uint32_t value) const {
  const FactorGraph::Binding& b = binding(variable);
  const auto found = std::lower_bound(b.values.begin(), b.values.end(), value);
  if (found == b.values.end() || *found != value) return ValueTest::constant(false);
  if (b.variable == ValueTest::kConstant) return ValueTest::constant(true);
  ValueTest test{b.variable, std::vector<std::uint8_t>(b.values.size(), 0)};
  test.accepted[static_cast<std::size_t>(found - b.values.begin())] = 1;
  return test;
}

// Truth by the inputs' truths.
Truth GateSupports::derived(GateId gate) const {
  const auto inputs = network_.gate_inputs(gate);
  if (network_.gate_kind(gate) == GateKind::kIff) {
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
  const bool least = gate_truth(network_.gate_kind(gate), satisfied),
             most = gate_truth(network_.gate_kind(gate), satisfied + open);
  if (least != most) return Truth::kOpen;
  return least ? Truth::kTrue : Truth::kFalse;
}

void GateSupports::look_at(Gate& gate) const {
  gate.truth = derived(gate.id);
  if (gate.truth != Truth::kOpen) return;
  gate.truth = propagation_.truth(Literal::gate(gate.id));
  gate.demanded = gate.truth != Truth::kOpen;
  for (const Literal input : network_.gate_inputs(gate.id)) {
    if (truth(input) != Truth::kOpen) continue;
    if (input.is_gate()) {
      const Gate& child = this->gate(input.gate());
      gate.wide = child.wide;
      if (!gate.wide) extend(gate, child.support);
    } else {
      const std::uint32_t variable = binding(network_.variable_of(input.atom())).variable;
      extend(gate, {&variable, 1});
    }
    if (gate.wide) break;
  }
  if (gate.wide) gate.support.clear();
}

void GateSupports::extend(Gate& gate, std::span<const std::uint32_t> variables) const {
  for (const std::uint32_t v : variables) {
    const auto place = std::lower_bound(gate.support.begin(), gate.support.end(), v);
    if (place != gate.support.end() && *place == v) continue;
    gate.support.insert(place, v);
    gate.joint *= graph_.cardinalities[v];
    if (gate.joint > kMostJoint) {
      gate.wide = true;
      return;
    }
  }
}

BitTable GateSupports::truth_table(const Gate& root) const {
  std::vector<std::uint32_t> below{number(root.id)};
  std::map<std::uint32_t, BitTable> tables;  // by number of the gate: inputs come first
  tables.emplace(below[0], BitTable{});
  for (std::size_t i = 0; i < below.size(); ++i) {
    for (const Literal input : network_.gate_inputs(gates_[below[i]].id)) {
      if (!input.is_gate() || truth(input) != Truth::kOpen) continue;
      const std::uint32_t child = number(input.gate());
      if (tables.emplace(child, BitTable{}).second) below.push_back(child);
    }
  }
  const std::size_t words = (root.joint + 63) / 64;
  for (auto& [number, table] : tables) {
    const auto input_table = [&](Literal input) {
      BitTable bits(words, 0);
      const Truth t = truth(input);
      if (t != Truth::kOpen) {
        if (t == Truth::kTrue) std::fill(bits.begin(), bits.end(), ~std::uint64_t{0});
        return bits;
      }
      bits = input.is_gate() ? tables.at(this->number(input.gate())) : test_table(value_test(input.atom()), root);
      if (input.negated()) {
        for (auto& word : bits) word = ~word;
      }
      return bits;
    };
    const auto inputs = network_.gate_inputs(gates_[number].id);
    const GateKind kind = network_.gate_kind(gates_[number].id);
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
    for (std::size_t w = 0; w < words && kind != GateKind::kIff; ++w) {
      table[w] = kind == GateKind::kOr ? any[w] : ~two[w];
    }
  }
  return tables.at(below[0]);
}

// Where a test holds, over the support of a gate that depends on its variable.
BitTable GateSupports::test_table(const ValueTest& test, const Gate& gate) const {
  std::uint64_t stride = 1;
  for (std::size_t i = gate.support.size(); gate.support[i - 1] != test.variable; --i) {
    stride *= graph_.cardinalities[gate.support[i - 1]];
  }
  BitTable bits((gate.joint + 63) / 64, 0);
  const std::uint64_t k = graph_.cardinalities[test.variable];
  for (std::uint64_t i = 0; i < gate.joint; ++i) {
    if (test.accepted[i / stride % k] != 0) bits[i / 64] |= std::uint64_t{1} << (i % 64);
  }
  return bits;
}

}  // namespace sherlog
