#include "grounding/contradiction.h"

#include <algorithm>
#include <numeric>

namespace sherlog {
namespace {

constexpr std::size_t kMostToShrink = 64;

class Propagation {
 public:
  // `subset`: indices of the constraints to be used.
  Propagation(const GroundNetwork& network, const std::vector<std::uint32_t>& subset)
      : network_(network), truth_(network.atom_count(), kUnknown), reason_(network.atom_count()) {
    clauses_.reserve(subset.size());
    for (std::uint32_t constraint : subset) {
      const Literal literal = network.constraints()[constraint].literal;
      const bool is_clause =
          literal.is_gate() && !literal.negated() && network.gate_kind(literal.gate()) == GateKind::kOr;
      if (!literal.is_atom() && !is_clause) continue;
      clauses_.push_back(
          {constraint, static_cast<std::uint32_t>(is_clause ? network.gate_inputs(literal.gate()).size() : 1)});
    }
  }

  // Constraints that lead to a contradiction.
  std::vector<std::uint32_t> refute() {
    if (std::ranges::none_of(clauses_, [](const Clause& c) { return c.not_false == 1; })) return {};
    list_occurrences();
    false_siblings_.assign(network_.variable_count(), 0);
    for (std::uint32_t c = 0; c < clauses_.size() && !failed_; ++c) {
      if (clauses_[c].not_false == 1) last_input(c);
    }
    for (std::size_t done = 0; done < trail_.size() && !failed_; ++done) visit(trail_[done]);
    return failed_ ? culprits() : std::vector<std::uint32_t>();
  }

 private:
  enum Truth : std::uint8_t { kFalse, kTrue, kUnknown };
  static constexpr std::uint32_t kBlock = 0xffffffffu;

  struct Clause {
    std::uint32_t constraint;
    std::uint32_t not_false;  // inputs; one that is a gate counts for ever
  };

  template <class Visit>
  void for_each_input(const Clause& clause, Visit visit) const {
    const Literal literal = network_.constraints()[clause.constraint].literal;
    if (literal.is_atom()) {
      visit(literal);
    } else {
      for (Literal input : network_.gate_inputs(literal.gate())) visit(input);
    }
  }

  // The clauses in which each literal of an atom occurs, one list after the other.
  void list_occurrences() {
    start_.assign(2 * network_.atom_count() + 1, 0);
    for (const Clause& clause : clauses_) {
      for_each_input(clause, [&](Literal l) { start_[l.is_atom() ? slot(l) + 1 : 0] += l.is_atom() ? 1u : 0u; });
    }
    std::partial_sum(start_.begin(), start_.end(), start_.begin());
    occurrences_.resize(start_.back());
    std::vector<std::uint32_t> next(start_.begin(), start_.end() - 1);
    for (std::uint32_t c = 0; c < clauses_.size(); ++c) {
      for_each_input(clauses_[c], [&](Literal l) {
        if (l.is_atom()) occurrences_[next[slot(l)]++] = c;
      });
    }
  }
  static std::size_t slot(Literal l) { return 2 * l.atom().index() + (l.negated() ? 1u : 0u); }

  bool is_false(Literal l) const { return l.is_atom() && truth_[l.atom().index()] == (l.negated() ? kTrue : kFalse); }

  // All inputs of the clause but one are false.
  void last_input(std::uint32_t c) {
    for_each_input(clauses_[c], [&](Literal l) {
      if (l.is_atom() && !is_false(l)) assign(l, c);
    });
  }

  void assign(Literal literal, std::uint32_t reason) {
    std::uint8_t& truth = truth_[literal.atom().index()];
    if (truth != kUnknown) return;  // true already; false ones are never assigned
    truth = literal.negated() ? kFalse : kTrue;
    reason_[literal.atom().index()] = reason;
    trail_.push_back(literal);
  }

  void visit(Literal literal) {
    const std::size_t denied = slot(~literal);
    for (std::uint32_t i = start_[denied]; i < start_[denied + 1]; ++i) {
      const std::uint32_t c = occurrences_[i];
      if (--clauses_[c].not_false == 0) return fail_clause(c);
      if (clauses_[c].not_false == 1) last_input(c);
    }
    const VariableId variable = network_.variable_of(literal.atom());
    if (network_.candidate_count(variable) > 1) visit_block(variable, literal);
  }

