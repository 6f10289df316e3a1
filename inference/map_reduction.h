// What can be decided about a most probable world before any search, and what is left to search.
//
// Idea      Four rules are applied until none helps; each keeps at least one most probable world.
//             propagation     what hard formulas force, by units over gates and blocks
//             pure literals   an atom that weights and hard formulas push in one direction only goes there; of a block's
//                             candidates, one that nothing speaks for gives way to one that nothing speaks against, and a
//                             candidate that nothing mentions stands in for all of its kind
//             free gates      an IFF with an atom that is used nowhere else can be made true or false at will: it is
//                             replaced by a new atom
//             private atoms   an atom that is used by one weighted gate only is maximised out: its best value, given the rest of
//                             the gate, leaves a weight on that rest
//           The rest is built as a network of its own, so every solver takes a plain GroundNetwork. Afterwards `lift` finds the
//           values of what was removed, in reverse order of removal.
// Source    Unit propagation and pure literals: Davis & Putnam, JACM 7, 1960, here on gates with polarities (Plaisted &
//           Greenbaum, JSC 2, 1986); maximising out: Dechter, Artificial Intelligence 113, 1999.
// Cost      O(rounds x gate inputs of the components); one round is usual, kMaxRounds at most.
#pragma once

#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "grounding/network.h"

namespace sherlog {

class MapReduction {
 public:
  // The network outlives this. `atom_bias`: added to the weight of each atom's truth, or empty.
  explicit MapReduction(const GroundNetwork& network, std::span<const double> atom_bias = {});

  // Simplifies the components; `decided` gives values (by variable, kOpen where open) that are known to be part of a most
  // probable world, or is empty. Returns false where no world meets the hard formulas.
  static constexpr std::uint32_t kOpen = 0xffffffffu;
  bool reduce(std::span<const ComponentId> components, std::span<const std::uint32_t> decided = {});

  // What is left. Its constant_score is what the removed part scores: the sum of all features (and biases) of the
  // components in a lifted world is constant_score plus the sum of features here.
  const GroundNetwork& rest() const { return rest_; }

  // From a world of rest() to the components' variables (entries of `values` by variable of the original network).
  void lift(std::span<const std::uint32_t> rest_values, std::span<std::uint32_t> values) const;

 private:
  static constexpr std::uint32_t kNone = 0xffffffffu;
  enum class Kind : std::uint8_t { kAtom, kOr, kIff, kFreeGate, kRemovedAtom };
  struct Input {
    std::uint32_t node;
    bool negated;
  };
  // A node: an atom or gate of the components, inputs before the gate.
  struct Group {  // a variable
    VariableId variable{};
    std::uint32_t first = 0, count = 0;  // nodes
    bool has_none = false;
    std::uint32_t stand_in = kNone;  // node whose truth is the value "none" of the reduced variable
    std::uint32_t rest_variable = kNone;
  };
  struct Removal {  // of an atom that one gate uses
    std::uint32_t atom, gate;
    bool negated;  // as an input of it
    bool is_iff;
    double atom_weight, gate_weight;
    std::int8_t truth;  // demanded of the gate; -1: none
  };

  void load(std::span<const ComponentId> components);
  std::uint32_t local(std::uint32_t node);
  void collect(std::span<const ComponentId> components);
  std::uint32_t network_node(Literal literal) const;
  void index_uses();

  void assign(std::uint32_t node, bool truth);
  bool propagate();
  void settle_gate(std::uint32_t gate);
  void settle_group(std::uint32_t atom);
  void spread(std::uint32_t node);

  void find_pushes();
  void push_input(const Input& input, bool up, bool down);
  bool decide_pure();
  bool decide_block(Group& group);
  bool remove_private_atoms();
  bool remove_private_atom(std::uint32_t atom, std::uint32_t gate);
  void forget_input(std::uint32_t gate, std::uint32_t atom);
  bool build();  // false: two things that became the same contradict each other
  Literal build_gate(NetworkBuilder& builder, std::uint32_t gate, std::vector<Literal>& scratch) const;
  bool truth_of(std::uint32_t node, std::vector<std::int8_t>& truth) const;

  const GroundNetwork* network_;
  std::vector<double> weight_of_node_;  // of the original network
  std::vector<std::uint32_t> local_;    // original node -> node, kNone outside the components

  std::vector<std::uint32_t> original_;  // node -> original node
  std::vector<Kind> kind_;
  std::vector<double> weight_;
  std::vector<std::int8_t> truth_;       // -1: open
  std::vector<std::uint32_t> group_of_;  // atoms
  std::vector<Group> groups_;
  std::vector<std::uint32_t> input_begin_, input_end_;
  std::vector<Input> inputs_;
  std::vector<std::uint32_t> open_inputs_,
      true_inputs_;  // gates: inputs without a truth; true literals among the others
  std::vector<std::uint32_t> use_begin_;
  struct Use {
    std::uint32_t gate;
    bool negated;
  };
  std::vector<Use> uses_;
  std::vector<std::uint8_t> up_, down_;  // making it true, false can help
  std::vector<std::uint32_t> relevant_uses_, relevant_use_;
  std::vector<std::uint32_t> queue_;
  bool conflict_ = false;
  double constant_ = 0.0;
  std::vector<Removal> removals_;
  std::vector<Literal> rest_literal_;
  GroundNetwork rest_;
};

}  // namespace sherlog
