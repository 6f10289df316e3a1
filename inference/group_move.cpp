#include "inference/group_move.h"

#include <algorithm>
#include <cmath>
#include <unordered_map>
#include <unordered_set>

namespace sherlog {
namespace {

// Formulas above an atom beyond which it is no leaf: a step looks at all of them.
constexpr std::size_t kMostGatesAbove = 4096, kFewGates = 32;
constexpr std::uint32_t kVariablesPerStopCheck = 4096;

// Every gate above the node, once; false where they are too many.
bool gates_above(const WorldIndex& index, std::uint32_t node, std::vector<std::uint32_t>& out) {
  out.clear();
  std::unordered_set<std::uint32_t> seen;  // where a search through `out` would take long
  for (std::size_t next = 0;; ++next) {
    for (const WorldIndex::Use& use : index.uses(node)) {
      const bool few = out.size() < kFewGates;
      if (!few && seen.empty()) seen.insert(out.begin(), out.end());
      const bool is_new = few ? std::ranges::find(out, use.gate) == out.end() : seen.insert(use.gate).second;
      if (is_new) out.push_back(use.gate);
      if (out.size() > kMostGatesAbove) return false;
    }
    if (next == out.size()) return true;
    node = index.gate_node(out[next]);
  }
}

void sort_unique(std::vector<std::uint32_t>& v) {
  std::ranges::sort(v);
  v.erase(std::unique(v.begin(), v.end()), v.end());
}

}  // namespace

GroupMoves::GroupMoves(const WorldIndex& index, std::span<const VariableId> variables) {
  find_groups(index, variables);
  if (!groups_.empty()) find_leaves(index, variables);
}

void GroupMoves::find_groups(const WorldIndex& index, std::span<const VariableId> variables) {
  const GroundNetwork& network = index.network();
  // An atom of the group leads to its gate; `variables` are sorted, so a search tells who belongs here.
  std::vector<std::uint32_t> gates;
  for (VariableId v : variables) {
    for (std::uint32_t i = 0; i < network.candidate_count(v); ++i) {
      for (const WorldIndex::Use& use : index.telling_uses(network.first_atom(v).value + i)) {
        const bool demanded =
            network.gate_kind(GateId(use.gate)) == GateKind::kAtMostOne && index.demand(index.gate_node(use.gate)) == 1;
        if (demanded) gates.push_back(use.gate);
      }
    }
  }
  sort_unique(gates);
  for (std::uint32_t g : gates) {
    const bool plain = std::ranges::all_of(network.gate_inputs(GateId(g)), [&](Literal l) {
      return l.is_atom() && !l.negated() && std::ranges::binary_search(variables, network.variable_of(l.atom()));
    });
    if (!plain) continue;
    const auto begin = static_cast<std::uint32_t>(members_.size());
    if (!add_members(index, g)) {
      members_.resize(begin);
      continue;
    }
    Group group{g, begin, static_cast<std::uint32_t>(members_.size()), 0, 0};
    find_places(index, group);
    groups_.push_back(group);
    for (std::uint32_t m = begin; m < members_.size(); ++m) covered_.push_back(members_[m].variable);
  }
  std::ranges::sort(covered_);
  covered_.erase(std::unique(covered_.begin(), covered_.end()), covered_.end());
}

// False where some variable has not just one value outside the group.
bool GroupMoves::add_members(const WorldIndex& index, std::uint32_t gate) {
  const GroundNetwork& network = index.network();
  const auto inputs = network.gate_inputs(GateId(gate));
  std::vector<AtomId> atoms;
  for (Literal input : inputs) atoms.push_back(input.atom());
  std::ranges::sort(atoms);
  for (Literal input : inputs) {
    const VariableId v = network.variable_of(input.atom());
    std::uint32_t escape = 0, escapes = 0;
    for (std::uint32_t value = 0; value < network.value_count(v); ++value) {
      if (value < network.candidate_count(v) &&
          std::ranges::binary_search(atoms, AtomId(network.first_atom(v).value + value)))
        continue;
      escape = value;
      ++escapes;
    }
    if (escapes != 1) return false;
    Member member{v, network.value_of(input.atom()), escape, 0, 0, true, 0.0};
    if (escape < network.candidate_count(v)) {
      const std::uint32_t atom = network.first_atom(v).value + escape;
      member.plain_escape = index.uses(atom).empty() && index.demand(atom) == 0;
      member.escape_weight = index.weight(atom);
    }
    members_.push_back(member);
  }
  return true;
}

// A demanded at-most-one gate over the member, but not over its escape: while it has a true input, the member would be a second.
std::uint32_t GroupMoves::find_rival(const WorldIndex& index, const Member& member, std::uint32_t gate) const {
  const GroundNetwork& network = index.network();
  const std::uint32_t first = network.first_atom(member.variable).value;
  for (const WorldIndex::Use& use : index.telling_uses(first + member.value)) {
    const bool demanded =
        network.gate_kind(GateId(use.gate)) == GateKind::kAtMostOne && index.demand(index.gate_node(use.gate)) == 1;
    if (use.gate == gate || !demanded || use.negated) continue;
    const bool escape_inside = member.escape < network.candidate_count(member.variable) &&
                               std::ranges::any_of(index.uses(first + member.escape),
                                                   [&](const WorldIndex::Use& u) { return u.gate == use.gate; });
    if (!escape_inside) return use.gate;
  }
  return kNoRival;
}

void GroupMoves::find_places(const WorldIndex& index, Group& group) {
  group.place_begin = static_cast<std::uint32_t>(places_.size());
  for (std::uint32_t m = group.begin; m < group.end; ++m) {
    const Member& member = members_[m];
    const std::uint32_t rival = find_rival(index, member, group.gate);
    const bool same = places_.size() > group.place_begin && places_.back().variable == member.variable &&
                      places_.back().rival == rival;
    if (!same) places_.push_back({member.variable, m, m, member.escape, rival});
    places_.back().end = m + 1;
  }
  group.place_end = static_cast<std::uint32_t>(places_.size());
}

// All or nothing: a leaf that one member sums out and another does not would be summed wrongly.
void GroupMoves::forget_leaves() {
  leaves_.clear();
  for (Member& member : members_) member.leaf_begin = member.leaf_end = 0;
}

// Leaves: boolean variables no two of which meet in a formula, under no hard formula, not members of a group themselves, but below a
// formula with one. So each formula has one leaf at most, and a member's leaves are those of the formulas above it.
void GroupMoves::find_leaves(const WorldIndex& index, std::span<const VariableId> variables) {
  const GroundNetwork& network = index.network();
  std::unordered_set<std::uint32_t> with_member;
  std::vector<std::uint32_t> above, stack;
  for (VariableId v : covered_) {
    for (std::uint32_t i = 0; i < network.candidate_count(v); ++i) stack.push_back(network.first_atom(v).value + i);
  }
  while (!stack.empty()) {
    const std::uint32_t node = stack.back();
    stack.pop_back();
    for (const WorldIndex::Use& use : index.uses(node)) {
      if (with_member.insert(use.gate).second) stack.push_back(index.gate_node(use.gate));
    }
  }
  std::unordered_map<std::uint32_t, std::uint32_t> leaf_of_gate;
  for (VariableId v : variables) {
    const std::uint32_t atom = network.first_atom(v).value;
    if (covers(v) || network.candidate_count(v) != 1 || !network.has_none(v) || index.demand(atom) != 0) continue;
    if (!gates_above(index, atom, above)) continue;
    const bool good = std::ranges::all_of(above, [&](std::uint32_t gate) {
      return index.demand(index.gate_node(gate)) == 0 && !leaf_of_gate.contains(gate);
    });
    if (!good || std::ranges::none_of(above, [&](std::uint32_t gate) { return with_member.contains(gate); })) continue;
    for (std::uint32_t gate : above) leaf_of_gate.emplace(gate, atom);
  }
  std::vector<std::uint32_t> found;
  for (Member& member : members_) {
    found.clear();
    for (std::uint32_t c = 0; c < network.candidate_count(member.variable); ++c) {
      if (!gates_above(index, network.first_atom(member.variable).value + c, above)) return forget_leaves();
      for (std::uint32_t gate : above) {
        const auto leaf = leaf_of_gate.find(gate);
        if (leaf != leaf_of_gate.end()) found.push_back(leaf->second);
      }
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

// The number of the member that is true, group.end where none is.
std::uint32_t GroupMoves::current_member(const World& world, const Group& group) const {
  if (world.true_inputs(group.gate) == 0) return group.end;
  for (const Place& place : std::span(places_).subspan(group.place_begin, group.place_end - group.place_begin)) {
    const std::uint32_t value = world.value(place.variable);
    if (value == place.escape) continue;
    for (std::uint32_t m = place.begin; m < place.end; ++m) {
      if (members_[m].value == value) return m;
    }
  }
  return group.end;
}

// Adds the member to the choices where it is possible now that no member is true.
void GroupMoves::try_member(World& world, Scratch& scratch, std::uint32_t number) const {
  const Member& m = members_[number];
  const auto leaves = leaves_of(m);
  if (m.plain_escape) {
    // The quick way, without a change.
    const double change = world.peek(world.index().network().first_atom(m.variable).value + m.value);
    if (change == World::kBreaks) return;
    if (leaves.empty()) {
      scratch.choices.push_back(number);
      scratch.weights.push_back(change - m.escape_weight);
      return;
    }
  }
  const double before = leaf_sum(world, leaves);
  const double change = world.set(m.variable, m.value);
  if (world.broken().empty()) {
    scratch.choices.push_back(number);
    scratch.weights.push_back(change + leaf_sum(world, leaves) - before);
  }
  world.set(m.variable, m.escape);
}

void GroupMoves::draw(World& world, Rng& rng, Scratch& scratch, const Group& group) const {
  const std::uint32_t current = current_member(world, group);
  // Everything is measured against "none of them": the current member steps aside first.
  scratch.choices.clear();
  scratch.weights.clear();
  scratch.own_leaves.clear();
  double stepped = 0.0, own_before = 0.0;
  if (current < group.end) {
    const auto own = leaves_of(members_[current]);
    scratch.own_leaves.assign(own.begin(), own.end());
    own_before = leaf_sum(world, own);
    stepped = world.set(members_[current].variable, members_[current].escape);
  }
  const bool none_possible = world.broken().empty();
  if (current < group.end) {
    scratch.choices.push_back(current);
    scratch.weights.push_back(-stepped + own_before - leaf_sum(world, scratch.own_leaves));
  }
  if (none_possible || current == group.end) {
    scratch.choices.push_back(group.end);
    scratch.weights.push_back(0.0);
  }
  for (std::uint32_t p = group.place_begin; p < group.place_end && none_possible; ++p) {
    const Place& place = places_[p];
    if (place.rival != kNoRival && world.true_inputs(place.rival) > 0) continue;
    for (std::uint32_t m = place.begin; m < place.end; ++m) {
      if (m != current) try_member(world, scratch, m);
    }
  }
  const double best = *std::ranges::max_element(scratch.weights);
  double total = 0.0;
  for (double& w : scratch.weights) total += w = std::exp(w - best);
  double u = rng.uniform() * total;
  std::size_t chosen = 0;
  while (chosen + 1 < scratch.weights.size() && (u -= scratch.weights[chosen]) >= 0.0) ++chosen;
  const std::uint32_t pick = scratch.choices[chosen];
  // The leaves of old and new follow; those of others did not notice.
  if (pick < group.end) {
    world.set(members_[pick].variable, members_[pick].value);
    const auto leaves = leaves_of(members_[pick]);
    scratch.own_leaves.insert(scratch.own_leaves.end(), leaves.begin(), leaves.end());
  }
  sort_unique(scratch.own_leaves);
  for (std::uint32_t atom : scratch.own_leaves) {
    const double change = world.peek(atom);
    if (rng.uniform() * (1.0 + std::exp(-change)) >= 1.0) continue;
    const VariableId v = world.index().network().variable_of(AtomId(atom));
    world.set(v, 1 - world.value(v));
  }
}

void GroupMoves::sweep(World& world, Rng& rng, Scratch& scratch, const StopCondition* stop) const {
  std::uint32_t since_check = 0;
  for (const Group& group : groups_) {
    draw(world, rng, scratch, group);
    since_check += group.end - group.begin;
    if (since_check < kVariablesPerStopCheck || stop == nullptr) continue;
    if (stop->reached()) return;
    since_check = 0;
  }
}

}  // namespace sherlog
