#include "inference/slice.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <unordered_set>
#include <utility>

#include "inference/joint_block.h"
#include "inference/sample_sat.h"

namespace sherlog {
namespace {

// Rejection is tried for groups of at most so many variables and demands, so often; 1/2^k worlds pass k independent demands.
constexpr std::size_t kRejectionVariables = 12;
constexpr std::uint32_t kRejectionDemands = 6;
constexpr int kRejectionTries = 8;
// Flips of SampleSAT before a jump is given up, for each variable; and how often a jump is tried.
constexpr std::uint64_t kJumpFlipsPerVariable = 20;
constexpr std::uint32_t kStepsPerJump = 4;
constexpr std::size_t kVariablesPerStopCheck = 4096;

std::uint32_t root(std::vector<std::uint32_t>& parent, std::uint32_t v) {
  while (parent[v] != v) {
    parent[v] = parent[parent[v]];
    v = parent[v];
  }
  return v;
}

}  // namespace

SliceStep::SliceStep(const WorldIndex& index, std::span<const VariableId> variables,
                     std::span<const std::uint32_t> numbers, bool jump)
    : index_(&index), variables_(variables.begin(), variables.end()), numbers_(numbers), jump_(jump) {
  const GroundNetwork& network = index.network();
  // Atoms of the variables, then every gate above them, in the network's order.
  std::vector<std::uint32_t> nodes, stack;
  for (VariableId v : variables_) {
    for (std::uint32_t i = 0; i < network.candidate_count(v); ++i) nodes.push_back(network.first_atom(v).value + i);
  }
  stack = nodes;
  std::unordered_set<std::uint32_t> seen;
  while (!stack.empty()) {
    const std::uint32_t node = stack.back();
    stack.pop_back();
    for (const WorldIndex::Use& use : index.telling_uses(node)) {
      if (!seen.insert(use.gate).second) continue;
      nodes.push_back(index.gate_node(use.gate));
      stack.push_back(nodes.back());
    }
  }
  std::ranges::sort(nodes);
  for (std::uint32_t node : nodes) {
    const double weight = index.weight(node);
    const bool demanded = index.demand(node) != 0;
    if (weight != 0.0 && !demanded) weighted_.push_back({node, weight > 0.0, -std::expm1(-std::abs(weight))});
    if (demanded && node >= index.atom_count()) hard_gates_.push_back(node - index.atom_count());
  }
}

void SliceStep::choose(World& world, Rng& rng, Scratch& scratch) const {
  scratch.demanded.clear();
  for (const WeightedNode& w : weighted_) {
    if (world.is_true(w.node) != w.positive || rng.uniform() >= w.stay) continue;
    world.set_demand(w.node, w.positive ? 1 : -1);
    scratch.demanded.push_back(w.node);
  }
}

// Joins the variables below a demanded gate into one group.
void SliceStep::join_below(std::uint32_t gate, Scratch& scratch) const {
  const GroundNetwork& network = index_->network();
  std::uint32_t first = kNoNumber;
  scratch.stack.assign(1, gate);
  while (!scratch.stack.empty()) {
    const GateId top(scratch.stack.back());
    scratch.stack.pop_back();
    for (Literal input : network.gate_inputs(top)) {
      if (input.is_gate()) {
        scratch.stack.push_back(input.gate().value);
        continue;
      }
      const std::uint32_t number = numbers_[network.variable_of(input.atom()).index()];
      if (number == kNoNumber) continue;
      const std::uint32_t v = root(scratch.parent, number);
      if (first == kNoNumber) {
        first = v;
      } else {
        scratch.parent[v] = first;
      }
    }
  }
  if (first != kNoNumber) ++scratch.constraints_of[first];
}

// Joins the variables below each demanded gate that is not settled by a demanded atom alone.
void SliceStep::group(const World& world, Scratch& scratch) const {
  const GroundNetwork& network = index_->network();
  scratch.parent.resize(variables_.size());
  std::iota(scratch.parent.begin(), scratch.parent.end(), 0u);
  scratch.constraints_of.assign(variables_.size(), 0u);
  scratch.active = hard_gates_;
  for (std::uint32_t node : scratch.demanded) {
    if (node >= index_->atom_count()) scratch.active.push_back(node - index_->atom_count());
  }
  for (std::uint32_t gate : scratch.active) {
    // An OR with a demanded true input asks nothing more.
    const GateId id(gate);
    if (network.gate_kind(id) == GateKind::kOr && world.demand(index_->gate_node(gate)) > 0) {
      const auto settled = [&](Literal input) {
        const std::int8_t demand = world.demand(index_->node(input));
        return demand != 0 && (demand > 0) != input.negated();
      };
      if (std::ranges::any_of(network.gate_inputs(id), settled)) continue;
    }
    join_below(gate, scratch);
  }
  // Counted at roots that may have been joined since.
  for (std::uint32_t v = 0; v < scratch.parent.size(); ++v) {
    if (scratch.parent[v] == v) continue;
    scratch.constraints_of[root(scratch.parent, v)] += std::exchange(scratch.constraints_of[v], 0u);
  }
}

void SliceStep::draw_group(World& world, Rng& rng, Scratch& scratch, std::span<const std::uint32_t> members,
                           bool constrained) const {
  const GroundNetwork& network = index_->network();
  if (constrained && members.size() <= kRejectionVariables &&
      scratch.constraints_of[root(scratch.parent, members[0])] <= kRejectionDemands) {
    scratch.old_values.clear();
    for (std::uint32_t m : members) scratch.old_values.push_back(world.value(variables_[m]));
    for (int attempt = 0; attempt < kRejectionTries; ++attempt) {
      for (std::uint32_t m : members) world.set(variables_[m], rng.below(network.value_count(variables_[m])));
      if (world.broken().empty()) return;
    }
    for (std::size_t i = 0; i < members.size(); ++i) world.set(variables_[members[i]], scratch.old_values[i]);
  }
  for (std::uint32_t m : members) gibbs_step(world, variables_[m], rng, true, scratch.weights);
}

void SliceStep::jump_away(World& world, Rng& rng, Scratch& scratch, const StopCondition* stop) const {
  scratch.old_values.clear();
  for (VariableId v : variables_) scratch.old_values.push_back(world.value(v));
  for (VariableId v : variables_) world.set(v, rng.below(index_->network().value_count(v)));
  if (sample_sat(world, rng, variables_, kJumpFlipsPerVariable * variables_.size(), stop)) return;
  for (std::size_t i = 0; i < variables_.size(); ++i) world.set(variables_[i], scratch.old_values[i]);
}

void SliceStep::step(World& world, Rng& rng, Scratch& scratch, const StopCondition* stop) const {
  choose(world, rng, scratch);
  if (jump_ && rng.below(kStepsPerJump) == 0) jump_away(world, rng, scratch, stop);
  group(world, scratch);
  // Members of each group, one group after the other.
  std::vector<std::uint32_t>& start = scratch.group_start;
  start.assign(variables_.size() + 1, 0);
  for (std::uint32_t v = 0; v < variables_.size(); ++v) ++start[root(scratch.parent, v) + 1];
  std::partial_sum(start.begin(), start.end(), start.begin());
  scratch.members.resize(variables_.size());
  for (std::uint32_t v = 0; v < variables_.size(); ++v) scratch.members[start[root(scratch.parent, v)]++] = v;
  std::size_t since_check = 0;
  for (std::uint32_t r = 0, begin = 0; r < variables_.size(); ++r) {
    const std::uint32_t end = start[r];
    if (end > begin) {
      draw_group(world, rng, scratch, std::span(scratch.members).subspan(begin, end - begin),
                 scratch.constraints_of[r] > 0);
      since_check += end - begin;
      if (since_check > kVariablesPerStopCheck && stop != nullptr) {
        if (stop->reached()) break;
        since_check = 0;
      }
    }
    begin = std::max(begin, end);
  }
  for (std::uint32_t node : scratch.demanded) world.set_demand(node, index_->demand(node));
}

}  // namespace sherlog
