#include "inference/group_move.h"

#include <algorithm>
#include <cmath>

namespace sherlog {
namespace {

// Calls f(gate) for every gate above the node.
template <class F>
void for_each_gate_above(const WorldIndex& index, std::uint32_t node, F&& f) {
  for (const WorldIndex::Use& use : index.uses(node)) {
    f(use.gate);
    for_each_gate_above(index, index.gate_node(use.gate), f);
  }
}

template <class F>
void for_each_atom_below(const GroundNetwork& network, std::uint32_t gate, F&& f) {
  for (Literal input : network.gate_inputs(GateId(gate))) {
    if (input.is_gate()) {
      for_each_atom_below(network, input.gate().value, f);
    } else {
      f(input.atom());
    }
  }
}

// Boolean variables no two of which meet in a formula, under no hard formula, not members of a group themselves.
std::vector<bool> find_leaves(const WorldIndex& index, std::span<const VariableId> variables, const std::vector<bool>& covered) {
  const GroundNetwork& network = index.network();
  std::vector<bool> leaf(network.atom_count(), false);
  for (VariableId v : variables) {
    const AtomId atom = network.first_atom(v);
    if (covered[v.index()] || network.candidate_count(v) != 1 || !network.has_none(v) || index.demand(atom.value) != 0) continue;
    bool good = true, hangs_on_group = false;
    for_each_gate_above(index, atom.value, [&](std::uint32_t gate) {
      if (!good) return;
      good = index.demand(index.gate_node(gate)) == 0;
      if (!good) return;
      for_each_atom_below(network, gate, [&](AtomId other) {
        if (other != atom && leaf[other.index()]) good = false;
        if (covered[network.variable_of(other).index()]) hangs_on_group = true;
      });
    });
    leaf[atom.index()] = good && hangs_on_group;
  }
  return leaf;
}

void sort_unique(std::vector<std::uint32_t>& v) {
  std::ranges::sort(v);
  v.erase(std::unique(v.begin(), v.end()), v.end());
}

}  // namespace

GroupMoves::GroupMoves(const WorldIndex& index, std::span<const VariableId> variables) {
  const GroundNetwork& network = index.network();
  covered_.assign(network.variable_count(), false);
  std::vector<bool> inside(network.variable_count(), false);
  for (VariableId v : variables) inside[v.index()] = true;
  for (std::uint32_t g = 0; g < network.gate_count(); ++g) {
    if (network.gate_kind(GateId(g)) != GateKind::kAtMostOne || index.demand(index.gate_node(g)) != 1) continue;
    const auto inputs = network.gate_inputs(GateId(g));
    if (!std::ranges::all_of(inputs, [&](Literal l) {
          return l.is_atom() && !l.negated() && inside[network.variable_of(l.atom()).index()];
        })) {
      continue;
    }
    const auto begin = static_cast<std::uint32_t>(members_.size());
    bool good = true;
    for (Literal input : inputs) {
      const VariableId v = network.variable_of(input.atom());
      std::uint32_t escape = 0, escapes = 0;
      for (std::uint32_t value = 0; value < network.value_count(v); ++value) {
        const bool in_group = value < network.candidate_count(v) &&
                              std::ranges::find(inputs, Literal::atom(AtomId(network.first_atom(v).value + value))) != inputs.end();
        if (in_group) continue;
        escape = value;
        ++escapes;
      }
      good = good && escapes == 1;
      Member member{v, network.value_of(input.atom()), escape, 0, 0, true, 0.0};
      if (escape < network.candidate_count(v)) {
        const std::uint32_t atom = network.first_atom(v).value + escape;
        member.plain_escape = index.uses(atom).empty() && index.demand(atom) == 0;
        member.escape_weight = index.weight(atom);
      }
      members_.push_back(member);
    }
    if (!good) {
      members_.resize(begin);
      continue;
    }
    groups_.push_back({g, begin, static_cast<std::uint32_t>(members_.size())});
    for (std::uint32_t m = begin; m < members_.size(); ++m) covered_[members_[m].variable.index()] = true;
  }
  if (groups_.empty()) return;
  const std::vector<bool> leaf = find_leaves(index, variables, covered_);
  std::vector<std::uint32_t> found;
  for (Member& member : members_) {
    found.clear();
    for (std::uint32_t c = 0; c < network.candidate_count(member.variable); ++c) {
      for_each_gate_above(index, network.first_atom(member.variable).value + c, [&](std::uint32_t gate) {
        if (index.demand(index.gate_node(gate)) != 0) return;
        for_each_atom_below(network, gate, [&](AtomId atom) {
          if (leaf[atom.index()]) found.push_back(atom.value);
        });
      });
    }
    sort_unique(found);
    member.leaf_begin = static_cast<std::uint32_t>(leaves_.size());
    leaves_.insert(leaves_.end(), found.begin(), found.end());
    member.leaf_end = static_cast<std::uint32_t>(leaves_.size());
  }
}

double GroupMoves::leaf_sum(World& world, std::span<const std::uint32_t> leaves) const {
  double sum = 0.0;
  for (std::uint32_t atom : leaves) {
    const double change = world.peek(atom);
    sum += change > 30.0 ? change : std::log1p(std::exp(change));
  }
  return sum;
}

void GroupMoves::draw(World& world, Rng& rng, const Group& group) {
  const std::span<const Member> members(members_.data() + group.begin, group.end - group.begin);
  const auto leaves_of = [&](const Member& m) { return std::span(leaves_).subspan(m.leaf_begin, m.leaf_end - m.leaf_begin); };
  const GroundNetwork& network = world.index().network();
  std::uint32_t current = static_cast<std::uint32_t>(members.size());
  for (std::uint32_t i = 0; i < members.size() && world.true_inputs(group.gate) > 0; ++i) {
    if (world.value(members[i].variable) == members[i].value) {
      current = i;
      break;
    }
  }
  // Everything is measured against "none of them": the current member steps aside first.
  choices_.clear();
  weights_.clear();
  own_leaves_.clear();
  double stepped = 0.0, own_before = 0.0;
  if (current < members.size()) {
    const auto own = leaves_of(members[current]);
    own_leaves_.assign(own.begin(), own.end());
    own_before = leaf_sum(world, own);
    stepped = world.set(members[current].variable, members[current].escape);
  }
  const bool none_possible = world.broken().empty();
  if (current < members.size()) {
    choices_.push_back(current);
    weights_.push_back(-stepped + own_before - leaf_sum(world, own_leaves_));
  }
  if (none_possible || current == members.size()) {
    choices_.push_back(static_cast<std::uint32_t>(members.size()));
    weights_.push_back(0.0);
  }
  for (std::uint32_t i = 0; i < members.size() && none_possible; ++i) {
    if (i == current) continue;
    const Member& m = members[i];
    const auto leaves = leaves_of(m);
    if (m.plain_escape) {
      // The quick way: most places are taken, and that shows without a change.
      const double change = world.peek(network.first_atom(m.variable).value + m.value);
      if (change == World::kBreaks) continue;
      if (leaves.empty()) {
        choices_.push_back(i);
        weights_.push_back(change - m.escape_weight);
        continue;
      }
    }
    const double before = leaf_sum(world, leaves);
    const double change = world.set(m.variable, m.value);
    if (world.broken().empty()) {
      choices_.push_back(i);
      weights_.push_back(change + leaf_sum(world, leaves) - before);
    }
    world.set(m.variable, m.escape);
  }
  const double best = *std::ranges::max_element(weights_);
  double total = 0.0;
  for (double& w : weights_) total += w = std::exp(w - best);
  double u = rng.uniform() * total;
  std::size_t chosen = 0;
  while (chosen + 1 < weights_.size() && (u -= weights_[chosen]) >= 0.0) ++chosen;
  const std::uint32_t pick = choices_[chosen];
  if (pick < members.size()) world.set(members[pick].variable, members[pick].value);
  // The leaves of old and new follow; those of others did not notice.
  if (pick < members.size()) {
    const auto leaves = leaves_of(members[pick]);
    own_leaves_.insert(own_leaves_.end(), leaves.begin(), leaves.end());
  }
  sort_unique(own_leaves_);
  for (std::uint32_t atom : own_leaves_) {
    const double change = world.peek(atom);
    if (rng.uniform() * (1.0 + std::exp(-change)) >= 1.0) continue;
    const VariableId v = network.variable_of(AtomId(atom));
    world.set(v, 1 - world.value(v));
  }
}

void GroupMoves::sweep(World& world, Rng& rng) {
  for (const Group& group : groups_) draw(world, rng, group);
}

}  // namespace sherlog