  void visit_block(VariableId variable, Literal literal) {
    const std::uint32_t first = network_.first_atom(variable).value, count = network_.candidate_count(variable);
    if (!literal.negated()) {
      for (std::uint32_t a = first; a < first + count; ++a) {
        if (a == literal.atom().value) continue;
        if (truth_[a] == kTrue) return fail_atoms({AtomId(a), literal.atom()});
        assign(Literal::atom(AtomId(a), true), kBlock);
      }
    } else if (!network_.has_none(variable) && ++false_siblings_[variable.index()] + 1 >= count) {
      std::vector<AtomId> all;
      for (std::uint32_t a = first; a < first + count; ++a) {
        all.emplace_back(a);
        if (truth_[a] != kFalse) return assign(Literal::atom(AtomId(a)), kBlock);
      }
      fail_atoms(all);
    }
  }

  void fail_clause(std::uint32_t c) {
    failed_ = true;
    needed_.push_back(c);
  }
  void fail_atoms(const std::vector<AtomId>& atoms) {
    failed_ = true;
    failed_atoms_ = atoms;
  }

  // From the contradiction back to the constraints that caused it.
  std::vector<std::uint32_t> culprits() {
    std::vector<bool> seen(network_.atom_count(), false);
    std::vector<AtomId> open;
    const auto explain = [&](AtomId a) {
      if (truth_[a.index()] == kUnknown || seen[a.index()]) return;
      seen[a.index()] = true;
      open.push_back(a);
    };
    const auto explain_clause = [&](std::uint32_t c) {
      for_each_input(clauses_[c], [&](Literal l) {
        if (is_false(l)) explain(l.atom());
      });
    };
    for (std::uint32_t c : needed_) explain_clause(c);
    for (AtomId a : failed_atoms_) explain(a);
    while (!open.empty()) {
      const AtomId a = open.back();
      open.pop_back();
      const std::uint32_t reason = reason_[a.index()];
      if (reason != kBlock) {
        needed_.push_back(reason);
        explain_clause(reason);
        continue;
      }
      const VariableId variable =
          network_.variable_of(a);  // the true sibling denied it, or the false ones left it alone
      const bool was_denied = truth_[a.index()] == kFalse;
      for (std::uint32_t v = 0; v < network_.candidate_count(variable); ++v) {
        const AtomId sibling(network_.first_atom(variable).value + v);
        if (truth_[sibling.index()] == (was_denied ? kTrue : kFalse)) explain(sibling);
      }
    }
    std::vector<std::uint32_t> constraints;
    for (std::uint32_t c : needed_) constraints.push_back(clauses_[c].constraint);
    std::ranges::sort(constraints);
    constraints.erase(std::unique(constraints.begin(), constraints.end()), constraints.end());
    return constraints;
  }

  const GroundNetwork& network_;
  std::vector<Clause> clauses_;
  std::vector<std::uint32_t> start_, occurrences_;
  std::vector<std::uint8_t> truth_;            // by atom
  std::vector<std::uint32_t> reason_;          // by atom: clause, or kBlock
  std::vector<std::uint32_t> false_siblings_;  // by variable
  std::vector<Literal> trail_;
  bool failed_ = false;
  std::vector<std::uint32_t> needed_;  // clauses
  std::vector<AtomId> failed_atoms_;
};

}  // namespace

std::vector<std::uint32_t> contradicting_constraints(const GroundNetwork& network) {
  std::vector<std::uint32_t> all(network.constraints().size());
  std::iota(all.begin(), all.end(), 0u);
  std::vector<std::uint32_t> core = Propagation(network, all).refute();
  for (std::size_t i = 0; core.size() <= kMostToShrink && i < core.size();) {
    std::vector<std::uint32_t> fewer = core;
    fewer.erase(fewer.begin() + static_cast<std::ptrdiff_t>(i));
    const std::vector<std::uint32_t> smaller = Propagation(network, fewer).refute();
    if (smaller.empty()) {
      ++i;
    } else {
      core = smaller;  // constraints before i were found to be needed, so they are still there
    }
  }
  return core;
}

}  // namespace sherlog
