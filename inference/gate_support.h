// What the gates of a component depend on, in the variables of its factor graph.
//
// Idea      A gate is decided by propagation or by its inputs. An open one depends on the variables of its open inputs;
//           as long as these have few joint values, its truth can be listed for each of them.
// Cost      O(gate inputs x variables of a support); a truth table: O(gates below x joint values / 64), plus the joint
//           values for each atom below.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <unordered_map>
#include <vector>

#include "inference/factor_graph.h"
#include "inference/propagation.h"

namespace sherlog {

// Truth for each joint value of a scope, 64 to a word; bits behind the last value mean nothing.
using BitTable = std::vector<std::uint64_t>;

inline bool bit_of(const BitTable& bits, std::size_t i) { return (bits[i / 64] >> (i % 64) & 1u) != 0; }

class GateSupports {
 public:
  // With more joint values a gate is wide: its truth is not to be listed.
  static constexpr std::uint64_t kMostJoint = 65536;

  struct Gate {
    GateId id;
    Truth truth = Truth::kOpen;          // by propagation, or as its inputs say
    bool demanded = false;               // propagation says so, its inputs do not: to be enforced
    bool wide = false;                   // more than kMostJoint joint values: `support` is not kept
    std::vector<std::uint32_t> support;  // variables of the graph, sorted
    std::uint64_t joint = 1;
  };

  // Of a component whose variables have their bindings in `graph`; all three are kept by reference, and what the graph
  // gets later (auxiliary variables, tables) changes nothing here.
  GateSupports(const GroundNetwork& network, const Propagation& propagation, const FactorGraph& graph)
      : network_(network), propagation_(propagation), graph_(graph) {}

  // The variable's binding is graph.bindings[place].
  void bind(VariableId variable, std::uint32_t place) { binding_of_.emplace(variable.value, place); }
  // Looks at the gates that `roots` need, after all variables are bound; false: `out_of_time` said to stop.
  bool collect(std::span<const Literal> roots, const std::function<bool()>& out_of_time);

  std::span<const Gate> gates() const { return gates_; }  // sorted by id: inputs before gates
  std::uint32_t number(GateId gate) const { return number_.at(gate.value); }
  const Gate& gate(GateId gate) const { return gates_[number(gate)]; }

  // Of an atom of the component, or of a gate that was collected.
  Truth truth(Literal literal) const;
  ValueTest value_test(VariableId variable, std::uint32_t value) const;
  ValueTest value_test(AtomId atom) const { return value_test(network_.variable_of(atom), network_.value_of(atom)); }
  // Over the gate's support, the last variable runs fastest; the gate is open and not wide.
  BitTable truth_table(const Gate& gate) const;

 private:
  const FactorGraph::Binding& binding(VariableId variable) const {
    return graph_.bindings[binding_of_.at(variable.value)];
  }
  Truth derived(GateId gate) const;
  void look_at(Gate& gate) const;
  void extend(Gate& gate, std::span<const std::uint32_t> variables) const;
  BitTable test_table(const ValueTest& test, const Gate& gate) const;

  const GroundNetwork& network_;
  const Propagation& propagation_;
  const FactorGraph& graph_;
  std::unordered_map<std::uint32_t, std::uint32_t> binding_of_, number_;
  std::vector<Gate> gates_;
};

}  // namespace sherlog
