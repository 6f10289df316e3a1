#include "inference/world.h"

#include <algorithm>
#include <cmath>

namespace sherlog {
namespace {

constexpr std::uint32_t kNotBroken = 0xffffffffu;
constexpr std::size_t kLongestClimb = 256;  // gates above an atom beyond which nobody asks whether they are a tree

}  // namespace

WorldIndex::WorldIndex(const GroundNetwork& network, std::span<const double> atom_bias)
    : network_(&network), atom_count_(static_cast<std::uint32_t>(network.atom_count())) {
  const std::size_t nodes = network.atom_count() + network.gate_count();
  use_start_.assign(nodes + 1, 0);
  for (std::size_t g = 0; g < network.gate_count(); ++g) {
    for (Literal input : network.gate_inputs(GateId(g))) ++use_start_[node(input) + 1];
  }
  for (std::size_t i = 0; i < nodes; ++i) use_start_[i + 1] += use_start_[i];
  uses_.resize(use_start_.back());
  std::vector<std::uint32_t> next(use_start_.begin(), use_start_.end() - 1);
  for (std::size_t g = 0; g < network.gate_count(); ++g) {
    for (Literal input : network.gate_inputs(GateId(g))) {
      uses_[next[node(input)]++] = {static_cast<std::uint32_t>(g), input.negated()};
    }
  }
  weight_.assign(nodes, 0.0);
  for (const Feature& feature : network.features()) weight_[node(feature.literal)] += feature.weight;
  for (std::size_t a = 0; a < atom_bias.size(); ++a) weight_[a] += atom_bias[a];
  demand_.assign(nodes, 0);
  for (const Constraint& c : network.constraints()) {
    std::int8_t& demand = demand_[node(c.literal)];
    const std::int8_t wanted = c.literal.negated() ? std::int8_t{-1} : std::int8_t{1};
    demand = demand == 0 || demand == wanted ? wanted : kImpossibleDemand;
  }
  sort_uses();
  climbs_as_tree_.resize(atom_count_);
  std::vector<std::uint32_t> seen_by(network.gate_count(), 0xffffffffu);
  std::vector<std::uint32_t> stack;
  for (std::uint32_t a = 0; a < atom_count_; ++a) {
    bool tree = true;
    std::size_t steps = 0;
    stack.assign(1, a);
    while (tree && !stack.empty()) {
      const std::uint32_t top = stack.back();
      stack.pop_back();
      for (const Use& use : uses(top)) {
        if (++steps > kLongestClimb || seen_by[use.gate] == a) tree = false;
        if (!tree) break;
        seen_by[use.gate] = a;
        stack.push_back(gate_node(use.gate));
      }
    }
    climbs_as_tree_[a] = tree;
  }
}

void WorldIndex::sort_uses() {
  telling_.assign(weight_.size(), 0);
  std::vector<bool> tells(weight_.size(), false);
  // Gates are used by later gates only, so from the last node on every use is already judged.
  for (std::size_t node = weight_.size(); node-- > 0;) {
    const auto begin = uses_.begin() + use_start_[node], end = uses_.begin() + use_start_[node + 1];
    const auto useful = std::stable_partition(begin, end, [&](const Use& use) { return tells[gate_node(use.gate)]; });
    std::stable_partition(begin, useful, [&](const Use& use) { return demand_[gate_node(use.gate)] != 0; });
    telling_[node] = static_cast<std::uint32_t>(useful - begin);
    tells[node] = weight_[node] != 0.0 || demand_[node] != 0 || useful != begin;
  }
}

std::vector<std::uint32_t> number_within(const GroundNetwork& network, std::span<const VariableId> variables) {
  std::vector<std::uint32_t> numbers(network.variable_count(), kNoNumber);
  for (std::uint32_t i = 0; i < variables.size(); ++i) numbers[variables[i].index()] = i;
  return numbers;
}

World::World(const WorldIndex& index) : index_(&index) {
  const GroundNetwork& network = index.network();
  values_.resize(network.variable_count());
  for (std::size_t v = 0; v < values_.size(); ++v) {
    values_[v] = network.has_none(VariableId(v)) ? network.candidate_count(VariableId(v)) : 0;
  }
  const std::vector<std::uint32_t> start = values_;
  assign(start);
}

void World::assign(std::span<const std::uint32_t> values) {
  const GroundNetwork& network = index_->network();
  values_.assign(values.begin(), values.end());
  truth_.assign(index_->node_count(), 0);
  if (demand_.empty()) {
    for (std::uint32_t i = 0; i < index_->node_count(); ++i) demand_.push_back(index_->demand(i));
  }
  count_.assign(network.gate_count(), 0);
  broken_.clear();
  broken_position_.assign(index_->node_count(), kNotBroken);
  for (std::size_t v = 0; v < values_.size(); ++v) {
    if (values_[v] < network.candidate_count(VariableId(v))) {
      truth_[network.first_atom(VariableId(v)).index() + values_[v]] = 1;
    }
  }
  for (std::size_t g = 0; g < network.gate_count(); ++g) {
    for (Literal input : network.gate_inputs(GateId(g))) count_[g] += is_true(input) ? 1u : 0u;
    truth_[index_->gate_node(static_cast<std::uint32_t>(g))] =
        gate_truth(network.gate_kind(GateId(g)), count_[g]) ? 1 : 0;
  }
  score_ = 0.0;
  for (std::uint32_t i = 0; i < index_->node_count(); ++i) {
    if (truth_[i] != 0) score_ += index_->weight(i);
    update_broken(i);
  }
}

void World::update_broken(std::uint32_t node) {
  const std::int8_t demand = demand_[node];
  const bool is_broken =
      demand != 0 && (demand == WorldIndex::kImpossibleDemand || (truth_[node] != 0) != (demand > 0));
  const std::uint32_t position = broken_position_[node];
  if (is_broken == (position != kNotBroken)) return;
  if (is_broken) {
    broken_position_[node] = static_cast<std::uint32_t>(broken_.size());
    broken_.push_back(node);
  } else {
    broken_[position] = broken_.back();
    broken_position_[broken_.back()] = position;
    broken_.pop_back();
    broken_position_[node] = kNotBroken;
  }
}

// Climbs depth first and settles each gate before the next input is looked at, so counts and truths agree at every step.
// A gate that two paths reach may flip twice; a climb never returns to where it came from, because gates are acyclic.
double World::flip(std::uint32_t node) {
  const GroundNetwork& network = index_->network();
  const bool now = truth_[node] == 0;
  truth_[node] = now ? 1 : 0;
  double change = now ? index_->weight(node) : -index_->weight(node);
  update_broken(node);
  for (const WorldIndex::Use& use : index_->uses(node)) {
    std::uint32_t& count = count_[use.gate];
    count += now != use.negated ? 1u : 0xffffffffu;
    const std::uint32_t gate = index_->gate_node(use.gate);
    if (gate_truth(network.gate_kind(GateId(use.gate)), count) != (truth_[gate] != 0)) change += flip(gate);
  }
  return change;
}

double World::set(VariableId v, std::uint32_t value) {
  const GroundNetwork& network = index_->network();
  std::uint32_t& current = values_[v.index()];
  if (current == value) return 0.0;
  const std::uint32_t first = network.first_atom(v).value;
  const std::uint32_t candidates = network.candidate_count(v);
  double change = 0.0;
  if (current < candidates) change += flip(first + current);
  if (value < candidates) change += flip(first + value);
  current = value;
  score_ += change;
  return change;
}

double World::peek_climb(std::uint32_t node, bool becomes) const {
  const GroundNetwork& network = index_->network();
  double change = becomes ? index_->weight(node) : -index_->weight(node);
  for (const WorldIndex::Use& use : index_->telling_uses(node)) {
    const std::uint32_t count = becomes != use.negated ? count_[use.gate] + 1 : count_[use.gate] - 1;
    const std::uint32_t gate = index_->gate_node(use.gate);
    const bool truth = gate_truth(network.gate_kind(GateId(use.gate)), count);
    if (truth == (truth_[gate] != 0)) continue;
    if (demand_[gate] != 0 && (demand_[gate] > 0) != truth) return kBreaks;
    const double climb = peek_climb(gate, truth);
    if (climb == kBreaks) return kBreaks;
    change += climb;
  }
  return change;
}

double World::peek(std::uint32_t atom) {
  const bool becomes = truth_[atom] == 0;
  if (demand_[atom] != 0 && (demand_[atom] > 0) != becomes) return kBreaks;
  if (index_->climbs_as_tree(atom)) return peek_climb(atom, becomes);
  const std::size_t broken_before = broken_.size();
  const double change = flip(atom);
  const bool breaks = broken_.size() > broken_before;
  flip(atom);
  return breaks ? kBreaks : change;
}

double World::flip_atom(std::uint32_t atom) {
  const double change = flip(atom);
  score_ += change;
  return change;
}

double World::recount() const {
  double score = 0.0;
  for (std::uint32_t i = 0; i < index_->node_count(); ++i) {
    if (truth_[i] != 0) score += index_->weight(i);
  }
  return score;
}

bool World::check() const {
  World fresh(*index_);
  fresh.demand_ = demand_;
  fresh.assign(values_);
  return fresh.truth_ == truth_ && fresh.count_ == count_ && fresh.broken_.size() == broken_.size() &&
         std::abs(fresh.score_ - score_) <= 1e-6 * (1.0 + std::abs(score_));
}

}  // namespace sherlog
