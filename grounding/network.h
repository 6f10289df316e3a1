// The ground network: what is left of a model once evidence and query are known.
//
// Idea      Open ground atoms are grouped into random variables: a boolean atom is a variable with the values "true" and
//           "none"; a block (`!` or `?`) of k candidate atoms is one variable with k values, plus "none" for `?`. Ground
//           formulas are a directed acyclic graph of gates over atoms: n-ary OR and binary IFF, with signed inputs (AND is
//           a negated OR of negated inputs). Equal subformulas share a gate. A feature puts a weight on one literal of this
//           graph, so a formula is weighed as a whole whatever its shape; a hard constraint demands one.
// Shapes    Everything is flat arrays with 32-bit ids; gates are in topological order (inputs before the gate); the atoms of
//           a variable are contiguous.
// Score     log of the unnormalised probability of a world x that meets all constraints:
//             constant_score() + sum over features of weight * [literal is true in x]
//           log Z = constant_score() + free_log_count() + log sum over x of exp(features), x over the variables here.
#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "mln/ids.h"

namespace sherlog {

// An atom or gate, or its negation, or one of the constants true and false.
class Literal {
 public:
  constexpr Literal() = default;
  static constexpr Literal atom(AtomId atom, bool negated = false) {
    return Literal(atom.value << 2 | (negated ? 1u : 0u));
  }
  static constexpr Literal gate(GateId gate, bool negated = false) {
    return Literal(gate.value << 2 | 2u | (negated ? 1u : 0u));
  }
  static constexpr Literal constant(bool value) { return Literal(value ? kTrueCode : kTrueCode | 1u); }
  static constexpr Literal from_code(std::uint32_t code) { return Literal(code); }

  constexpr bool negated() const { return (code_ & 1u) != 0; }
  constexpr bool is_constant() const { return (code_ | 1u) == (kTrueCode | 1u); }
  constexpr bool is_gate() const { return (code_ & 2u) != 0; }  // kTrueCode has this bit clear
  constexpr bool is_atom() const { return !is_gate() && !is_constant(); }
  constexpr AtomId atom() const { return AtomId(code_ >> 2); }
  constexpr GateId gate() const { return GateId(code_ >> 2); }
  constexpr std::uint32_t code() const { return code_; }
  constexpr Literal operator~() const { return Literal(code_ ^ 1u); }
  constexpr auto operator<=>(const Literal&) const = default;

 private:
  static constexpr std::uint32_t kTrueCode = 0xfffffffcu;  // an atom id that no network reaches
  constexpr explicit Literal(std::uint32_t code) : code_(code) {}
  std::uint32_t code_ = kTrueCode;
};

enum class GateKind : std::uint8_t {
  kOr,   // two or more inputs, sorted, of distinct nodes
  kIff,  // two inputs, both unnegated, of distinct nodes
  // At most one of two or more inputs is true. The grounder makes none: methods fold pairwise constraints into these, see
  // inference/at_most_one.h.
  kAtMostOne,
};

// Whether a gate of this kind is true with so many true inputs.
constexpr bool gate_truth(GateKind kind, std::uint32_t true_inputs) {
  switch (kind) {
    case GateKind::kOr:
      return true_inputs > 0;
    case GateKind::kIff:
      return true_inputs != 1;
    case GateKind::kAtMostOne:
      return true_inputs <= 1;
  }
  return false;
}

inline constexpr std::uint32_t kNoBinding = 0xffffffffu;

// `weight` is added where `literal` is true. Merged from `count` equal ground formulas of one weight.
struct Feature {
  Literal literal;      // unnegated atom or gate (a negated one was turned round into constant_score)
  double weight = 0.0;  // nats; count times the formula's weight, with its sign turned where the literal was
  WeightId weight_id;   // whose ground formula it is; kVirtualEvidence for soft evidence
  std::uint32_t count = 1;
  bool turned = false;                 // the ground formula is the negation of `literal`
  std::uint32_t binding = kNoBinding;  // of one of them, see GroundNetwork::binding
};
inline constexpr WeightId kVirtualEvidence{0xffffffffu};

// `literal` is true in every possible world.
struct Constraint {
  Literal literal;
  FormulaId formula;
  std::uint32_t binding = kNoBinding;
};

// One weight: a formula of the model, for one choice of constants for its + variables.
struct WeightedInstance {
  FormulaId formula;
  std::vector<ConstantIndex> plus_constants;  // in the order of the formula's + variables
  double weight = 0.0;
};

// A queried atom or formula. `literal` is never constant for an atom; for a formula it may be.
struct QueryTarget {
  Literal literal;
  bool is_formula = false;
  std::string formula_text;  // is_formula
};

// Soft evidence under the reading "the posterior equals p" (jeffrey).
struct SoftTarget {
  AtomId atom;
  double probability = 0.5;
};

// Names for messages and results, copied so that a network outlives its model.
struct NameTable {
  std::vector<std::string> predicates;
  std::vector<std::vector<std::uint32_t>> predicate_domains;  // domain of each argument
  std::vector<std::vector<std::string>> constants;            // by domain: the model's, then the evidence's
};

class GroundNetwork {
 public:
  // --- variables and atoms
  std::size_t variable_count() const { return first_atom_.size() - 1; }
  std::size_t atom_count() const { return atom_variable_.size(); }
  AtomId first_atom(VariableId v) const { return AtomId(first_atom_[v.index()]); }
  std::uint32_t candidate_count(VariableId v) const { return first_atom_[v.index() + 1] - first_atom_[v.index()]; }
  bool has_none(VariableId v) const { return has_none_[v.index()]; }
  // Values 0..candidate_count-1: that candidate atom is true and its siblings are false; value candidate_count (only where
  // has_none): all are false. A boolean atom has the values 0 = true and 1 = false.
  std::uint32_t value_count(VariableId v) const { return candidate_count(v) + (has_none_[v.index()] ? 1u : 0u); }
  VariableId variable_of(AtomId a) const { return VariableId(atom_variable_[a.index()]); }
  std::uint32_t value_of(AtomId a) const { return a.value - first_atom_[atom_variable_[a.index()]]; }
  PredicateId predicate_of(AtomId a) const { return PredicateId(atom_predicate_[a.index()]); }
  std::span<const ConstantIndex> arguments_of(AtomId a) const {
    const auto begin = atom_arguments_start_[a.index()];
    return {atom_arguments_.data() + begin, names_.predicate_domains[atom_predicate_[a.index()]].size()};
  }
  std::string atom_text(AtomId a) const;
  // The literal's formula over open atoms, e.g. "!Smokes(Anna) v Cancer(Anna)"; cut with "..." beyond `max_length`.
  std::string literal_text(Literal literal, std::size_t max_length = 400) const;

