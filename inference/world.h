// One assignment to the variables of a ground network, with the truth of every gate kept up to date.
//
// Idea      Each gate knows how many of its inputs are true; a flipped atom changes those counts and climbs only where a
//           gate's own truth changes. What a change does to the score is summed on the way: only literals that carry
//           weight count. Nodes whose demand is broken are kept in a list with positions, so that local search can draw one at
//           random. Demands start as the hard constraints; a slice of MC-SAT adds its own and takes them back.
// Cost      Setting a variable: O(occurrences of the two atoms), plus the climb. Memory O(atoms + gate inputs).
// Requires  The network outlives the World and is not changed.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "grounding/network.h"

namespace sherlog {

// Where each node is used, and what its truth weighs; shared by all Worlds over one network.
// Nodes are numbered: atoms first (atom id), then gates (atom_count + gate id).
class WorldIndex {
 public:
  struct Use {
    std::uint32_t gate;  // the gate whose input it is
    bool negated;        // as a negated input
  };

  explicit WorldIndex(const GroundNetwork& network, std::span<const double> atom_bias = {});

  const GroundNetwork& network() const { return *network_; }
  std::size_t node_count() const { return weight_.size(); }
  std::uint32_t node(Literal literal) const {
    return literal.is_gate() ? atom_count_ + literal.gate().value : literal.atom().value;
  }
  std::uint32_t gate_node(std::uint32_t gate) const { return atom_count_ + gate; }
  std::uint32_t atom_count() const { return atom_count_; }
  std::span<const Use> uses(std::uint32_t node) const {
    return {uses_.data() + use_start_[node], use_start_[node + 1] - use_start_[node]};
  }
  // Those of them that lead to a weight or a demand, gates with a demand of their own first: all that a change can affect.
  std::span<const Use> telling_uses(std::uint32_t node) const {
    return {uses_.data() + use_start_[node], telling_[node]};
  }
  // Sum of the weights of the features on this node; added where it is true.
  double weight(std::uint32_t node) const { return weight_[node]; }
  // Takes the node's weight and demand away, for a sampler that accounts for them itself.
  // Call sort_uses() after the last.
  void release(std::uint32_t node) {
    weight_[node] = 0.0;
    demand_[node] = 0;
  }
  void sort_uses();
  // Whether no gate is reached by two paths from this atom, so that one flip's effect can be summed without making it.
  bool climbs_as_tree(std::uint32_t atom) const { return climbs_as_tree_[atom]; }
  // +1: constraint demands true, -1: demands false, 0: free, kImpossibleDemand: both are demanded.
  static constexpr std::int8_t kImpossibleDemand = 2;
  std::int8_t demand(std::uint32_t node) const { return demand_[node]; }

 private:
  const GroundNetwork* network_;
  std::uint32_t atom_count_;
  std::vector<std::uint32_t> use_start_;
  std::vector<Use> uses_;
  std::vector<std::uint32_t> telling_;  // how many of a node's uses are telling; they come first
  std::vector<double> weight_;
  std::vector<std::int8_t> demand_;
  std::vector<bool> climbs_as_tree_;
};

// The place of each variable of the network within the list, kNoNumber for others. One array does for all components of a network,
// each variable numbered within its own: what is below a gate never leaves a component.
std::vector<std::uint32_t> number_within(const GroundNetwork& network, std::span<const VariableId> variables);
inline constexpr std::uint32_t kNoNumber = 0xffffffffu;

class World {
 public:
  // Starts with every variable at "none" where it has that value, else at value 0.
  explicit World(const WorldIndex& index);

  const WorldIndex& index() const { return *index_; }
  std::uint32_t value(VariableId v) const { return values_[v.index()]; }
  std::span<const std::uint32_t> values() const { return values_; }
  bool is_true(std::uint32_t node) const { return truth_[node] != 0; }
  bool is_true(Literal literal) const { return is_true(index_->node(literal)) != literal.negated(); }
  std::uint32_t true_inputs(std::uint32_t gate) const { return count_[gate]; }

  // Changes one variable; returns the change of the score (features only).
  double set(VariableId v, std::uint32_t value);
  // Changes all (values by variable).
  void assign(std::span<const std::uint32_t> values);

  // The change of the score if this atom alone were flipped (its siblings stay as they are); nothing is changed. Returns
  // `kBreaks` where that would break a demand that is met now. Exact for demands that are all met before.
  static constexpr double kBreaks = -1e300;
  double peek(std::uint32_t atom);
  // Flips one atom alone, as half of a set(); the caller restores that a variable has one value.
  double flip_atom(std::uint32_t atom);
  void note_value(VariableId v, std::uint32_t value) { values_[v.index()] = value; }

  // Demands a truth of a node from now on: +1, -1, 0 (none), see WorldIndex::demand.
  void set_demand(std::uint32_t node, std::int8_t demand) {
    demand_[node] = demand;
    update_broken(node);
  }
  std::int8_t demand(std::uint32_t node) const { return demand_[node]; }

  // Nodes whose demand is not met.
  std::span<const std::uint32_t> broken() const { return broken_; }
  // Sum of the weights of true features, computed incrementally; drifts by rounding only: see recount().
  double score() const { return score_; }

  // From scratch: the score; and whether every count agrees with the values (for tests and asserts).
  double recount() const;
  bool check() const;

 private:
  double flip(std::uint32_t node);
  void update_broken(std::uint32_t node);
  double peek_climb(std::uint32_t node, bool becomes) const;

  const WorldIndex* index_;
  std::vector<std::uint32_t> values_;
  std::vector<std::uint8_t> truth_;             // by node
  std::vector<std::uint32_t> count_;            // true inputs, by gate
  std::vector<std::int8_t> demand_;             // by node
  std::vector<std::uint32_t> broken_;           // nodes
  std::vector<std::uint32_t> broken_position_;  // by node, kNotBroken where met
  double score_ = 0.0;
};

}  // namespace sherlog
