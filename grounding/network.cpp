#include "grounding/network.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <boost/pending/disjoint_sets.hpp>
#include <cassert>
#include <numeric>

#include "mln/evidence.h"

namespace sherlog {
namespace {

// Mixes a word into a hash (the finaliser of SplitMix64: every input bit reaches every output bit).
std::uint64_t mix(std::uint64_t hash, std::uint64_t word) {
  hash ^= word + 0x9e3779b97f4a7c15ULL + (hash << 6) + (hash >> 2);
  hash ^= hash >> 30;
  hash *= 0xbf58476d1ce4e5b9ULL;
  hash ^= hash >> 27;
  return hash;
}

std::uint32_t gate_hash(GateKind kind, std::span<const Literal> inputs) {
  std::uint64_t hash = static_cast<std::uint64_t>(kind) + 17;
  for (Literal input : inputs) hash = mix(hash, input.code());
  return static_cast<std::uint32_t>(hash);
}

constexpr std::size_t kShortOr = 8;

template <class T>
std::size_t bytes_of(const std::vector<T>& v) {
  return v.capacity() * sizeof(T);
}

// Doubles an open-addressing table of (index + 1) entries and puts the `count` entries back by their hashes.
template <class HashOf>
void grow(std::vector<std::uint32_t>& table, std::size_t count, HashOf hash_of) {
  if (count * 2 < table.size()) return;
  std::vector<std::uint32_t> bigger(std::bit_ceil(std::max<std::size_t>(1024, count * 4)), 0);
  const std::size_t mask = bigger.size() - 1;
  for (std::uint32_t entry : table) {
    if (entry == 0) continue;
    std::size_t slot = hash_of(entry - 1) & mask;
    while (bigger[slot] != 0) slot = (slot + 1) & mask;
    bigger[slot] = entry;
  }
  table = std::move(bigger);
}

}  // namespace

// --- GroundNetwork ---------------------------------------------------------------------------------------------------

std::string GroundNetwork::atom_text(AtomId a) const {
  const auto predicate = atom_predicate_[a.index()];
  const auto arguments = arguments_of(a);
  std::string text = names_.predicates[predicate] + "(";
  for (std::size_t i = 0; i < arguments.size(); ++i) {
    if (i > 0) text += ',';
    text += quoted_constant(names_.constants[names_.predicate_domains[predicate][i]][arguments[i]]);
  }
  return text + ")";
}

namespace {

void append_literal(const GroundNetwork& network, Literal literal, std::size_t max_length, bool nested,
                    std::string& out) {
  if (out.size() > max_length) return;
  if (literal.is_constant()) {
    out += literal == Literal::constant(true) ? "true" : "false";
    return;
  }
  if (literal.is_atom()) {
    if (literal.negated()) out += '!';
    out += network.atom_text(literal.atom());
    return;
  }
  const auto inputs = network.gate_inputs(literal.gate());
  const GateKind kind = network.gate_kind(literal.gate());
  if (kind == GateKind::kAtMostOne) out += literal.negated() ? "two or more of " : "at most one of ";
  const bool is_or = kind == GateKind::kOr;
  const char* connective = is_or ? (literal.negated() ? " ^ " : " v ") : kind == GateKind::kIff ? " <=> " : ", ";
  const bool negate_whole = kind == GateKind::kIff && literal.negated();
  if (negate_whole) out += '!';
  if (nested || negate_whole) out += '(';
  bool first = true;
  for (Literal input : inputs) {
    if (!first) out += connective;
    first = false;
    append_literal(network, is_or && literal.negated() ? ~input : input, max_length, true, out);
    if (out.size() > max_length) return;
  }
  if (nested || negate_whole) out += ')';
}

}  // namespace

std::string GroundNetwork::literal_text(Literal literal, std::size_t max_length) const {
  std::string text;
  append_literal(*this, literal, max_length, false, text);
  if (text.size() > max_length) text = text.substr(0, max_length) + "...";
  return text;
}

ComponentId GroundNetwork::component_of(Literal literal) const {
  // Every input of a gate lies in the gate's component, so any path down to an atom will do.
  while (literal.is_gate()) literal = gate_inputs(literal.gate()).front();
  return component_of(variable_of(literal.atom()));
}

std::span<const VariableId> GroundNetwork::component_variables(ComponentId c) const {
  const auto begin = component_variables_start_[c.index()];
  return {component_variables_.data() + begin, component_variables_start_[c.index() + 1] - begin};
}

std::span<const std::uint32_t> GroundNetwork::component_features(ComponentId c) const {
  const auto begin = component_features_start_[c.index()];
  return {component_features_.data() + begin, component_features_start_[c.index() + 1] - begin};
}

std::span<const std::uint32_t> GroundNetwork::component_constraints(ComponentId c) const {
  const auto begin = component_constraints_start_[c.index()];
  return {component_constraints_.data() + begin, component_constraints_start_[c.index() + 1] - begin};
}

std::span<const std::uint32_t> GroundNetwork::component_queries(ComponentId c) const {
  const auto begin = component_queries_start_[c.index()];
  return {component_queries_.data() + begin, component_queries_start_[c.index() + 1] - begin};
}

std::size_t GroundNetwork::memory_bytes() const {
  return bytes_of(first_atom_) + has_none_.capacity() / 8 + bytes_of(atom_variable_) + bytes_of(atom_predicate_) +
         bytes_of(atom_arguments_start_) + bytes_of(atom_arguments_) + bytes_of(gate_kind_) + bytes_of(gate_start_) +
         bytes_of(gate_inputs_) + bytes_of(features_) + bytes_of(constraints_) + bytes_of(weights_) +
         bytes_of(binding_start_) + bytes_of(bindings_) + bytes_of(queries_) + bytes_of(soft_targets_) +
         bytes_of(variable_component_) + bytes_of(component_variables_) + bytes_of(component_features_) +
         bytes_of(component_constraints_) + bytes_of(component_queries_);
}

GroundNetwork reweighted(const GroundNetwork& network, std::span<const double> weight_by_id) {
  assert(weight_by_id.size() == network.weights().size());
  GroundNetwork copy = network;
  for (Feature& feature : copy.features_) {
    if (feature.weight_id == kVirtualEvidence) continue;
    const double weight = feature.count * weight_by_id[feature.weight_id.index()];
    const double before = feature.weight;
    feature.weight = feature.turned ? -weight : weight;
    // w * [!x] = w - w * [x]
    if (feature.turned) copy.constant_score_ += before - feature.weight;
  }
  for (std::size_t i = 0; i < copy.weights_.size(); ++i) copy.weights_[i].weight = weight_by_id[i];
  return copy;
}

// --- NetworkBuilder --------------------------------------------------------------------------------------------------

NetworkBuilder::NetworkBuilder(NameTable names) { network_.names_ = std::move(names); }

NetworkBuilder::NetworkBuilder(const GroundNetwork& network) : network_(network) {
  for (std::size_t g = 0; g < network.gate_count(); ++g) {
    index_gate(gate_hash(network.gate_kind(GateId(g)), network.gate_inputs(GateId(g))));
  }
  // Features and constraints are looked up only against new ones: what was merged before stays as it is.
}

VariableId NetworkBuilder::add_variable(PredicateId predicate, std::span<const ConstantIndex> arguments,
                                        std::uint32_t count, bool has_none) {
  const VariableId variable(network_.variable_count());
  const std::size_t arity = count == 0 ? 0 : arguments.size() / count;
  for (std::uint32_t i = 0; i < count; ++i) {
    network_.atom_variable_.push_back(variable.value);
    network_.atom_predicate_.push_back(predicate.value);
    network_.atom_arguments_start_.push_back(static_cast<std::uint32_t>(network_.atom_arguments_.size()));
    const auto begin = arguments.begin() + static_cast<std::ptrdiff_t>(i * arity);
    network_.atom_arguments_.insert(network_.atom_arguments_.end(), begin, begin + static_cast<std::ptrdiff_t>(arity));
  }
  network_.has_none_.push_back(has_none);
  network_.first_atom_.push_back(static_cast<std::uint32_t>(network_.atom_variable_.size()));
  return variable;
}

VariableId NetworkBuilder::add_anonymous(std::uint32_t candidates, bool has_none) {
  // One predicate for each anonymous variable, over a domain of its candidates' numbers.
  auto& names = network_.names_;
  const PredicateId predicate(names.predicates.size());
  names.predicates.push_back(fmt::format("X{}", anonymous_count_++));
  names.predicate_domains.push_back({static_cast<std::uint32_t>(names.constants.size())});
  names.constants.emplace_back();
  std::vector<ConstantIndex> arguments(candidates);
  std::iota(arguments.begin(), arguments.end(), 0u);
  for (ConstantIndex i : arguments) names.constants.back().push_back(std::to_string(i));
  return add_variable(predicate, arguments, candidates, has_none);
}

void NetworkBuilder::index_gate(std::uint32_t hash) {
  grow_gate_table();
  const std::size_t mask = gate_table_.size() - 1;
  std::size_t slot = hash & mask;
  while (gate_table_[slot] != 0) slot = (slot + 1) & mask;
  gate_table_[slot] = std::uint64_t{hash} << 32 | ++gates_in_table_;
}

void NetworkBuilder::grow_gate_table() {
  if ((gates_in_table_ + 1) * 2 < gate_table_.size()) return;
  std::vector<std::uint64_t> bigger(std::max<std::size_t>(1024, gate_table_.size() * 2), 0);
  const std::size_t mask = bigger.size() - 1;
  for (const std::uint64_t entry : gate_table_) {
    if (entry == 0) continue;
    std::size_t slot = (entry >> 32) & mask;
    while (bigger[slot] != 0) slot = (slot + 1) & mask;
    bigger[slot] = entry;
  }
  gate_table_ = std::move(bigger);
}

Literal NetworkBuilder::intern(GateKind kind, std::span<const Literal> inputs) {
  auto& n = network_;
  const std::uint32_t hash = gate_hash(kind, inputs);
  grow_gate_table();
  const std::size_t mask = gate_table_.size() - 1;
  std::size_t slot = hash & mask;
  for (; gate_table_[slot] != 0; slot = (slot + 1) & mask) {
    if (gate_table_[slot] >> 32 != hash) continue;
    const GateId gate(static_cast<std::uint32_t>(gate_table_[slot]) - 1);
    if (n.gate_kind_[gate.index()] == kind && std::ranges::equal(n.gate_inputs(gate), inputs)) {
      return Literal::gate(gate);
    }
  }
  const GateId gate(n.gate_kind_.size());
  gate_table_[slot] = std::uint64_t{hash} << 32 | ++gates_in_table_;
  n.gate_kind_.push_back(kind);
  n.gate_inputs_.insert(n.gate_inputs_.end(), inputs.begin(), inputs.end());
  n.gate_start_.push_back(static_cast<std::uint32_t>(n.gate_inputs_.size()));
  return Literal::gate(gate);
}

Literal NetworkBuilder::make_or(std::vector<Literal>& inputs) {
  const Literal kTrue = Literal::constant(true);
  const Literal kFalse = Literal::constant(false);
  for (Literal input : inputs) {
    if (input == kTrue) return kTrue;
  }
  std::erase(inputs, kFalse);
  // Short disjunctions inside are taken apart, so that what a formula says is seen whatever its brackets; long ones stay shared.
  for (std::size_t i = 0, end = inputs.size(); i < end; ++i) {
    const Literal input = inputs[i];
    if (!input.is_gate() || input.negated() || network_.gate_kind_[input.gate().index()] != GateKind::kOr) continue;
    const auto inner = network_.gate_inputs(input.gate());
    if (inner.size() > kShortOr) continue;
    inputs[i] = inner[0];
    inputs.insert(inputs.end(), inner.begin() + 1, inner.end());
  }
  std::ranges::sort(inputs);
  inputs.erase(std::unique(inputs.begin(), inputs.end()), inputs.end());
  // Sorted by code: the atoms of one variable are neighbours, except that gates (bit 1) are mixed in between.
  std::uint32_t last_denied = 0xffffffffu;    // variable of the last negated atom
  std::uint32_t last_affirmed = 0xffffffffu;  // variable of the last unnegated atom
  std::uint32_t affirmed = 0;                 // how many of its candidates were seen
  for (std::size_t i = 0; i < inputs.size(); ++i) {
    if (i > 0 && inputs[i] == ~inputs[i - 1]) return kTrue;
    if (!inputs[i].is_atom()) continue;
    const std::uint32_t variable = network_.atom_variable_[inputs[i].atom().index()];
    if (inputs[i].negated()) {
      if (variable == last_denied) return kTrue;  // x != a v x != b
      last_denied = variable;
    } else {
      affirmed = variable == last_affirmed ? affirmed + 1 : 1;
      last_affirmed = variable;
      if (!network_.has_none_[variable] && affirmed == network_.candidate_count(VariableId(variable))) return kTrue;
    }
  }
  // x = a v x != b says no more than x != b.
  if (last_denied != 0xffffffffu && last_affirmed != 0xffffffffu && inputs.size() > 1) {
    auto denied = [&](std::uint32_t variable) {
      return std::ranges::any_of(inputs, [&](Literal l) {
        return l.is_atom() && l.negated() && network_.atom_variable_[l.atom().index()] == variable;
      });
    };
    std::erase_if(inputs, [&](Literal l) {
      if (!l.is_atom() || l.negated()) return false;
      const std::uint32_t variable = network_.atom_variable_[l.atom().index()];
      return network_.candidate_count(VariableId(variable)) > 1 && denied(variable);
    });
  }
  if (inputs.empty()) return kFalse;
  if (inputs.size() == 1) return inputs.front();
  return intern(GateKind::kOr, inputs);
}

Literal NetworkBuilder::make_and(std::vector<Literal>& inputs) {
  for (Literal& input : inputs) input = ~input;
  return ~make_or(inputs);
}

Literal NetworkBuilder::make_iff(Literal a, Literal b) {
  const Literal kTrue = Literal::constant(true);
  if (a.is_constant()) return a == kTrue ? b : ~b;
  if (b.is_constant()) return b == kTrue ? a : ~a;
  if (a == b) return kTrue;
  if (a == ~b) return ~kTrue;
  const bool negated = a.negated() != b.negated();
  if (a.negated()) a = ~a;
  if (b.negated()) b = ~b;
  const Literal inputs[2] = {std::min(a, b), std::max(a, b)};
  const Literal gate = intern(GateKind::kIff, inputs);
  return negated ? ~gate : gate;
}

Literal NetworkBuilder::make_at_most_one(std::vector<Literal> inputs) {
  std::ranges::sort(inputs);
  return intern(GateKind::kAtMostOne, inputs);
}

WeightId NetworkBuilder::add_weight(WeightedInstance instance) {
  network_.weights_.push_back(std::move(instance));
  return WeightId(network_.weights_.size() - 1);
}

std::uint32_t NetworkBuilder::store_binding(std::span<const ConstantIndex> binding) {
  if (binding.empty()) return kNoBinding;
  auto& n = network_;
  n.bindings_.insert(n.bindings_.end(), binding.begin(), binding.end());
  n.binding_start_.push_back(static_cast<std::uint32_t>(n.bindings_.size()));
  return static_cast<std::uint32_t>(n.binding_start_.size() - 2);
}

void NetworkBuilder::add_feature(Literal literal, double weight, WeightId weight_id,
                                 std::span<const ConstantIndex> binding) {
  auto& n = network_;
  if (literal.is_constant()) {
    if (literal == Literal::constant(true)) n.constant_score_ += weight;
    return;
  }
  const bool turned = literal.negated();
  if (turned) {
    n.constant_score_ += weight;
    weight = -weight;
    literal = ~literal;
  }
  const auto hash_of = [&](std::uint32_t f) {
    const Feature& feature = n.features_[f];
    return mix(mix(feature.turned ? 3 : 5, feature.literal.code()), feature.weight_id.value);
  };
  grow(feature_table_, n.features_.size() + 1, hash_of);
  const std::size_t mask = feature_table_.size() - 1;
  std::size_t slot = mix(mix(turned ? 3 : 5, literal.code()), weight_id.value) & mask;
  for (; feature_table_[slot] != 0; slot = (slot + 1) & mask) {
    Feature& feature = n.features_[feature_table_[slot] - 1];
    if (feature.literal == literal && feature.weight_id == weight_id && feature.turned == turned) {
      feature.weight += weight;
      ++feature.count;
      return;
    }
  }
  n.features_.push_back({literal, weight, weight_id, 1, turned, store_binding(binding)});
  feature_table_[slot] = static_cast<std::uint32_t>(n.features_.size());
}

bool NetworkBuilder::add_constraint(Literal literal, FormulaId formula, std::span<const ConstantIndex> binding) {
  auto& n = network_;
  if (literal.is_constant()) return literal == Literal::constant(true);
  if (literal.is_gate() && literal.negated() && n.gate_kind_[literal.gate().index()] == GateKind::kOr) {
    const auto inputs = n.gate_inputs(literal.gate());
    const std::vector<Literal> copy(inputs.begin(), inputs.end());
    for (Literal input : copy) add_constraint(~input, formula, binding);
    return true;
  }
  const std::size_t code = literal.code();
  if (code >= constrained_.size()) constrained_.resize(std::max(code + 1, 2 * constrained_.size()), false);
  if (constrained_[code]) return true;
  constrained_[code] = true;
  n.constraints_.push_back({literal, formula, store_binding(binding)});
  return true;
}

void NetworkBuilder::remove_constraints(std::span<const std::uint32_t> indices) {
  std::vector<bool> drop(network_.constraints_.size(), false);
  for (std::uint32_t c : indices) drop[c] = true;
  std::size_t kept = 0;
  for (std::size_t c = 0; c < drop.size(); ++c) {
    if (!drop[c]) network_.constraints_[kept++] = network_.constraints_[c];
  }
  network_.constraints_.resize(kept);
  constrained_.clear();
}

std::size_t NetworkBuilder::memory_bytes() const {
  return network_.memory_bytes() + bytes_of(gate_table_) + bytes_of(feature_table_) + constrained_.capacity() / 8;
}

namespace {

// Lists the items of each component one after the other: start has component_count + 1 entries.
template <class Item>
void group_by_component(std::size_t component_count, const std::vector<std::uint32_t>& component_of_item,
                        std::vector<std::uint32_t>& start, std::vector<Item>& items) {
  start.assign(component_count + 1, 0);
  for (std::uint32_t c : component_of_item) {
    if (c != 0xffffffffu) ++start[c + 1];
  }
  std::partial_sum(start.begin(), start.end(), start.begin());
  items.assign(start.back(), Item());
  std::vector<std::uint32_t> next(start.begin(), start.end() - 1);
  for (std::size_t i = 0; i < component_of_item.size(); ++i) {
    if (component_of_item[i] != 0xffffffffu) items[next[component_of_item[i]]++] = Item(static_cast<std::uint32_t>(i));
  }
}

}  // namespace

void NetworkBuilder::drop_unused_gates() {
  auto& n = network_;
  std::vector<bool> used(n.gate_count(), false);
  const auto use = [&](Literal l) {
    if (l.is_gate() && !l.is_constant()) used[l.gate().index()] = true;
  };
  for (const auto& f : n.features_) use(f.literal);
  for (const auto& c : n.constraints_) use(c.literal);
  for (const auto& q : n.queries_) use(q.literal);
  for (std::size_t g = n.gate_count(); g-- > 0;) {
    if (used[g]) std::ranges::for_each(n.gate_inputs(GateId(g)), use);
  }
  std::vector<std::uint32_t> new_id(n.gate_count());
  std::uint32_t gates = 0, inputs = 0;
  const auto renamed = [&](Literal l) {
    return l.is_gate() && !l.is_constant() ? Literal::gate(GateId(new_id[l.gate().index()]), l.negated()) : l;
  };
  for (std::size_t g = 0; g < new_id.size(); ++g) {
    const std::uint32_t begin = n.gate_start_[g], end = n.gate_start_[g + 1];
    new_id[g] = gates;
    if (!used[g]) continue;
    n.gate_start_[gates] = inputs;
    n.gate_kind_[gates] = n.gate_kind_[g];
    for (std::uint32_t i = begin; i < end; ++i) n.gate_inputs_[inputs++] = renamed(n.gate_inputs_[i]);
    ++gates;
  }
  // Slots below `gates` were overwritten only after they had been read: new ids never exceed old ones.
  n.gate_start_.resize(gates + 1);
  n.gate_start_[gates] = inputs;
  n.gate_kind_.resize(gates);
  n.gate_inputs_.resize(inputs);
  for (auto& f : n.features_) f.literal = renamed(f.literal);
  for (auto& c : n.constraints_) c.literal = renamed(c.literal);
  for (auto& q : n.queries_) q.literal = renamed(q.literal);
}

GroundNetwork NetworkBuilder::build() {
  auto& n = network_;
  drop_unused_gates();
  const std::size_t variables = n.variable_count();
  std::vector<std::uint32_t> rank(variables, 0), parent(variables);
  std::iota(parent.begin(), parent.end(), 0u);
  boost::disjoint_sets<std::uint32_t*, std::uint32_t*> sets(rank.data(), parent.data());
  std::vector<std::uint32_t> gate_variable(n.gate_count());  // any variable below the gate
  const auto variable_below = [&](Literal l) {
    return l.is_gate() ? gate_variable[l.gate().index()] : n.atom_variable_[l.atom().index()];
  };
  for (std::size_t g = 0; g < n.gate_count(); ++g) {
    const auto inputs = n.gate_inputs(GateId(g));
    gate_variable[g] = variable_below(inputs[0]);
    for (Literal input : inputs.subspan(1)) sets.union_set(gate_variable[g], variable_below(input));
  }
  std::vector<std::uint32_t> component_of_root(variables, 0xffffffffu);
  n.variable_component_.resize(variables);
  std::uint32_t count = 0;
  for (std::uint32_t v = 0; v < variables; ++v) {
    const std::uint32_t root = sets.find_set(v);
    if (component_of_root[root] == 0xffffffffu) component_of_root[root] = count++;
    n.variable_component_[v] = component_of_root[root];
  }
  const auto components_of = [&](const auto& items) {
    std::vector<std::uint32_t> result;
    result.reserve(items.size());
    for (const auto& item : items) {
      result.push_back(item.literal.is_constant() ? 0xffffffffu : n.variable_component_[variable_below(item.literal)]);
    }
    return result;
  };
  group_by_component(count, n.variable_component_, n.component_variables_start_, n.component_variables_);
  group_by_component(count, components_of(n.features_), n.component_features_start_, n.component_features_);
  group_by_component(count, components_of(n.constraints_), n.component_constraints_start_, n.component_constraints_);
  group_by_component(count, components_of(n.queries_), n.component_queries_start_, n.component_queries_);
  gate_table_.clear();
  gates_in_table_ = 0;
  feature_table_.clear();
  constrained_.clear();
  return std::move(network_);
}

}  // namespace sherlog
