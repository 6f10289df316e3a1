#include "grounding/join.h"

#include <algorithm>
#include <limits>

namespace sherlog {
namespace {

// Whether the goal is that a literal's atom (or equality) holds rather than that it does not.
bool wants_true(const JoinPlan& plan, const NormalNode& node) { return node.negated == plan.disjunctive; }

bool is_bound(const Term& term, const std::vector<bool>& bound) { return !term.is_variable || bound[term.index]; }

}  // namespace

FormulaJoin::FormulaJoin(NormalNode root, const Formula& formula, const std::vector<std::uint32_t>& outer,
                         std::vector<NormalNode> filters, bool disjunctive, AtomTable& atoms, NetworkBuilder& builder,
                         KeepGoing keep_going)
    : root_(std::move(root)),
      filters_(std::move(filters)),
      formula_(formula),
      atoms_(atoms),
      builder_(builder),
      keep_going_(std::move(keep_going)),
      values_(formula.variables.size(), 0) {
  std::vector<NormalNode*> goals;
  if (root_.shape == (disjunctive ? NodeShape::kOr : NodeShape::kAnd)) {
    for (NormalNode& child : root_.children) goals.push_back(&child);
  } else {
    goals.push_back(&root_);
  }
  for (NormalNode& filter : filters_) goals.push_back(&filter);
  std::vector<bool> bound(formula.variables.size(), false);
  make_plan(disjunctive, std::move(goals), outer, bound);
  const JoinPlan& plan = *plans_.front();
  total_visits_ = plan.visits;
  for (const NormalNode* goal : plan.goals) total_visits_ += plan.leaves * inner_visits(*goal);
}

FormulaJoin::FormulaJoin(NormalNode root, NormalNode implication, std::optional<NormalNode> other,
                         const Formula& formula, const std::vector<std::uint32_t>& outer,
                         std::vector<NormalNode> filters, AtomTable& atoms, NetworkBuilder& builder,
                         KeepGoing keep_going)
    : FormulaJoin(std::move(implication), formula, outer, std::move(filters), true, atoms, builder,
                  std::move(keep_going)) {
  equivalence_ = std::move(root);
  other_ = std::move(other);
  std::vector<bool> bound(formula.variables.size(), false);
  for (std::uint32_t variable : outer) bound[variable] = true;
  plan_inside(*equivalence_, bound);
  // The goals are only looked at; what they quantify over is visited for the equivalence.
  const JoinPlan& plan = *plans_.front();
  total_visits_ = plan.visits + plan.leaves * inner_visits(*equivalence_);
}

// --- planning --------------------------------------------------------------------------------------------------------

std::size_t FormulaJoin::make_plan(bool disjunctive, std::vector<NormalNode*> goals,
                                   const std::vector<std::uint32_t>& to_bind, std::vector<bool>& bound) {
  const std::size_t number = plans_.size();
  plans_.push_back(std::make_unique<JoinPlan>());
  JoinPlan& plan = *plans_.back();
  plan.disjunctive = disjunctive;
  plan.goals = std::move(goals);
  plan.left_over.assign(plan.goals.size(), 0);
  plan.leaves = 1;
  std::vector<bool> consumed(plan.goals.size(), false);
  std::vector<std::uint32_t> pending = to_bind;
  schedule_checks(plan, bound, consumed, plan.first_checks);
  while (!pending.empty()) next_step(plan, pending, bound, consumed);
  for (NormalNode* goal : plan.goals) plan_inside(*goal, bound);
  for (std::uint32_t variable : to_bind) bound[variable] = false;
  return number;
}

void FormulaJoin::plan_inside(NormalNode& node, std::vector<bool>& bound) {
  if (!node.quantified) return;
  if (node.shape != NodeShape::kExists && node.shape != NodeShape::kForall) {
    for (NormalNode& child : node.children) plan_inside(child, bound);
    return;
  }
  const bool disjunctive = node.shape == NodeShape::kForall;
  NormalNode& child = node.children.front();
  std::vector<NormalNode*> goals;
  if (child.shape == (disjunctive ? NodeShape::kOr : NodeShape::kAnd)) {
    for (NormalNode& part : child.children) goals.push_back(&part);
  } else {
    goals.push_back(&child);
  }
  node.plan = make_plan(disjunctive, std::move(goals), node.bound, bound);
}

void FormulaJoin::next_step(JoinPlan& plan, std::vector<std::uint32_t>& pending, std::vector<bool>& bound,
                            std::vector<bool>& consumed) {
  if (!equality_step(plan, bound, consumed) && !scan_step(plan, bound, consumed))
    domain_step(plan, pending, bound, consumed);
  JoinPlan::Step& step = plan.steps.back();
  if (step.kind == JoinPlan::StepKind::kScan) {
    for (const auto& [position, variable] : step.binds) bound[variable] = true;
  } else {
    bound[step.variable] = true;
  }
  std::erase_if(pending, [&](std::uint32_t variable) { return bound[variable]; });
  plan.visits += plan.leaves;
  schedule_checks(plan, bound, consumed, step.checks);
}

bool FormulaJoin::equality_step(JoinPlan& plan, const std::vector<bool>& bound, std::vector<bool>& consumed) {
  for (std::size_t g = 0; g < plan.goals.size(); ++g) {
    const NormalNode& node = *plan.goals[g];
    if (consumed[g] || node.shape != NodeShape::kEqual || !wants_true(plan, node)) continue;
    const bool left = is_bound(node.left, bound), right = is_bound(node.right, bound);
    if (left == right) continue;
    JoinPlan::Step step;
    step.kind = JoinPlan::StepKind::kEqual;
    step.variable = left ? node.right.index : node.left.index;
    step.from = left ? node.left : node.right;
    plan.steps.push_back(std::move(step));
    consumed[g] = true;
    return true;
  }
  return false;
}

bool FormulaJoin::scan_step(JoinPlan& plan, const std::vector<bool>& bound, std::vector<bool>& consumed) {
  std::size_t best = plan.goals.size();
  const AtomIndex* best_index = nullptr;
  double best_matches = std::numeric_limits<double>::infinity();
  for (std::size_t g = 0; g < plan.goals.size(); ++g) {
    const NormalNode& node = *plan.goals[g];
    if (consumed[g] || node.shape != NodeShape::kAtom || !wants_true(plan, node)) continue;
    const PredicateId predicate(node.atom.predicate);
    if (!atoms_.listable(predicate)) continue;
    std::vector<std::uint32_t> known;
    for (std::uint32_t i = 0; i < node.atom.terms.size(); ++i) {
      if (is_bound(node.atom.terms[i], bound)) known.push_back(i);
    }
    const AtomIndex& index = atoms_.index(predicate, known);
    const double matches =
        static_cast<double>(index.decided.size()) / static_cast<double>(std::max<std::size_t>(index.groups, 1));
    if (matches < best_matches) best = g, best_index = &index, best_matches = matches;
  }
  if (best_index == nullptr) return false;
  const AtomPattern& atom = plan.goals[best]->atom;
  JoinPlan::Step step;
  step.kind = JoinPlan::StepKind::kScan;
  step.goal = static_cast<std::uint32_t>(best);
  step.index = best_index;
  step.arity = atom.terms.size();
  for (std::uint32_t position : best_index->key_positions) step.key_terms.push_back(atom.terms[position]);
  step.key.resize(step.key_terms.size());
  for (std::uint32_t i = 0; i < atom.terms.size(); ++i) {
    if (is_bound(atom.terms[i], bound)) continue;
    const std::uint32_t variable = atom.terms[i].index;
    const bool again = std::ranges::any_of(step.binds, [&](const auto& bind) { return bind.second == variable; });
    (again ? step.same : step.binds).emplace_back(i, variable);
  }
  plan.leaves *= best_matches;
  plan.steps.push_back(std::move(step));
  consumed[best] = true;
  return true;
}

// The variable that lets most goals be tested at once; among equals, that of the smallest domain.
void FormulaJoin::domain_step(JoinPlan& plan, const std::vector<std::uint32_t>& pending, const std::vector<bool>& bound,
                              const std::vector<bool>& consumed) {
  std::uint32_t best = pending.front();
  int best_score = -1;
  const auto size_of = [&](std::uint32_t variable) { return atoms_.domain_size(formula_.variables[variable].domain); };
  for (std::uint32_t variable : pending) {
    int score = 0;
    for (std::size_t g = 0; g < plan.goals.size(); ++g) {
      if (consumed[g]) continue;
      const auto& free = plan.goals[g]->free;
      const bool completes = std::ranges::all_of(free, [&](std::uint32_t v) { return bound[v] || v == variable; });
      if (completes && std::ranges::binary_search(free, variable)) score += plan.goals[g]->is_literal() ? 2 : 1;
    }
    if (score > best_score || (score == best_score && size_of(variable) < size_of(best)))
      best = variable, best_score = score;
  }
  JoinPlan::Step step;
  step.kind = JoinPlan::StepKind::kDomain;
  step.variable = best;
  step.size = size_of(best);
  plan.leaves *= step.size;
  plan.steps.push_back(std::move(step));
}

void FormulaJoin::schedule_checks(JoinPlan& plan, const std::vector<bool>& bound, std::vector<bool>& consumed,
                                  std::vector<std::uint32_t>& checks) {
  for (std::uint32_t g = 0; g < plan.goals.size(); ++g) {
    if (consumed[g] || !std::ranges::all_of(plan.goals[g]->free, [&](std::uint32_t v) { return bound[v]; })) continue;
    checks.push_back(g);
    consumed[g] = true;
  }
}

double FormulaJoin::inner_visits(const NormalNode& node) const {
  if (!node.quantified) return 0;
  double visits = 0, times = 1;
  if (node.shape == NodeShape::kExists || node.shape == NodeShape::kForall) {
    visits = plans_[node.plan]->visits;
    times = plans_[node.plan]->leaves;
  }
  for (const NormalNode& child : node.children) visits += times * inner_visits(child);
  return visits;
}

// --- running ---------------------------------------------------------------------------------------------------------

bool FormulaJoin::holds(const NormalNode& node) const {
  const ConstantIndex left = value(node.left), right = value(node.right);
  bool result = false;
  switch (node.shape) {
    case NodeShape::kEqual:
      result = left == right;
      break;
    case NodeShape::kLess:
      result = (*node.numbers)[left] < (*node.numbers)[right];
      break;
    case NodeShape::kLessEqual:
      result = (*node.numbers)[left] <= (*node.numbers)[right];
      break;
    default:
      result = left < right;
      break;
  }
  return result != node.negated;
}

int FormulaJoin::decide(const NormalNode& node) const {
  constexpr int kUnknown = 2;
  switch (node.shape) {
    case NodeShape::kTrue:
      return 1;
    case NodeShape::kFalse:
      return 0;
    case NodeShape::kAtom: {
      const std::uint32_t code = atoms_.code(node.atom, values_.data());
      return code >= atom_code::kOpen ? kUnknown : (code == atom_code::kTrue) != node.negated ? 1 : 0;
    }
    case NodeShape::kAnd:
    case NodeShape::kOr: {
      const int dominant = node.shape == NodeShape::kOr ? 1 : 0;
      int result = 1 - dominant;
      for (const NormalNode& child : node.children) {
        const int decided = decide(child);
        if (decided == dominant) return dominant;
        if (decided == kUnknown) result = kUnknown;
      }
      return result;
    }
    case NodeShape::kIff: {
      const int left = decide(node.children[0]), right = decide(node.children[1]);
      return left == kUnknown || right == kUnknown ? kUnknown : ((left == right) != node.negated ? 1 : 0);
    }
    case NodeShape::kExists:
    case NodeShape::kForall:
      return kUnknown;
    default:
      return holds(node) ? 1 : 0;
  }
}

bool FormulaJoin::survives(JoinPlan& plan, std::uint32_t goal) {
  const NormalNode& node = *plan.goals[goal];
  std::uint32_t& left_over = plan.left_over[goal];
  if (node.shape == NodeShape::kAtom) {
    const std::uint32_t code = atoms_.code(node.atom, values_.data());
    if (code >= atom_code::kOpen) {
      left_over = code;
      return true;
    }
    left_over = 0;
    return (code == atom_code::kTrue) == wants_true(plan, node);
  }
  if (node.shape == NodeShape::kEarlier) return holds(node);
  const int decided = decide(node);
  left_over = decided == 2 ? 1 : 0;
  return decided == 2 || (decided == 1) != plan.disjunctive;
}

bool FormulaJoin::finish_equivalence(Literal& literal) {
  if (other_ && decide(*other_) != 1) return false;
  literal = evaluate(*equivalence_);
  return true;
}

bool FormulaJoin::finish(JoinPlan& plan, Literal& literal) {
  if (equivalence_ && &plan == plans_.front().get()) return finish_equivalence(literal);
  const Literal deciding = Literal::constant(plan.disjunctive);
  plan.literals.clear();
  for (std::size_t g = 0; g < plan.goals.size(); ++g) {
    NormalNode& node = *plan.goals[g];
    if (plan.left_over[g] == 0 || node.is_literal()) continue;
    const Literal part = evaluate(node);
    if (part == deciding) return false;
    if (!part.is_constant()) plan.literals.push_back(part);
  }
  for (std::size_t g = 0; g < plan.goals.size(); ++g) {
    const NormalNode& node = *plan.goals[g];
    std::uint32_t& code = plan.left_over[g];
    if (code == 0 || node.shape != NodeShape::kAtom) continue;
    if (code < atom_code::kFirst) code = atoms_.materialised_code(node.atom, values_.data());
    if (code < atom_code::kFirst) return false;  // the network is full: the work is about to stop
    plan.literals.push_back(Literal::atom(AtomId(code - atom_code::kFirst), node.negated));
  }
  if (plan.literals.empty()) {
    literal = ~deciding;
  } else if (plan.literals.size() == 1) {
    literal = plan.literals.front();
  } else {
    literal = plan.disjunctive ? builder_.make_or(plan.literals) : builder_.make_and(plan.literals);
  }
  return true;
}

Literal FormulaJoin::literal_of(const NormalNode& atom) {
  const std::uint32_t code = atoms_.materialised_code(atom.atom, values_.data());
  if (code < atom_code::kFirst) return Literal::constant((code == atom_code::kTrue) != atom.negated);
  return Literal::atom(AtomId(code - atom_code::kFirst), atom.negated);
}

Literal FormulaJoin::evaluate(NormalNode& node) {
  switch (node.shape) {
    case NodeShape::kTrue:
      return Literal::constant(true);
    case NodeShape::kFalse:
      return Literal::constant(false);
    case NodeShape::kAtom:
      return literal_of(node);
    case NodeShape::kAnd:
    case NodeShape::kOr:
      return evaluate_connective(node);
    case NodeShape::kIff: {
      const Literal left = evaluate(node.children[0]);
      const Literal right = evaluate(node.children[1]);
      const Literal both = builder_.make_iff(left, right);
      return node.negated ? ~both : both;
    }
    case NodeShape::kExists:
    case NodeShape::kForall:
      return evaluate_quantifier(node);
    default:
      return Literal::constant(holds(node));
  }
}

Literal FormulaJoin::evaluate_connective(NormalNode& node) {
  // A look at what evidence decides first: no atom is made for nothing.
  const int decided = decide(node);
  if (decided != 2) return Literal::constant(decided == 1);
  const bool is_or = node.shape == NodeShape::kOr;
  node.scratch.clear();
  for (NormalNode& child : node.children) {
    const Literal part = evaluate(child);
    if (part == Literal::constant(is_or)) return part;
    if (!part.is_constant()) node.scratch.push_back(part);
  }
  return is_or ? builder_.make_or(node.scratch) : builder_.make_and(node.scratch);
}

Literal FormulaJoin::evaluate_quantifier(NormalNode& node) {
  const bool exists = node.shape == NodeShape::kExists;
  const Literal deciding = Literal::constant(exists);
  bool decided = false;
  node.scratch.clear();
  start(*plans_[node.plan], [&](Literal literal) {
    if (!literal.is_constant()) node.scratch.push_back(literal);
    decided = literal == deciding;
    return !decided;
  });
  if (decided) return deciding;
  if (node.scratch.empty()) return ~deciding;
  return exists ? builder_.make_or(node.scratch) : builder_.make_and(node.scratch);
}

}  // namespace sherlog
