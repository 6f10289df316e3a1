#include "inference/block_recognition.h"

#include <algorithm>
#include <unordered_set>

namespace sherlog {
namespace {

constexpr std::uint32_t kNoGroup = 0xffffffffu;

std::uint64_t pair_key(AtomId a, AtomId b) { return std::uint64_t{std::min(a, b).value} << 32 | std::max(a, b).value; }

// Groups of atoms of which hard clauses demand exactly one.
class Recognition {
 public:
  explicit Recognition(const GroundNetwork& network) : network_(network) {
    group_of_atom_.assign(network.atom_count(), kNoGroup);
    collect_clauses();
    collect_exclusions();
    for (const Constraint& c : network.constraints()) consider(c.literal);
  }
  bool found() const { return !groups_.empty(); }

  RecognisedBlocks rewrite() const {
    RecognisedBlocks result;
    NetworkBuilder builder(network_.names());
    result.atom.resize(network_.atom_count());
    add_variables(builder, result.atom);
    const std::vector<Literal> gates = add_gates(builder, result.atom);
    const auto renamed = [&](Literal l) { return rename(l, result.atom, gates); };
    for (const WeightedInstance& w : network_.weights()) builder.add_weight(w);
    for (const Feature& f : network_.features()) builder.add_feature(renamed(f.literal), f.weight, f.weight_id);
    for (const Constraint& c : network_.constraints()) {
      if (!builder.add_constraint(renamed(c.literal), c.formula)) result.possible = false;
    }
    for (const QueryTarget& q : network_.queries())
      builder.add_query({renamed(q.literal), q.is_formula, q.formula_text});
    result.network = builder.build();
    return result;
  }

 private:
  bool boolean(Literal literal) const {
    if (!literal.is_atom()) return false;
    const VariableId v = network_.variable_of(literal.atom());
    return network_.candidate_count(v) == 1 && network_.has_none(v);
  }

  // Only what a clause of unnegated boolean atoms demands one of can be a group: few atoms, as a rule none.
  void collect_clauses() {
    in_clause_.assign(network_.atom_count(), false);
    for (const Constraint& c : network_.constraints()) {
      if (!is_clause(c.literal)) continue;
      const auto inputs = network_.gate_inputs(c.literal.gate());
      const auto counts = [&](Literal input) { return !input.negated() && boolean(input); };
      if (!std::ranges::all_of(inputs, counts)) continue;
      for (Literal input : inputs) in_clause_[input.atom().index()] = true;
    }
  }

  bool is_clause(Literal literal) const {
    return literal.is_gate() && !literal.negated() && network_.gate_kind(literal.gate()) == GateKind::kOr;
  }

  bool may_group(Literal literal) const { return literal.is_atom() && in_clause_[literal.atom().index()]; }

  void collect_exclusions() {
    for (const Constraint& c : network_.constraints()) {
      if (!is_clause(c.literal)) continue;
      const auto inputs = network_.gate_inputs(c.literal.gate());
      if (inputs.size() != 2 || !inputs[0].negated() || !inputs[1].negated()) continue;
      if (may_group(inputs[0]) && may_group(inputs[1])) excluded_.insert(pair_key(inputs[0].atom(), inputs[1].atom()));
    }
  }

  void consider(Literal literal) {
    if (!is_clause(literal)) return;
    const auto inputs = network_.gate_inputs(literal.gate());
    for (std::size_t i = 0; i < inputs.size(); ++i) {
      if (inputs[i].negated() || !boolean(inputs[i]) || group_of_atom_[inputs[i].atom().index()] != kNoGroup) return;
      if (network_.predicate_of(inputs[i].atom()) != network_.predicate_of(inputs[0].atom())) return;
      for (std::size_t j = 0; j < i; ++j) {
        if (!excluded_.contains(pair_key(inputs[i].atom(), inputs[j].atom()))) return;
      }
    }
    for (Literal input : inputs) group_of_atom_[input.atom().index()] = static_cast<std::uint32_t>(groups_.size());
    groups_.emplace_back(inputs.begin(), inputs.end());
  }

  void add_variables(NetworkBuilder& builder, std::vector<AtomId>& atom) const {
    std::vector<bool> done(groups_.size(), false);
    std::vector<ConstantIndex> arguments;
    for (std::uint32_t v = 0; v < network_.variable_count(); ++v) {
      const VariableId variable(v);
      const AtomId first = network_.first_atom(variable);
      std::vector<AtomId> candidates;
      bool has_none = network_.has_none(variable);
      const std::uint32_t group = network_.candidate_count(variable) == 1 ? group_of_atom_[first.index()] : kNoGroup;
      if (group != kNoGroup) {
        if (done[group]) continue;
        done[group] = true;
        has_none = false;
        for (Literal l : groups_[group]) candidates.push_back(l.atom());
      } else {
        for (std::uint32_t i = 0; i < network_.candidate_count(variable); ++i) candidates.emplace_back(first.value + i);
      }
      arguments.clear();
      for (AtomId a : candidates) {
        const auto own = network_.arguments_of(a);
        arguments.insert(arguments.end(), own.begin(), own.end());
      }
      const VariableId added = builder.add_variable(network_.predicate_of(first), arguments,
                                                    static_cast<std::uint32_t>(candidates.size()), has_none);
      for (std::uint32_t i = 0; i < candidates.size(); ++i) {
        atom[candidates[i].index()] = AtomId(builder.first_atom(added).value + i);
      }
    }
  }

  static Literal rename(Literal literal, const std::vector<AtomId>& atom, const std::vector<Literal>& gates) {
    if (literal.is_constant()) return literal;
    if (literal.is_atom()) return Literal::atom(atom[literal.atom().index()], literal.negated());
    const Literal gate = gates[literal.gate().index()];
    return literal.negated() ? ~gate : gate;
  }

  std::vector<Literal> add_gates(NetworkBuilder& builder, const std::vector<AtomId>& atom) const {
    std::vector<Literal> gates;
    std::vector<Literal> inputs;
    for (std::size_t g = 0; g < network_.gate_count(); ++g) {
      inputs.clear();
      for (Literal input : network_.gate_inputs(GateId(g))) inputs.push_back(rename(input, atom, gates));
      switch (network_.gate_kind(GateId(g))) {
        case GateKind::kOr:
          gates.push_back(builder.make_or(inputs));
          break;
        case GateKind::kIff:
          gates.push_back(builder.make_iff(inputs[0], inputs[1]));
          break;
        case GateKind::kAtMostOne:
          gates.push_back(builder.make_at_most_one(inputs));
          break;
      }
    }
    return gates;
  }

  const GroundNetwork& network_;
  std::vector<bool> in_clause_;  // by atom
  std::unordered_set<std::uint64_t> excluded_;
  std::vector<std::uint32_t> group_of_atom_;
  std::vector<std::vector<Literal>> groups_;
};

}  // namespace

std::optional<RecognisedBlocks> recognise_blocks(const GroundNetwork& network) {
  const Recognition recognition(network);
  if (!recognition.found()) return std::nullopt;
  return recognition.rewrite();
}

}  // namespace sherlog
