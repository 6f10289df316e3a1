#include "inference/propagation.h"

#include <algorithm>
#include <utility>

namespace sherlog {
namespace {

Literal unnegated(Literal literal) { return literal.negated() ? ~literal : literal; }
Truth truth_of(bool value) { return value ? Truth::kTrue : Truth::kFalse; }

}  // namespace

Propagation::Propagation(const GroundNetwork& network, std::span<const std::uint32_t> constraints)
    : network_(&network), constraints_(constraints.begin(), constraints.end()) {
  for (const std::uint32_t c : constraints_) add_formula(network.constraints()[c].literal);
  link_uses();
  link_variables();
}

std::uint32_t Propagation::add_node(Literal literal) {
  const auto [it, fresh] = node_of_.emplace(literal.code(), static_cast<std::uint32_t>(nodes_.size()));
  if (fresh) {
    nodes_.emplace_back();
    literals_.push_back(literal);
  }
  return it->second;
}

// Adds everything below the root that is not there yet, without recursion: formulas may be deep.
void Propagation::add_formula(Literal root) {
  const std::size_t before = nodes_.size();
  add_node(unnegated(root));
  for (std::size_t n = before; n < nodes_.size(); ++n) {
    const Literal literal = literals_[n];
    if (!literal.is_gate()) continue;
    Gate gate;
    gate.node = static_cast<std::uint32_t>(n);
    gate.kind = network_->gate_kind(literal.gate());
    gate.input_begin = static_cast<std::uint32_t>(inputs_.size());
    for (const Literal input : network_->gate_inputs(literal.gate())) {
      inputs_.push_back({add_node(unnegated(input)), input.negated()});
    }
    gate.input_end = static_cast<std::uint32_t>(inputs_.size());
    gate.open = gate.input_end - gate.input_begin;
    nodes_[n].gate = static_cast<std::uint32_t>(gates_.size());
    gates_.push_back(gate);
  }
}

void Propagation::link_uses() {
  std::vector<std::uint32_t> count(nodes_.size() + 1, 0);
  for (const Input& input : inputs_) ++count[input.node + 1];
  for (std::size_t i = 1; i < count.size(); ++i) count[i] += count[i - 1];
  for (std::size_t n = 0; n < nodes_.size(); ++n) {
    nodes_[n].use_begin = nodes_[n].use_end = count[n];
  }
  uses_.resize(inputs_.size());
  for (std::uint32_t g = 0; g < gates_.size(); ++g) {
    for (std::uint32_t i = gates_[g].input_begin; i < gates_[g].input_end; ++i) {
      uses_[nodes_[inputs_[i].node].use_end++] = g * 2 + (inputs_[i].negated ? 1u : 0u);
    }
  }
}

void Propagation::link_variables() {
  std::vector<std::pair<std::uint32_t, std::uint32_t>> atoms;  // (network variable, node)
  for (std::uint32_t n = 0; n < nodes_.size(); ++n) {
    if (literals_[n].is_atom()) atoms.emplace_back(network_->variable_of(literals_[n].atom()).value, n);
  }
  std::sort(atoms.begin(), atoms.end());
  for (const auto& [id, node] : atoms) {
    if (variables_.empty() || variables_.back().id.value != id) {
      Variable variable;
      variable.id = VariableId(id);
      variable.atom_begin = static_cast<std::uint32_t>(variable_nodes_.size());
      variable.open = network_->candidate_count(variable.id);
      variable_of_.emplace(id, static_cast<std::uint32_t>(variables_.size()));
      variables_.push_back(variable);
    }
    nodes_[node].variable = static_cast<std::uint32_t>(variables_.size() - 1);
    variable_nodes_.push_back(node);
    variables_.back().atom_end = static_cast<std::uint32_t>(variable_nodes_.size());
  }
}

bool Propagation::run() {
  for (const std::uint32_t c : constraints_) {
    const Literal root = network_->constraints()[c].literal;
    const std::uint32_t node = node_of_.at(unnegated(root).code());
    if (!assign(node, !root.negated(), Reason::kConstraint, c)) return false;
  }
  return propagate();
}

Truth Propagation::truth(Literal literal) const {
  const auto found = node_of_.find(unnegated(literal).code());
  if (found == node_of_.end()) {
    if (!literal.is_atom()) return Truth::kOpen;
    const auto variable = variable_of_.find(network_->variable_of(literal.atom()).value);
    if (variable == variable_of_.end() || variables_[variable->second].true_atoms == 0) return Truth::kOpen;
    return truth_of(literal.negated());  // a sibling is true
  }
  const Truth truth = nodes_[found->second].truth;
  return truth == Truth::kOpen ? truth : truth_of((truth == Truth::kTrue) != literal.negated());
}

bool Propagation::allowed(VariableId variable, std::uint32_t value) const {
  const auto found = variable_of_.find(variable.value);
  if (found == variable_of_.end()) return true;
  if (value == network_->candidate_count(variable)) return variables_[found->second].true_atoms == 0;
  return truth(Literal::atom(AtomId(network_->first_atom(variable).value + value))) != Truth::kFalse;
}

std::size_t Propagation::use_count(Literal literal) const {
  const Node& node = nodes_[node_of_.at(unnegated(literal).code())];
  return node.use_end - node.use_begin;
}

bool Propagation::decide(Literal literal) {
  level_start_.push_back(trail_.size());
  const auto found = node_of_.find(unnegated(literal).code());
  if (found == node_of_.end()) return true;
  return assign(found->second, !literal.negated(), Reason::kDecision, 0) && propagate();
}

void Propagation::backtrack() {
  const std::size_t start = level_start_.back();
  level_start_.pop_back();
  for (std::size_t i = trail_.size(); i-- > start;) {
    if (i < head_) count(trail_[i], true);
    nodes_[trail_[i]].truth = Truth::kOpen;
  }
  trail_.resize(start);
  head_ = std::min(head_, start);
}

bool Propagation::assign(std::uint32_t n, bool value, Reason reason, std::uint32_t reason_index) {
  Node& node = nodes_[n];
  if (node.truth == Truth::kOpen) {
    node.truth = truth_of(value);
    node.reason = reason;
    node.reason_index = reason_index;
    node.time = static_cast<std::uint32_t>(trail_.size());
    trail_.push_back(n);
    return true;
  }
  if (node.truth == truth_of(value)) return true;
  std::vector<std::uint32_t> involved{n};
  conflict_.clear();
  if (reason == Reason::kConstraint) conflict_.push_back(reason_index);
  antecedents(n, value, reason, reason_index, static_cast<std::uint32_t>(trail_.size()), involved);
  explain(std::move(involved));
  return false;
}

// Enters a node's truth into the counters of what uses it, or takes it out again.
void Propagation::count(std::uint32_t n, bool undo) {
  const Node& node = nodes_[n];
  const bool value = node.truth == Truth::kTrue;
  for (std::uint32_t u = node.use_begin; u < node.use_end; ++u) {
    Gate& gate = gates_[uses_[u] >> 1];
    const bool satisfied = value != ((uses_[u] & 1u) != 0);
    if (undo) {
      ++gate.open;
      if (satisfied) --gate.satisfied;
    } else {
      --gate.open;
      if (satisfied) ++gate.satisfied;
    }
  }
  if (node.variable == kNone) return;
  Variable& variable = variables_[node.variable];
  std::uint32_t& counter = value ? variable.true_atoms : variable.open;
  if (value != undo) {
    ++counter;
  } else {
    --counter;
  }
}

bool Propagation::propagate() {
  while (head_ < trail_.size()) {
    const std::uint32_t n = trail_[head_++];
    count(n, false);
    const Node node = nodes_[n];
    for (std::uint32_t u = node.use_begin; u < node.use_end; ++u) {
      if (!check_gate(uses_[u] >> 1)) return false;
    }
    if (node.gate != kNone && !check_gate(node.gate)) return false;
    if (node.variable != kNone && !check_variable(n)) return false;
  }
  return true;
}

bool Propagation::check_gate(std::uint32_t g) {
  switch (gates_[g].kind) {
    case GateKind::kOr:
      return check_or(g);
    case GateKind::kIff:
      return check_iff(g);
    case GateKind::kAtMostOne:
      return check_at_most_one(g);
  }
  return true;
}

// Gives all inputs that are open this truth.
bool Propagation::force_open_inputs(std::uint32_t g, bool value) {
  const Gate& gate = gates_[g];
  for (std::uint32_t i = gate.input_begin; i < gate.input_end; ++i) {
    if (!open(inputs_[i].node)) continue;
    if (!assign(inputs_[i].node, value != inputs_[i].negated, Reason::kGate, g)) return false;
  }
  return true;
}

bool Propagation::check_or(std::uint32_t g) {
  const Gate& gate = gates_[g];
  if (gate.satisfied > 0) return assign(gate.node, true, Reason::kGate, g);
  if (gate.open == 0) return assign(gate.node, false, Reason::kGate, g);
  const Truth out = nodes_[gate.node].truth;
  if (out == Truth::kOpen || (out == Truth::kTrue && gate.open > 1)) return true;
  return force_open_inputs(g, out == Truth::kTrue);  // all of them where false, the last one where true
}

bool Propagation::check_at_most_one(std::uint32_t g) {
  const Gate& gate = gates_[g];
  if (gate.satisfied > 1) return assign(gate.node, false, Reason::kGate, g);
  if (gate.satisfied + gate.open <= 1) return assign(gate.node, true, Reason::kGate, g);
  const Truth out = nodes_[gate.node].truth;
  if (out == Truth::kTrue && gate.satisfied == 1) return force_open_inputs(g, false);
  if (out == Truth::kFalse && gate.satisfied + gate.open == 2) return force_open_inputs(g, true);
  return true;
}

bool Propagation::check_iff(std::uint32_t g) {
  const Gate& gate = gates_[g];
  const std::uint32_t a = inputs_[gate.input_begin].node, b = inputs_[gate.input_begin + 1].node;
  if (!open(a) && !open(b)) return assign(gate.node, nodes_[a].truth == nodes_[b].truth, Reason::kGate, g);
  if (open(gate.node) || (open(a) && open(b))) return true;
  const std::uint32_t known = open(a) ? b : a;
  const bool value = nodes_[known].truth == nodes_[gate.node].truth;
  return assign(open(a) ? a : b, value, Reason::kGate, g);
}

bool Propagation::check_variable(std::uint32_t n) {
  const std::uint32_t v = nodes_[n].variable;
  const Variable& variable = variables_[v];
  if (nodes_[n].truth == Truth::kTrue) {
    for (std::uint32_t i = variable.atom_begin; i < variable.atom_end; ++i) {
      if (variable_nodes_[i] != n && !assign(variable_nodes_[i], false, Reason::kVariable, v)) return false;
    }
    return true;
  }
  if (network_->has_none(variable.id) || variable.open > 1) return true;
  for (std::uint32_t i = variable.atom_begin; i < variable.atom_end; ++i) {
    if (open(variable_nodes_[i])) return assign(variable_nodes_[i], true, Reason::kVariable, v);
  }
  // None is open: one was true all along, one is not mentioned, or all are denied.
  return variable.open > 0 || variable.true_atoms > 0 || assign(n, true, Reason::kVariable, v);
}

void Propagation::antecedents(std::uint32_t n, bool value, Reason reason, std::uint32_t reason_index,
                              std::uint32_t time, std::vector<std::uint32_t>& out) const {
  const auto add = [&](std::uint32_t other) {
    if (other != n && !open(other) && nodes_[other].time < time) out.push_back(other);
  };
  if (reason == Reason::kVariable) {
    const Variable& variable = variables_[reason_index];
    for (std::uint32_t i = variable.atom_begin; i < variable.atom_end; ++i) {
      // A true sibling denies; denied siblings leave the last.
      if ((nodes_[variable_nodes_[i]].truth == Truth::kTrue) != value) add(variable_nodes_[i]);
    }
  }
  if (reason != Reason::kGate) return;
  const Gate& gate = gates_[reason_index];
  const bool one_is_enough = gate.kind == GateKind::kOr && gate.node == n && value;
  for (std::uint32_t i = gate.input_begin; i < gate.input_end; ++i) {
    if (one_is_enough && !true_input(inputs_[i])) continue;
    const std::size_t before = out.size();
    if (gate.kind != GateKind::kOr || gate.node == n || nodes_[gate.node].truth == Truth::kTrue) add(inputs_[i].node);
    if (one_is_enough && out.size() > before) return;
  }
  add(gate.node);
}

void Propagation::explain(std::vector<std::uint32_t> stack) {
  std::vector<bool> seen(nodes_.size(), false);
  for (const std::uint32_t n : stack) seen[n] = true;
  std::vector<std::uint32_t> before;
  while (!stack.empty()) {
    const std::uint32_t n = stack.back();
    stack.pop_back();
    const Node& node = nodes_[n];
    if (node.reason == Reason::kConstraint) conflict_.push_back(node.reason_index);
    before.clear();
    antecedents(n, node.truth == Truth::kTrue, node.reason, node.reason_index, node.time, before);
    for (const std::uint32_t other : before) {
      if (seen[other]) continue;
      seen[other] = true;
      stack.push_back(other);
    }
  }
  std::sort(conflict_.begin(), conflict_.end());
  conflict_.erase(std::unique(conflict_.begin(), conflict_.end()), conflict_.end());
}

}  // namespace sherlog