  // --- gates
  std::size_t gate_count() const { return gate_kind_.size(); }
  GateKind gate_kind(GateId g) const { return gate_kind_[g.index()]; }
  std::span<const Literal> gate_inputs(GateId g) const {
    return {gate_inputs_.data() + gate_start_[g.index()], gate_start_[g.index() + 1] - gate_start_[g.index()]};
  }

  // --- features, constraints, weights
  std::span<const Feature> features() const { return features_; }
  std::span<const Constraint> constraints() const { return constraints_; }
  std::span<const WeightedInstance> weights() const { return weights_; }
  // Constants of the formula's outer variables (in the order of Formula::variables, quantified ones left out).
  std::span<const ConstantIndex> binding(std::uint32_t id) const {
    return {bindings_.data() + binding_start_[id], binding_start_[id + 1] - binding_start_[id]};
  }
  double constant_score() const { return constant_score_; }
  double free_log_count() const { return free_log_count_; }
  // Ground formulas before simplification and merging, all formulas together (as a real number: it can exceed 2^64).
  double grounding_count() const { return grounding_count_; }
  std::size_t evidence_atom_count() const { return evidence_atom_count_; }

  // --- what is asked
  std::span<const QueryTarget> queries() const { return queries_; }
  std::span<const SoftTarget> soft_targets() const { return soft_targets_; }

  // --- connected components: variables joined by a feature, a constraint or a queried formula
  std::size_t component_count() const { return component_variables_start_.size() - 1; }
  ComponentId component_of(VariableId v) const { return ComponentId(variable_component_[v.index()]); }
  // Component of a non-constant literal.
  ComponentId component_of(Literal literal) const;
  std::span<const VariableId> component_variables(ComponentId c) const;
  std::span<const std::uint32_t> component_features(ComponentId c) const;     // indices into features()
  std::span<const std::uint32_t> component_constraints(ComponentId c) const;  // indices into constraints()
  std::span<const std::uint32_t> component_queries(ComponentId c) const;      // indices into queries()

  const NameTable& names() const { return names_; }
  std::size_t memory_bytes() const;

