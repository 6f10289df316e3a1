// A component of a ground network as multi-valued variables and dense tables: what elimination works on.
//
// Idea      Hard constraints are propagated first; values they exclude are dropped and formulas they decide vanish. A
//           formula over few joint values becomes one table. A longer one gets auxiliary boolean variables that its
//           inputs determine: an OR of n inputs becomes the chain p_i = p_(i-1) v input_i in the order of the
//           variables, so that the state to carry along is one bit instead of n variables; an IFF compares two of
//           them. Inputs of one variable are joined to one test "its value is among these". Chains with equal
//           beginnings share them, an at-most-one group is the same chain plus "not both p_(i-1) and input_i", and an
//           OR that contains a whole group uses its end: formulas about the same row or column cost one bit together.
//           Auxiliary variables have one value for each world, so sums are unchanged.
// Source    Díez & Galán, Int. J. Intelligent Systems 18, 2003 (causal independence by auxiliary variables), for
//           chains.
// Cost      O(gates x joint values of small formulas + tables), memory of the tables.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "grounding/network.h"
#include "mln/monitor.h"

namespace sherlog {

// "The variable's value is among these", or a constant.
struct ValueTest {
  static constexpr std::uint32_t kConstant = 0xffffffffu;
  std::uint32_t variable = kConstant;
  std::vector<std::uint8_t> accepted;  // by value; a constant: one entry

  static ValueTest constant(bool value) { return {kConstant, {static_cast<std::uint8_t>(value ? 1 : 0)}}; }
  bool is_constant() const { return variable == kConstant; }
  bool value() const { return accepted[0] != 0; }  // of a constant
  bool operator==(const ValueTest&) const = default;
};

struct FactorGraph {
  // A network variable: its values that are left, by value of the graph's variable; fixed where `variable` is
  // kConstant.
  struct Binding {
    std::uint32_t variable = ValueTest::kConstant;
    std::vector<std::uint32_t> values;
  };

  // A feature that is neither true nor false in every world, with FactorGraphOptions::keep_features.
  struct OpenFeature {
    std::uint32_t feature = 0;  // index into network.features()
    std::uint32_t scope = 0;    // of the table that it would weigh
    bool negated = false;
    std::vector<std::uint32_t> entries;  // of that table: where its literal is true, or where it is false (negated),
                                         // whichever are fewer; increasing
  };

  bool possible = true;                            // false: propagation alone found a contradiction
  std::vector<std::uint32_t> conflict;             // then: constraints that take part in it
  bool too_large = false;                          // the tables alone exceed the memory limit
  bool stopped = false;                            // not finished: FactorGraphOptions::stop said so
  double constant = 0.0;                           // log: what is decided
  std::vector<std::uint32_t> cardinalities;        // network variables first, auxiliary ones behind
  std::vector<std::uint32_t> sweep;                // all variables, each where the network's order last needs it
  std::vector<std::vector<std::uint32_t>> scopes;  // distinct, sorted, not empty
  std::vector<std::vector<double>> tables;         // natural logarithms, the last variable runs fastest
  std::vector<Binding> bindings;                   // in the order of network.component_variables()
  std::vector<ValueTest> queries;                  // in the order of network.component_queries()
  std::vector<OpenFeature> features;               // with keep_features only, in the order of the network
  std::vector<std::uint32_t> true_features;        // with keep_features only: true in every world, in no special order
  std::size_t table_bytes = 0;
};

struct FactorGraphOptions {
  std::span<const double> atom_bias;  // by atom of the network, or empty
  bool with_queries = true;
  std::size_t max_bytes = static_cast<std::size_t>(-1);
  // A formula over at most so many joint values becomes one table. Larger: wider tables; smaller: more auxiliary
  // variables.
  std::uint64_t small_joint = 64;
  // Features add no weight, neither to tables nor to `constant`; FactorGraph::features says where they would. For those
  // who change weights and keep the rest.
  bool keep_features = false;
  const StopCondition* stop = nullptr;  // asked every few thousand formulas
};

FactorGraph compile_factor_graph(const GroundNetwork& network, ComponentId component,
                                 const FactorGraphOptions& options = {});

}  // namespace sherlog
