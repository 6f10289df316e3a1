// Grounds one formula: visits the assignments of its variables that the evidence does not decide at a glance.
//
// Idea      A disjunction is true wherever one disjunct is: only assignments under which no disjunct is decided true
//           matter. A conjunction is false wherever one conjunct is. Both are conjunctive queries over goals: an atom
//           that must not be false, one that must not be true, a comparison, or something nested that must not be
//           decided. Goals on predicates whose atoms are listed generate bindings through an index; equalities bind one
//           side by the other; variables that nothing generates run through their domain. The order is greedy: the
//           generator with the fewest expected matches first. Every goal is tested as soon as its variables are bound,
//           and what is left undecided at the end is the ground formula. Quantified subformulas are grounded the same
//           way, inside. An equivalence at the top is true wherever both of its implications are: it is grounded where one
//           of them is not decided true, found by the join for that one. (Joins for grounding: Niu, Re, Doan & Shavlik, "Tuffy", VLDB 2011; ours run on indexes in
//           memory, three-valued, and whole formulas rather than clauses come out.)
// Cost      one step for each partial binding that survives; nothing is allocated in the loops.
#pragma once

#include <functional>
#include <memory>
#include <optional>

#include "grounding/normal_form.h"
#include "mln/monitor.h"

namespace sherlog {

// A conjunctive query and the order in which its variables are bound.
struct JoinPlan {
  enum class StepKind : std::uint8_t { kScan, kDomain, kEqual };
  struct Step {
    StepKind kind = StepKind::kDomain;
    std::uint32_t variable = 0;                                  // kDomain, kEqual
    std::uint32_t size = 0;                                      // kDomain: of the domain
    Term from;                                                   // kEqual
    std::uint32_t goal = 0;                                      // kScan
    const AtomIndex* index = nullptr;                            // kScan
    std::size_t arity = 0;                                       // kScan
    std::vector<Term> key_terms;                                 // kScan: what is known of the atom
    std::vector<ConstantIndex> key;                              // kScan: its values
    std::vector<std::pair<std::uint32_t, std::uint32_t>> binds;  // kScan: position, variable
    std::vector<std::pair<std::uint32_t, std::uint32_t>> same;   // kScan: the same, bound by an earlier position
    std::vector<std::uint32_t> checks;                           // goals to test now
  };

  bool disjunctive = false;  // the goals are that the parts are not true, and what is left is their OR; else AND
  std::vector<NormalNode*> goals;
  std::vector<std::uint32_t> first_checks;
  std::vector<Step> steps;
  double visits = 0, leaves = 0;  // expected
  // Working memory: what is left of each goal (0: nothing, or an atom's code, or 1 for something nested), and their
  // literals.
  std::vector<std::uint32_t> left_over;
  std::vector<Literal> literals;
};

// Asked every few thousand steps; false stops the work.
using KeepGoing = std::function<bool()>;

class FormulaJoin {
 public:
  // `root` is moved in. `outer`: the variables to be enumerated. `filters`: goals beside the formula.
  // `disjunctive`: unvisited assignments are those that the evidence makes true (else: false).
  FormulaJoin(NormalNode root, const Formula& formula, const std::vector<std::uint32_t>& outer,
              std::vector<NormalNode> filters, bool disjunctive, AtomTable& atoms, NetworkBuilder& builder,
              KeepGoing keep_going);
  FormulaJoin(const FormulaJoin&) = delete;
  FormulaJoin& operator=(const FormulaJoin&) = delete;

  // An equivalence `root` (shape kIff) is grounded where `implication`, one of the two that it consists of, is not true at a glance.
  // `other`: the other one, where it had its turn already; assignments under which it is not true at a glance are left out.
  FormulaJoin(NormalNode root, NormalNode implication, std::optional<NormalNode> other, const Formula& formula,
              const std::vector<std::uint32_t>& outer, std::vector<NormalNode> filters, AtomTable& atoms,
              NetworkBuilder& builder, KeepGoing keep_going);

  // Expected numbers of steps and of ground formulas.
  double expected_visits() const { return total_visits_; }
  double expected_leaves() const { return plans_.front()->leaves; }

  // Calls leaf(values by variable, literal) for each assignment that is not decided at a glance; the literal may turn
  // out constant all the same. leaf returns false to stop. Returns false where it was stopped.
  template <class Leaf>
  bool run(Leaf leaf) {
    JoinPlan& plan = *plans_.front();
    return start(plan, [&](Literal literal) { return leaf(std::as_const(values_), literal); });
  }