 private:
  friend class NetworkBuilder;
  friend GroundNetwork reweighted(const GroundNetwork& network, std::span<const double> weight_by_id);
  std::vector<std::uint32_t> first_atom_{0};  // variable_count + 1 entries
  std::vector<bool> has_none_;
  std::vector<std::uint32_t> atom_variable_, atom_predicate_, atom_arguments_start_;
  std::vector<ConstantIndex> atom_arguments_;
  std::vector<GateKind> gate_kind_;
  std::vector<std::uint32_t> gate_start_{0};
  std::vector<Literal> gate_inputs_;
  std::vector<Feature> features_;
  std::vector<Constraint> constraints_;
  std::vector<WeightedInstance> weights_;
  std::vector<std::uint32_t> binding_start_{0};
  std::vector<ConstantIndex> bindings_;
  std::vector<QueryTarget> queries_;
  std::vector<SoftTarget> soft_targets_;
  double constant_score_ = 0.0;
  double free_log_count_ = 0.0;
  double grounding_count_ = 0.0;
  std::size_t evidence_atom_count_ = 0;
  std::vector<std::uint32_t> variable_component_;
  std::vector<std::uint32_t> component_variables_start_{0}, component_features_start_{0},
      component_constraints_start_{0}, component_queries_start_{0};
  std::vector<VariableId> component_variables_;
  std::vector<std::uint32_t> component_features_, component_constraints_, component_queries_;
  NameTable names_;
};

// A copy with other weights: `weight_by_id` has one for each of network.weights(), and every feature that comes from a
// formula gets count times its own. Soft evidence keeps its weights. constant_score moves with the features whose literal
// was turned round, so that differences of scores between worlds, and between weights as far as they concern features, are
// right; what grounding decided (ground formulas that are true in every world) stays in it at the old weights.
GroundNetwork reweighted(const GroundNetwork& network, std::span<const double> weight_by_id);

// Makes a GroundNetwork piece by piece. Gates are simplified and shared as they are made.
class NetworkBuilder {
 public:
  explicit NetworkBuilder(NameTable names = {});
  // Goes on from a finished network; atoms, variables, features and queries keep their numbers.
  explicit NetworkBuilder(const GroundNetwork& network);

  // `arguments`: the candidates' arguments, one candidate after the other (count * arity constants).
  VariableId add_variable(PredicateId predicate, std::span<const ConstantIndex> arguments, std::uint32_t count,
                          bool has_none);
  // A boolean atom or block without a name, for tests: shown as "X0", "X1(0)", ...
  VariableId add_boolean() { return add_anonymous(1, true); }
  VariableId add_anonymous(std::uint32_t candidates, bool has_none);
  AtomId first_atom(VariableId v) const { return network_.first_atom(v); }
  std::size_t atom_count() const { return network_.atom_count(); }
  const GroundNetwork& so_far() const { return network_; }

  // OR of the inputs (reordered in place): constants, repetitions, complements and blocks are simplified away (two different
  // values denied of one block: true; every value of a block without "none": true), and short ORs
  // among the inputs are taken apart.
  Literal make_or(std::vector<Literal>& inputs);
  Literal make_and(std::vector<Literal>& inputs);  // the inputs come back negated
  Literal make_iff(Literal a, Literal b);
  // At most one of these is true: two or more distinct literals, none of them constant.
  Literal make_at_most_one(std::vector<Literal> inputs);

  WeightId add_weight(WeightedInstance instance);
  // weight * [literal]. Equal (literal, weight_id) are merged; a constant literal goes into constant_score; weight 0 is dropped.
  void add_feature(Literal literal, double weight, WeightId weight_id, std::span<const ConstantIndex> binding = {});
  // Demands the literal; a conjunction is split; a constant true is dropped. Returns false where the literal is constant
  // false: no world is possible (nothing is recorded).
  bool add_constraint(Literal literal, FormulaId formula, std::span<const ConstantIndex> binding = {});
  // Hands all features over; the network has none then.
  std::vector<Feature> take_features() { return std::exchange(network_.features_, {}); }
  // By index; the others move up.
  void remove_constraints(std::span<const std::uint32_t> indices);
  void add_query(QueryTarget target) { network_.queries_.push_back(std::move(target)); }
  void add_soft_target(SoftTarget target) { network_.soft_targets_.push_back(target); }
  void add_constant_score(double score) { network_.constant_score_ += score; }
  void add_free_log_count(double log_count) { network_.free_log_count_ += log_count; }
  void add_grounding_count(double count) { network_.grounding_count_ += count; }
  void set_evidence_atom_count(std::size_t count) { network_.evidence_atom_count_ = count; }

  std::size_t memory_bytes() const;
  // Finds the components (Boost.Graph's disjoint sets). The builder is empty afterwards.
  GroundNetwork build();

 private:
  Literal intern(GateKind kind, std::span<const Literal> inputs);
  std::uint32_t store_binding(std::span<const ConstantIndex> binding);
  void index_gate(std::uint32_t hash);
  // Room for one more gate in the table.
  void grow_gate_table();
  // Gates that only led to something simplified away would join components that have nothing to do with each other.
  void drop_unused_gates();

  GroundNetwork network_;
  std::vector<std::uint64_t> gate_table_;  // open addressing: hash (upper half) and gate id + 1, or 0
  std::size_t gates_in_table_ = 0;
  std::vector<std::uint32_t> feature_table_;  // open addressing: feature + 1, or 0
  std::vector<bool> constrained_;             // by code of a literal: a constraint demands it
  std::uint32_t anonymous_count_ = 0;
};

}  // namespace sherlog
