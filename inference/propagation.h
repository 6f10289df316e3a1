// What hard constraints decide by themselves: unit propagation over gates and blocks.
//
// Idea      Atoms and gates are nodes that are true, false or open. A node that gets a truth is pushed through every
//           gate that uses it (an OR with a true input is true, ...), through its own gate (a false OR has false
//           inputs, a true OR with one input left makes it true) and through its variable (one true atom makes its
//           siblings false; a block without "none" whose other atoms are false has the last one true). Each
//           consequence remembers which gate or variable forced it, so that a contradiction is traced back to the
//           constraints that took part. Decisions can be tried and taken back, which makes it the engine of a small
//           complete search too.
// Cost      O(size of the constraints' formulas) for a full run; memory likewise (the rest of the network is not
//           looked at).
#pragma once

#include <cstdint>
#include <span>
#include <unordered_map>
#include <vector>

#include "grounding/network.h"

namespace sherlog {

enum class Truth : std::uint8_t { kFalse, kTrue, kOpen };

class Propagation {
 public:
  // Of a component, or of some of its constraints (indices into network.constraints()).
  Propagation(const GroundNetwork& network, std::span<const std::uint32_t> constraints);
  Propagation(const GroundNetwork& network, ComponentId component)
      : Propagation(network, network.component_constraints(component)) {}

  // Demands all constraints; false: they contradict each other, see conflict().
  bool run();

  // kOpen for what no constraint mentions.
  Truth truth(Literal literal) const;
  // Whether the variable may have the value. "none" counts as possible until an atom is true.
  bool allowed(VariableId variable, std::uint32_t value) const;
  // Constraints (indices) that took part in the contradiction, sorted; decisions are not among them.
  const std::vector<std::uint32_t>& conflict() const { return conflict_; }

  // Atoms that the constraints mention, and gates.
  std::span<const Literal> mentioned() const { return literals_; }
  // In how many gates a mentioned literal is an input.
  std::size_t use_count(Literal literal) const;

  // Search: decide something, propagate; false where that contradicts. Levels are taken back in reverse order; after a
  // contradiction only `backtrack` is of use.
  bool decide(Literal literal);
  void backtrack();  // undoes the last decision
  std::size_t level() const { return level_start_.size(); }

 private:
  enum class Reason : std::uint8_t { kConstraint, kGate, kVariable, kDecision };
  struct Node {
    std::uint32_t use_begin = 0, use_end = 0;  // gates (local numbers) that use it
    std::uint32_t reason_index = 0;            // constraint, local gate or local variable
    std::uint32_t time = 0;                    // position on the trail
    std::uint32_t gate = kNone;                // local gate, or kNone for an atom
    std::uint32_t variable = kNone;            // local variable of an atom
    Reason reason = Reason::kDecision;
    Truth truth = Truth::kOpen;
  };
  struct Gate {
    std::uint32_t node = 0;
    std::uint32_t input_begin = 0, input_end = 0;  // into inputs_
    std::uint32_t open = 0, satisfied = 0;         // inputs
    GateKind kind = GateKind::kOr;
  };
  struct Input {
    std::uint32_t node;
    bool negated;
  };
  struct Variable {
    VariableId id;
    std::uint32_t atom_begin = 0, atom_end = 0;  // into variable_nodes_
    std::uint32_t open = 0;                      // candidates not denied, those not mentioned included
    std::uint32_t true_atoms = 0;
  };
  static constexpr std::uint32_t kNone = 0xffffffffu;

  std::uint32_t add_node(Literal unnegated);
  void add_formula(Literal root);
  void link_uses();
  void link_variables();
  bool assign(std::uint32_t node, bool value, Reason reason, std::uint32_t reason_index);
  bool propagate();
  void count(std::uint32_t node, bool undo);
  bool check_gate(std::uint32_t gate);
  bool check_or(std::uint32_t gate);
  bool check_iff(std::uint32_t gate);
  bool check_at_most_one(std::uint32_t gate);
  bool force_open_inputs(std::uint32_t gate, bool value);
  bool check_variable(std::uint32_t node);
  bool true_input(const Input& input) const {
    return nodes_[input.node].truth == (input.negated ? Truth::kFalse : Truth::kTrue);
  }
  bool open(std::uint32_t node) const { return nodes_[node].truth == Truth::kOpen; }
  void explain(std::vector<std::uint32_t> nodes);
  // Nodes older than `time` that made a gate or variable give `node` its truth.
  void antecedents(std::uint32_t node, bool value, Reason reason, std::uint32_t reason_index, std::uint32_t time,
                   std::vector<std::uint32_t>& out) const;

  const GroundNetwork* network_;
  std::vector<std::uint32_t> constraints_;
  std::unordered_map<std::uint32_t, std::uint32_t> node_of_;      // unnegated literal code -> node
  std::unordered_map<std::uint32_t, std::uint32_t> variable_of_;  // network variable -> local variable
  std::vector<Literal> literals_;                                 // by node
  std::vector<Node> nodes_;
  std::vector<Gate> gates_;
  std::vector<Input> inputs_;
  std::vector<std::uint32_t> uses_;  // gate * 2 + negated
  std::vector<Variable> variables_;
  std::vector<std::uint32_t> variable_nodes_;
  std::vector<std::uint32_t> trail_;
  std::vector<std::size_t> level_start_;
  std::size_t head_ = 0;  // entries of the trail before it are in the counters of gates and variables
  std::vector<std::uint32_t> conflict_;
};

}  // namespace sherlog