 private:
  std::size_t make_plan(bool disjunctive, std::vector<NormalNode*> goals, const std::vector<std::uint32_t>& to_bind,
                        std::vector<bool>& bound);
  void plan_inside(NormalNode& node, std::vector<bool>& bound);
  void next_step(JoinPlan& plan, std::vector<std::uint32_t>& pending, std::vector<bool>& bound,
                 std::vector<bool>& consumed);
  bool equality_step(JoinPlan& plan, const std::vector<bool>& bound, std::vector<bool>& consumed);
  bool scan_step(JoinPlan& plan, const std::vector<bool>& bound, std::vector<bool>& consumed);
  void domain_step(JoinPlan& plan, const std::vector<std::uint32_t>& pending, const std::vector<bool>& bound,
                   const std::vector<bool>& consumed);
  void schedule_checks(JoinPlan& plan, const std::vector<bool>& bound, std::vector<bool>& consumed,
                       std::vector<std::uint32_t>& checks);
  double inner_visits(const NormalNode& node) const;

  bool tick() { return (++ticks_ & 4095u) != 0 || keep_going_(); }
  ConstantIndex value(Term term) const { return term.is_variable ? values_[term.index] : term.index; }
  bool holds(const NormalNode& node) const;
  // Kleene's three values: 0 false, 1 true, 2 unknown; a quantifier counts as unknown.
  int decide(const NormalNode& node) const;
  bool survives(JoinPlan& plan, std::uint32_t goal);
  bool survive(JoinPlan& plan, const std::vector<std::uint32_t>& checks) {
    for (std::uint32_t goal : checks) {
      if (!survives(plan, goal)) return false;
    }
    return true;
  }
  // The ground formula; nothing where it turned out decided as unvisited ones are.
  bool finish(JoinPlan& plan, Literal& literal);
  bool finish_equivalence(Literal& literal);
  Literal evaluate(NormalNode& node);
  Literal evaluate_quantifier(NormalNode& node);
  Literal evaluate_connective(NormalNode& node);
  Literal literal_of(const NormalNode& atom);

  template <class Leaf>
  bool start(JoinPlan& plan, Leaf&& leaf) {
    if (!survive(plan, plan.first_checks)) return true;
    return step(plan, 0, leaf);
  }
  template <class Leaf>
  bool step(JoinPlan& plan, std::size_t depth, Leaf& leaf) {
    if (depth == plan.steps.size()) {
      Literal literal;
      return !finish(plan, literal) || leaf(literal);
    }
    JoinPlan::Step& s = plan.steps[depth];
    if (s.kind == JoinPlan::StepKind::kScan) return scan(plan, s, depth, leaf);
    if (s.kind == JoinPlan::StepKind::kEqual) {
      values_[s.variable] = value(s.from);
      return !survive(plan, s.checks) || step(plan, depth + 1, leaf);
    }
    for (ConstantIndex c = 0; c < s.size; ++c) {
      if (!tick()) return false;
      values_[s.variable] = c;
      if (survive(plan, s.checks) && !step(plan, depth + 1, leaf)) return false;
    }
    return true;
  }
  template <class Leaf>
  bool scan(JoinPlan& plan, JoinPlan::Step& s, std::size_t depth, Leaf& leaf) {
    for (std::size_t i = 0; i < s.key.size(); ++i) s.key[i] = value(s.key_terms[i]);
    const auto [begin, end] = s.index->find(s.key);
    for (std::uint32_t row = begin; row < end; ++row) {
      if (!tick()) return false;
      const ConstantIndex* constants = s.index->rows.data() + row * s.arity;
      for (const auto& [position, variable] : s.binds) values_[variable] = constants[position];
      bool matches = true;
      for (const auto& [position, variable] : s.same) matches = matches && values_[variable] == constants[position];
      if (!matches) continue;
      plan.left_over[s.goal] = s.index->decided[row] != 0 ? 0 : atom_code::kOpen;
      if (survive(plan, s.checks) && !step(plan, depth + 1, leaf)) return false;
    }
    return true;
  }

  NormalNode root_;
  std::optional<NormalNode> equivalence_, other_;  // of which root_ is an implication; the other implication
  std::vector<NormalNode> filters_;
  const Formula& formula_;
  AtomTable& atoms_;
  NetworkBuilder& builder_;
  KeepGoing keep_going_;
  std::vector<ConstantIndex> values_;             // by variable
  std::vector<std::unique_ptr<JoinPlan>> plans_;  // [0]: the root's
  double total_visits_ = 0;
  std::uint32_t ticks_ = 0;
};

}  // namespace sherlog
