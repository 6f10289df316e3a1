#include "inference/map_reduction.h"

#include <algorithm>
#include <cassert>

namespace sherlog {
namespace {

constexpr int kMaxRounds = 20;  // chains of pure literals beyond this length are left to the solvers

}  // namespace

MapReduction::MapReduction(const GroundNetwork& network, std::span<const double> atom_bias) : network_(&network) {
  weight_of_node_.assign(network.atom_count() + network.gate_count(), 0.0);
  for (const Feature& f : network.features()) weight_of_node_[network_node(f.literal)] += f.weight;
  for (std::size_t a = 0; a < atom_bias.size(); ++a) weight_of_node_[a] += atom_bias[a];
  local_.assign(weight_of_node_.size(), kNone);
}

std::uint32_t MapReduction::network_node(Literal literal) const {
  if (!literal.is_gate()) return literal.atom().value;
  return static_cast<std::uint32_t>(network_->atom_count()) + literal.gate().value;
}

bool MapReduction::reduce(std::span<const ComponentId> components, std::span<const std::uint32_t> decided) {
  load(components);
  for (const Group& group : groups_) {
    if (decided.empty() || decided[group.variable.index()] == kOpen) continue;
    const std::uint32_t value = decided[group.variable.index()];
    for (std::uint32_t i = 0; i < group.count; ++i) assign(group.first + i, i == value);
  }
  bool possible = propagate();
  for (int round = 0; possible && round < kMaxRounds; ++round) {
    find_pushes();
    bool changed = decide_pure();
    possible = propagate();
    if (!possible) break;
    if (!changed) changed = remove_private_atoms();
    possible = propagate();
    if (!changed) break;
  }
  for (std::uint32_t node : original_) local_[node] = kNone;
  if (!possible) return false;
  find_pushes();
  return build();
}

// --- loading ---------------------------------------------------------------------------------------------------------

void MapReduction::collect(std::span<const ComponentId> components) {
  const auto atoms = static_cast<std::uint32_t>(network_->atom_count());
  for (ComponentId c : components) {
    for (VariableId v : network_->component_variables(c)) {
      groups_.push_back({v, static_cast<std::uint32_t>(original_.size()), network_->candidate_count(v),
                         network_->has_none(v), kNone, kNone});
      for (std::uint32_t i = 0; i < network_->candidate_count(v); ++i)
        original_.push_back(network_->first_atom(v).value + i);
    }
  }
  const std::size_t first_gate = original_.size();
  std::vector<std::uint32_t> open;
  const auto visit = [&](Literal l) {
    const std::uint32_t node = network_node(l);
    if (node < atoms || local_[node] != kNone) return;
    local_[node] = 0;
    original_.push_back(node);
    open.push_back(node);
  };
  const auto visit_all_below = [&](Literal root) {
    visit(root);
    while (!open.empty()) {
      const std::uint32_t gate = open.back() - atoms;
      open.pop_back();
      for (Literal input : network_->gate_inputs(GateId(gate))) visit(input);
    }
  };
  for (ComponentId c : components) {
    for (std::uint32_t f : network_->component_features(c)) visit_all_below(network_->features()[f].literal);
    for (std::uint32_t k : network_->component_constraints(c)) visit_all_below(network_->constraints()[k].literal);
  }
  std::sort(original_.begin() + static_cast<std::ptrdiff_t>(first_gate), original_.end());
  for (std::size_t i = 0; i < original_.size(); ++i) local_[original_[i]] = static_cast<std::uint32_t>(i);
}

void MapReduction::load(std::span<const ComponentId> components) {
  original_.clear(), groups_.clear(), inputs_.clear(), queue_.clear(), removals_.clear();
  conflict_ = false;
  constant_ = 0.0;
  collect(components);
  const std::size_t n = original_.size();
  const auto atoms = static_cast<std::uint32_t>(network_->atom_count());
  kind_.assign(n, Kind::kAtom), weight_.assign(n, 0.0), truth_.assign(n, -1), group_of_.assign(n, kNone);
  input_begin_.assign(n, 0), input_end_.assign(n, 0), open_inputs_.assign(n, 0), true_inputs_.assign(n, 0);
  for (std::uint32_t g = 0; g < groups_.size(); ++g) {
    for (std::uint32_t i = 0; i < groups_[g].count; ++i) group_of_[groups_[g].first + i] = g;
  }
  for (std::size_t i = 0; i < n; ++i) {
    weight_[i] = weight_of_node_[original_[i]];
    if (original_[i] < atoms) continue;
    const GateId gate(original_[i] - atoms);
    kind_[i] = network_->gate_kind(gate) == GateKind::kOr ? Kind::kOr : Kind::kIff;
    input_begin_[i] = static_cast<std::uint32_t>(inputs_.size());
    for (Literal input : network_->gate_inputs(gate)) inputs_.push_back({local_[network_node(input)], input.negated()});
    input_end_[i] = static_cast<std::uint32_t>(inputs_.size());
    open_inputs_[i] = input_end_[i] - input_begin_[i];
  }
  index_uses();
  for (std::uint32_t g = 0; g < groups_.size(); ++g) {
    if (groups_[g].count == 1 && !groups_[g].has_none) assign(groups_[g].first, true);
  }
  for (ComponentId c : components) {
    for (std::uint32_t k : network_->component_constraints(c)) {
      const Literal literal = network_->constraints()[k].literal;
      assign(local_[network_node(literal)], !literal.negated());
    }
  }
}

void MapReduction::index_uses() {
  const std::size_t n = original_.size();
  use_begin_.assign(n + 1, 0);
  for (const Input& input : inputs_) ++use_begin_[input.node + 1];
  for (std::size_t i = 0; i < n; ++i) use_begin_[i + 1] += use_begin_[i];
  uses_.resize(inputs_.size());
  std::vector<std::uint32_t> next(use_begin_.begin(), use_begin_.end() - 1);
  for (std::uint32_t g = 0; g < n; ++g) {
    for (std::uint32_t i = input_begin_[g]; i < input_end_[g]; ++i)
      uses_[next[inputs_[i].node]++] = {g, inputs_[i].negated};
  }
}

// --- propagation -----------------------------------------------------------------------------------------------------

void MapReduction::assign(std::uint32_t node, bool truth) {
  if (truth_[node] >= 0) {
    if ((truth_[node] != 0) != truth) conflict_ = true;
    return;
  }
  truth_[node] = truth ? 1 : 0;
  queue_.push_back(node);
}

bool MapReduction::propagate() {
  while (!queue_.empty() && !conflict_) {
    const std::uint32_t node = queue_.back();
    queue_.pop_back();
    spread(node);
  }
  queue_.clear();
  return !conflict_;
}

void MapReduction::spread(std::uint32_t node) {
  if (kind_[node] == Kind::kAtom) {
    settle_group(node);
  } else {
    settle_gate(node);
  }
  const bool truth = truth_[node] != 0;
  for (std::uint32_t u = use_begin_[node]; u < use_begin_[node + 1]; ++u) {
    const Use& use = uses_[u];
    --open_inputs_[use.gate];
    if (truth != use.negated) ++true_inputs_[use.gate];
    settle_gate(use.gate);
  }
}

void MapReduction::settle_gate(std::uint32_t gate) {
  const std::uint32_t open = open_inputs_[gate];
  const bool known = truth_[gate] >= 0;
  const auto assign_open = [&](auto literal_truth) {
    for (std::uint32_t i = input_begin_[gate]; i < input_end_[gate]; ++i) {
      if (truth_[inputs_[i].node] < 0) assign(inputs_[i].node, literal_truth != inputs_[i].negated);
    }
  };
  if (kind_[gate] == Kind::kOr) {
    if (true_inputs_[gate] > 0) {
      assign(gate, true);
    } else if (open == 0) {
      assign(gate, false);
    } else if (known && truth_[gate] == 0) {
      assign_open(false);
    } else if (known && open == 1) {
      assign_open(true);
    }
    return;
  }
  if (kind_[gate] != Kind::kIff) return;
  if (open == 0) {
    assign(gate, true_inputs_[gate] != 1);
  } else if (known && open == 1) {
    assign_open((true_inputs_[gate] == 1) == (truth_[gate] != 0));
  }
}

// A true candidate denies its siblings; the last one left of a block without "none" is true.
void MapReduction::settle_group(std::uint32_t atom) {
  const Group& group = groups_[group_of_[atom]];
  if (group.count == 1 && group.has_none) return;
  if (truth_[atom] != 0) {
    for (std::uint32_t i = group.first; i < group.first + group.count; ++i) {
      if (i != atom) assign(i, false);
    }
    return;
  }
  if (group.has_none) return;
  std::uint32_t left = 0, last = 0;
  for (std::uint32_t i = group.first; i < group.first + group.count; ++i) {
    if (truth_[i] != 0) ++left, last = i;
  }
  if (left == 0) {
    conflict_ = true;
  } else if (left == 1) {
    assign(last, true);
  }
}

// --- pure literals ---------------------------------------------------------------------------------------------------

void MapReduction::push_input(const Input& input, bool up, bool down) {
  if (truth_[input.node] >= 0) return;
  if (input.negated) std::swap(up, down);
  up_[input.node] |= up ? 1 : 0;
  down_[input.node] |= down ? 1 : 0;
}

void MapReduction::find_pushes() {
  const std::size_t n = original_.size();
  up_.assign(n, 0), down_.assign(n, 0), relevant_uses_.assign(n, 0), relevant_use_.assign(n, kNone);
  for (std::size_t i = n; i-- > 0;) {
    bool up = up_[i] != 0, down = down_[i] != 0;
    if (truth_[i] < 0) {
      up = up || weight_[i] > 0.0;
      down = down || weight_[i] < 0.0;
      up_[i] = up ? 1 : 0, down_[i] = down ? 1 : 0;
    } else {
      up = truth_[i] != 0;
      down = !up;
    }
    // A gate without open inputs, or an OR with a true one, is what it is.
    const bool is_gate = kind_[i] == Kind::kOr || kind_[i] == Kind::kIff;
    if (!is_gate || open_inputs_[i] == 0 || (!up && !down)) continue;
    if (kind_[i] == Kind::kOr && true_inputs_[i] > 0) continue;
    const bool one_sided = kind_[i] == Kind::kOr || open_inputs_[i] == 1;
    const bool turned = kind_[i] == Kind::kIff && open_inputs_[i] == 1 && true_inputs_[i] == 0;
    if (turned) std::swap(up, down);
    for (std::uint32_t k = input_begin_[i]; k < input_end_[i]; ++k) {
      push_input(inputs_[k], up || !one_sided, down || !one_sided);
      ++relevant_uses_[inputs_[k].node];
      relevant_use_[inputs_[k].node] = static_cast<std::uint32_t>(i);
    }
  }
}

bool MapReduction::decide_pure() {
  bool changed = false;
  for (Group& group : groups_) changed = decide_block(group) || changed;
  for (std::uint32_t i = 0; i < original_.size(); ++i) {
    if (kind_[i] != Kind::kFreeGate || truth_[i] >= 0 || (up_[i] != 0 && down_[i] != 0)) continue;
    assign(i, up_[i] != 0);
    changed = true;
  }
  return changed;
}

// x dominates y where nothing speaks against x and nothing for y: moving the block from y to x loses nothing.
bool MapReduction::decide_block(Group& group) {
  const std::uint32_t end = group.first + group.count;
  std::uint32_t open = 0, champion = kNone;
  for (std::uint32_t i = group.first; i < end; ++i) {
    if (truth_[i] > 0 || kind_[i] == Kind::kRemovedAtom) return false;
    if (truth_[i] == 0) continue;
    ++open;
    if (down_[i] == 0 && (champion == kNone || up_[i] == 0)) champion = i;
  }
  if (open == 0) return false;
  if (group.stand_in != kNone && truth_[group.stand_in] < 0) champion = group.stand_in;
  bool changed = false;
  // "None" is pushed nowhere, so it dominates every candidate that nothing speaks for.
  if (group.has_none && champion != kNone && up_[champion] == 0) champion = kNone;
  for (std::uint32_t i = group.first; i < end; ++i) {
    if (truth_[i] >= 0 || i == champion || up_[i] != 0 || (!group.has_none && champion == kNone)) continue;
    assign(i, false);
    changed = true;
    --open;
  }
  if (group.has_none) {
    if (champion != kNone && up_[champion] != 0) {
      group.has_none = false;  // the champion is as good as "none"
      changed = true;
      if (open == 1) assign(champion, true);
    }
  } else if (champion != kNone && up_[champion] == 0 && group.stand_in == kNone && open > 1) {
    group.stand_in = champion;
  }
  return changed;
}

// --- private atoms ---------------------------------------------------------------------------------------------------

bool MapReduction::remove_private_atoms() {
  bool changed = false;
  std::vector<std::uint8_t> touched(original_.size(), 0);  // its inputs changed in this round
  for (const Group& group : groups_) {
    const std::uint32_t atom = group.first;
    if (group.count != 1 || !group.has_none || kind_[atom] != Kind::kAtom || truth_[atom] >= 0) continue;
    if (relevant_uses_[atom] != 1 || touched[relevant_use_[atom]] != 0) continue;
    const std::uint32_t gate = relevant_use_[atom];
    if (open_inputs_[gate] < 2 || !remove_private_atom(atom, gate)) continue;
    touched[gate] = 1;
    changed = true;
  }
  return changed;
}

bool MapReduction::remove_private_atom(std::uint32_t atom, std::uint32_t gate) {
  bool negated = false;
  for (std::uint32_t i = input_begin_[gate]; i < input_end_[gate]; ++i) {
    if (inputs_[i].node == atom) negated = inputs_[i].negated;
  }
  const bool is_iff = kind_[gate] == Kind::kIff;
  const double a = weight_[atom], w = weight_[gate];
  const std::int8_t truth = truth_[gate];
  const bool used = use_begin_[gate] != use_begin_[gate + 1];
  if (is_iff && a == 0.0) {
    removals_.push_back({atom, gate, negated, true, 0.0, 0.0, -1});
    kind_[gate] = Kind::kFreeGate;
    kind_[atom] = Kind::kRemovedAtom;
    return true;
  }
  if (used) return false;
  // best[r]: the best sum with the rest of the gate false, true.
  double best[2];
  if (is_iff) {
    best[1] = truth < 0 ? std::max(a + w, 0.0) : (truth > 0 ? a : 0.0);
    best[0] = truth < 0 ? std::max(w, a) : (truth > 0 ? 0.0 : a);
  } else {
    const double literal_true = negated ? 0.0 : a, literal_false = negated ? a : 0.0;
    best[1] = (truth < 0 ? w : 0.0) + std::max(a, 0.0);
    best[0] = truth < 0 ? std::max(w + literal_true, literal_false) : literal_true;
  }
  removals_.push_back({atom, gate, negated, is_iff, a, w, truth});
  constant_ += best[0];
  if (truth > 0) constant_ += w;
  kind_[atom] = Kind::kRemovedAtom;
  kind_[gate] = Kind::kOr;  // of what is left
  forget_input(gate, atom);
  weight_[gate] = best[1] - best[0];
  truth_[gate] = -1;
  if (input_end_[gate] - input_begin_[gate] == 1) {  // the weight is on that input
    const Input& last = inputs_[input_begin_[gate]];
    if (last.negated) constant_ += weight_[gate];
    weight_[last.node] += last.negated ? -weight_[gate] : weight_[gate];
    weight_[gate] = 0.0;
  }
  return true;
}

// The slot stays in use_begin_/uses_ (a removed atom is never assigned again); the gate's list is closed up.
void MapReduction::forget_input(std::uint32_t gate, std::uint32_t atom) {
  auto begin = inputs_.begin() + input_begin_[gate], end = inputs_.begin() + input_end_[gate];
  const auto place = std::find_if(begin, end, [&](const Input& i) { return i.node == atom; });
  std::move(place + 1, end, place);
  --input_end_[gate];
  --open_inputs_[gate];
  // Counts of an IFF whose other input is fixed carry over: true_inputs_ is the number of true literals of the rest.
}

// --- the rest --------------------------------------------------------------------------------------------------------

Literal MapReduction::build_gate(NetworkBuilder& builder, std::uint32_t gate, std::vector<Literal>& scratch) const {
  scratch.clear();
  for (std::uint32_t i = input_begin_[gate]; i < input_end_[gate]; ++i) {
    const Input& input = inputs_[i];
    const Literal literal = input.negated ? ~rest_literal_[input.node] : rest_literal_[input.node];
    // An OR inside an OR that says nothing else is spelled out.
    const bool flat = kind_[gate] == Kind::kOr && kind_[input.node] == Kind::kOr && !input.negated &&
                      truth_[input.node] < 0 && weight_[input.node] == 0.0 && relevant_uses_[input.node] == 1;
    if (flat && !literal.is_constant() && literal.is_gate() && !literal.negated() &&
        builder.so_far().gate_kind(literal.gate()) == GateKind::kOr) {
      const auto inner = builder.so_far().gate_inputs(literal.gate());
      scratch.insert(scratch.end(), inner.begin(), inner.end());
    } else {
      scratch.push_back(literal);
    }
  }
  return kind_[gate] == Kind::kIff ? builder.make_iff(scratch[0], scratch[1]) : builder.make_or(scratch);
}

bool MapReduction::build() {
  NameTable names;
  names.predicates.push_back("x");
  names.predicate_domains.emplace_back();
  NetworkBuilder builder(std::move(names));
  const WeightId weight_id = builder.add_weight({FormulaId(0), {}, 1.0});
  const std::size_t n = original_.size();
  rest_literal_.assign(n, Literal::constant(false));
  builder.add_constant_score(constant_);
  for (Group& group : groups_) {
    std::uint32_t open = 0;
    bool decided = false;
    for (std::uint32_t i = group.first; i < group.first + group.count; ++i) {
      if (truth_[i] > 0 || kind_[i] == Kind::kRemovedAtom) decided = true;
      if (truth_[i] < 0 && i != group.stand_in) ++open;
    }
    if (decided || open == 0) continue;
    const bool stands_in = group.stand_in != kNone && truth_[group.stand_in] < 0;
    const VariableId v = builder.add_variable(PredicateId(0), {}, open, group.has_none || stands_in);
    group.rest_variable = v.value;
    std::uint32_t next = builder.first_atom(v).value;
    for (std::uint32_t i = group.first; i < group.first + group.count; ++i) {
      if (truth_[i] < 0 && i != group.stand_in) rest_literal_[i] = Literal::atom(AtomId(next++));
    }
  }
  std::vector<Literal> scratch;
  for (std::uint32_t i = 0; i < n; ++i) {
    const bool is_gate = kind_[i] == Kind::kOr || kind_[i] == Kind::kIff;
    const bool relevant = up_[i] != 0 || down_[i] != 0;
    if (kind_[i] == Kind::kFreeGate && truth_[i] < 0 && relevant) {
      rest_literal_[i] = Literal::atom(builder.first_atom(builder.add_variable(PredicateId(0), {}, 1, true)));
    } else if (is_gate && (truth_[i] >= 0 || relevant)) {
      const Literal literal = build_gate(builder, i, scratch);
      if (truth_[i] >= 0 && !builder.add_constraint(truth_[i] > 0 ? literal : ~literal, FormulaId(0))) return false;
      rest_literal_[i] = literal;
    }
    if (truth_[i] >= 0) rest_literal_[i] = Literal::constant(truth_[i] > 0);
    if (kind_[i] != Kind::kRemovedAtom && weight_[i] != 0.0)
      builder.add_feature(rest_literal_[i], weight_[i], weight_id);
  }
  rest_ = builder.build();
  return true;
}

// --- back ------------------------------------------------------------------------------------------------------------

// Recursion ends at what was fixed, at free gates and at atoms; what is asked for is known by then (see lift).
bool MapReduction::truth_of(std::uint32_t node, std::vector<std::int8_t>& truth) const {
  if (truth[node] >= 0) return truth[node] != 0;
  std::uint32_t true_inputs = 0;
  for (std::uint32_t i = input_begin_[node]; i < input_end_[node]; ++i) {
    if (truth_of(inputs_[i].node, truth) != inputs_[i].negated) ++true_inputs;
  }
  const bool result = kind_[node] == Kind::kOr ? true_inputs > 0 : true_inputs != 1;
  truth[node] = result ? 1 : 0;
  return result;
}

void MapReduction::lift(std::span<const std::uint32_t> rest_values, std::span<std::uint32_t> values) const {
  std::vector<std::int8_t> truth = truth_;
  const auto rest_truth = [&](Literal atom) {
    if (atom.is_constant()) return atom == Literal::constant(true);
    return rest_values[rest_.variable_of(atom.atom()).index()] == rest_.value_of(atom.atom());
  };
  for (const Group& group : groups_) {
    bool any = false;
    for (std::uint32_t i = group.first; i < group.first + group.count; ++i) {
      if (truth[i] < 0) truth[i] = rest_truth(rest_literal_[i]) ? 1 : 0;
      any = any || truth[i] > 0;
    }
    if (!any && group.stand_in != kNone && truth_[group.stand_in] < 0) truth[group.stand_in] = 1;
  }
  for (std::size_t i = 0; i < kind_.size(); ++i) {
    if (kind_[i] == Kind::kFreeGate && truth[i] < 0) truth[i] = rest_truth(rest_literal_[i]) ? 1 : 0;
  }
  // A removed atom's gate holds, from then on, the truth of its rest; the rest has only atoms that went later or stayed.
  for (std::size_t k = removals_.size(); k-- > 0;) {
    const Removal& r = removals_[k];
    if (kind_[r.gate] == Kind::kFreeGate) {
      bool other = false;
      for (std::uint32_t i = input_begin_[r.gate]; i < input_end_[r.gate]; ++i) {
        if (inputs_[i].node != r.atom) other = truth_of(inputs_[i].node, truth) != inputs_[i].negated;
      }
      truth[r.atom] = (truth[r.gate] != 0) == (other != r.negated) ? 1 : 0;
      continue;
    }
    const bool rest = truth_of(r.gate, truth);
    const auto worth = [&](bool x) {  // negative infinity where the gate would not be what is demanded
      const bool literal = x != r.negated;
      const bool gate = r.is_iff ? literal == rest : literal || rest;
      if (r.truth >= 0)
        return gate == (r.truth > 0) ? (x ? r.atom_weight : 0.0) : -std::numeric_limits<double>::infinity();
      return (x ? r.atom_weight : 0.0) + (gate ? r.gate_weight : 0.0);
    };
    truth[r.atom] = worth(true) > worth(false) ? 1 : 0;
  }
  for (const Group& group : groups_) {
    std::uint32_t value = group.count;
    for (std::uint32_t i = 0; i < group.count; ++i) {
      if (truth[group.first + i] > 0) value = i;
    }
    values[group.variable.index()] = value;
  }
}

}  // namespace sherlog
