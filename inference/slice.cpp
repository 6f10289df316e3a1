#include "inference/slice.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "inference/joint_block.h"
#include "inference/sample_sat.h"

namespace sherlog {
namespace {

constexpr std::uint32_t kOutside = 0xffffffffu;
// Rejection is tried for groups of at most so many variables and demands, so often; 1/2^k worlds pass k independent demands.
constexpr std::size_t kRejectionVariables = 12;
constexpr std::uint32_t kRejectionDemands = 6;
constexpr int kRejectionTries = 8;
// Flips of SampleSAT before a jump is given up, for each variable; and how often a jump is tried.
constexpr std::uint64_t kJumpFlipsPerVariable = 20;
constexpr std::uint32_t kStepsPerJump = 4;

}  // namespace

SliceStep::SliceStep(const WorldIndex& index, std::span<const VariableId> variables, bool jump)
    : index_(&index), variables_(variables.begin(), variables.end()), jump_(jump) {
  const GroundNetwork& network = index.network();
  local_.assign(network.variable_count(), kOutside);
  for (std::uint32_t i = 0; i < variables_.size(); ++i) local_[variables_[i].index()] = i;
  parent_.resize(variables_.size());
  constraints_of_.resize(variables_.size());
  const auto concerns = [&](std::uint32_t node) {
    Literal l = node < index.atom_count() ? Literal::atom(AtomId(node)) : Literal::gate(GateId(node - index.atom_count()));
    // All variables of a component move or none does, so any atom below tells.
    while (l.is_gate()) l = network.gate_inputs(l.gate()).front();
    return local_[network.variable_of(l.atom()).index()] != kOutside;
  };
  for (std::uint32_t node = 0; node < index.node_count(); ++node) {
    const double weight = index.weight(node);
    const bool demanded = index.demand(node) != 0;
    if ((weight == 0.0 && !demanded) || !concerns(node)) continue;
    if (weight != 0.0 && !demanded) weighted_.push_back({node, weight > 0.0, -std::expm1(-std::abs(weight))});
    if (demanded && node >= index.atom_count()) hard_gates_.push_back(node - index.atom_count());
  }
}

void SliceStep::choose(World& world, Rng& rng) {
  demanded_.clear();
  for (const WeightedNode& w : weighted_) {
    if (world.is_true(w.node) != w.positive || rng.uniform() >= w.stay) continue;
    world.set_demand(w.node, w.positive ? 1 : -1);
    demanded_.push_back(w.node);
  }
}

std::uint32_t SliceStep::root(std::uint32_t v) {
  while (parent_[v] != v) {
    parent_[v] = parent_[parent_[v]];
    v = parent_[v];
  }
  return v;
}

// Joins the variables below each demanded gate that is not settled by a demanded atom alone.
void SliceStep::group(const World& world) {
  const GroundNetwork& network = index_->network();
  std::iota(parent_.begin(), parent_.end(), 0u);
  std::ranges::fill(constraints_of_, 0u);
  active_.clear();
  for (std::uint32_t g : hard_gates_) active_.push_back(g);
  for (std::uint32_t node : demanded_) {
    if (node >= index_->atom_count()) active_.push_back(node - index_->atom_count());
  }
  std::vector<std::uint32_t>& stack = members_;
  for (std::uint32_t gate : active_) {
    // An OR with a demanded true input asks nothing more.
    const GateId id(gate);
    if (network.gate_kind(id) == GateKind::kOr && world.demand(index_->gate_node(gate)) > 0) {
      const auto settled = [&](Literal input) {
        const int demand = world.demand(index_->node(input));
        return demand != 0 && (demand > 0) != input.negated();
      };
      if (std::ranges::any_of(network.gate_inputs(id), settled)) continue;
    }
    std::uint32_t first = kOutside;
    stack.assign(1, gate);
    while (!stack.empty()) {
      const GateId top(stack.back());
      stack.pop_back();
      for (Literal input : network.gate_inputs(top)) {
        if (input.is_gate()) {
          stack.push_back(input.gate().value);
          continue;
        }
        const std::uint32_t v = root(local_[network.variable_of(input.atom()).index()]);
        if (first == kOutside) {
          first = v;
        } else {
          parent_[v] = first;
        }
      }
    }
    ++constraints_of_[first];
  }
  // constraints_of_ was counted at roots that may have been joined since.
  for (std::uint32_t v = 0; v < parent_.size(); ++v) {
    if (parent_[v] != v) constraints_of_[root(v)] += std::exchange(constraints_of_[v], 0u);
  }
}

void SliceStep::draw_group(World& world, Rng& rng, std::span<const std::uint32_t> members, bool constrained) {
  const GroundNetwork& network = index_->network();
  if (constrained && members.size() <= kRejectionVariables && constraints_of_[root(members[0])] <= kRejectionDemands) {
    old_values_.clear();
    for (std::uint32_t m : members) old_values_.push_back(world.value(variables_[m]));
    for (int attempt = 0; attempt < kRejectionTries; ++attempt) {
      for (std::uint32_t m : members) world.set(variables_[m], rng.below(network.value_count(variables_[m])));
      if (world.broken().empty()) return;
    }
    for (std::size_t i = 0; i < members.size(); ++i) world.set(variables_[members[i]], old_values_[i]);
  }
  for (std::uint32_t m : members) gibbs_step(world, variables_[m], rng, true, scratch_);
}

void SliceStep::step(World& world, Rng& rng) {
  choose(world, rng);
  if (jump_ && rng.below(kStepsPerJump) == 0) {
    old_values_.assign(world.values().begin(), world.values().end());
    for (VariableId v : variables_) world.set(v, rng.below(index_->network().value_count(v)));
    if (!sample_sat(world, rng, variables_, kJumpFlipsPerVariable * variables_.size())) world.assign(old_values_);
  }
  group(world);
  // Members of each group, one group after the other.
  group_start_.assign(parent_.size() + 1, 0);
  for (std::uint32_t v = 0; v < parent_.size(); ++v) ++group_start_[root(v) + 1];
  std::partial_sum(group_start_.begin(), group_start_.end(), group_start_.begin());
  members_.resize(parent_.size());
  for (std::uint32_t v = 0; v < parent_.size(); ++v) members_[group_start_[root(v)]++] = v;
  for (std::uint32_t r = 0, begin = 0; r < parent_.size(); ++r) {
    const std::uint32_t end = group_start_[r];
    if (end > begin) {
      draw_group(world, rng, std::span(members_).subspan(begin, end - begin), constraints_of_[r] > 0);
    }
    begin = std::max(begin, end);
  }
  for (std::uint32_t node : demanded_) world.set_demand(node, index_->demand(node));
}

}  // namespace sherlog
