#include "tests/oracles/naive_learning.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <functional>
#include <limits>
#include <map>

namespace sherlog::oracle {

NaiveLearning::NaiveLearning(const TrainingSet& set, std::size_t database)
    : set_(set), evidence_(set.databases[database]) {
  const Model& model = set.model;
  for (std::size_t p = 0; p < model.predicates().size(); ++p) {
    const Predicate& predicate = model.predicates()[p];
    std::size_t total = 1;
    for (const DomainId d : predicate.domains) total *= domain_size(d);
    observed_.emplace_back(total, false);
    const PredicateEvidence& stated = evidence_.of(PredicateId(p));
    for (std::size_t a = 0; a < stated.size(); ++a) {
      if (stated.kinds[a] != EvidenceKind::kTrue) continue;
      const auto begin = stated.arguments.begin() + static_cast<std::ptrdiff_t>(a * predicate.arity());
      observed_[p][address(PredicateId(p), {begin, begin + static_cast<std::ptrdiff_t>(predicate.arity())})] = true;
    }
    std::map<std::string, Variable> by_key;
    for (std::size_t atom = 0; atom < total; ++atom) {
      std::size_t rest = atom;
      std::vector<std::size_t> arguments(predicate.arity());
      for (std::size_t i = predicate.arity(); i-- > 0;) {
        arguments[i] = rest % domain_size(predicate.domains[i]);
        rest /= domain_size(predicate.domains[i]);
      }
      std::string unmarked;
      for (std::size_t i = 0; i < predicate.arity(); ++i) {
        if (predicate.block == BlockKind::kNone || !predicate.marked[i]) unmarked += std::to_string(arguments[i]) + ",";
      }
      Variable& variable = by_key[unmarked];
      variable.predicate = PredicateId(p);
      variable.key = unmarked;
      variable.none = predicate.block != BlockKind::kExactlyOne;
      variable.atoms.push_back(atom);
    }
    for (auto& [unmarked, variable] : by_key) variables_.push_back(std::move(variable));
  }
}

std::size_t NaiveLearning::domain_size(DomainId domain) const { return evidence_.domain_size(set_.model, domain); }

std::size_t NaiveLearning::address(PredicateId predicate, const std::vector<ConstantIndex>& arguments) const {
  std::size_t result = 0;
  for (std::size_t i = 0; i < arguments.size(); ++i) {
    result = result * domain_size(set_.model.predicate(predicate).domains[i]) + arguments[i];
  }
  return result;
}

bool NaiveLearning::holds(const FormulaNode& node, const Formula& formula, std::vector<ConstantIndex>& values,
                          const CompleteWorld& world) const {
  const auto value = [&](const Term& term) { return term.is_variable ? values[term.index] : term.index; };
  const auto child = [&](std::size_t i) { return holds(node.children[i], formula, values, world); };
  switch (node.kind) {
    case NodeKind::kAtom: {
      std::vector<ConstantIndex> arguments;
      for (const Term& term : node.terms) arguments.push_back(value(term));
      return world[node.predicate.index()][address(node.predicate, arguments)];
    }
    case NodeKind::kEqual:
      return value(node.terms[0]) == value(node.terms[1]);
    case NodeKind::kLess:
    case NodeKind::kLessEqual: {
      const double left = std::atof(evidence_.constant_name(set_.model, node.domain, value(node.terms[0])).c_str());
      const double right = std::atof(evidence_.constant_name(set_.model, node.domain, value(node.terms[1])).c_str());
      return node.kind == NodeKind::kLess ? left < right : left <= right;
    }
    case NodeKind::kNot:
      return !child(0);
    case NodeKind::kAnd:
      for (std::size_t i = 0; i < node.children.size(); ++i) {
        if (!child(i)) return false;
      }
      return true;
    case NodeKind::kOr:
      for (std::size_t i = 0; i < node.children.size(); ++i) {
        if (child(i)) return true;
      }
      return false;
    case NodeKind::kImplies:
      return !child(0) || child(1);
    case NodeKind::kIff:
      return child(0) == child(1);
    case NodeKind::kExists:
    case NodeKind::kForall: {
      const bool exists = node.kind == NodeKind::kExists;
      const std::function<bool(std::size_t)> quantified = [&](std::size_t depth) {
        if (depth == node.bound.size()) return child(0);
        const std::uint32_t v = node.bound[depth];
        for (ConstantIndex c = 0; c < domain_size(formula.variables[v].domain); ++c) {
          values[v] = c;
          if (quantified(depth + 1) == exists) return exists;
        }
        return !exists;
      };
      return quantified(0);
    }
  }
  return false;
}

template <class Visit>
void NaiveLearning::each_binding(const Formula& formula, const Visit& visit) const {
  std::vector<ConstantIndex> values(formula.variables.size(), 0);
  const std::function<void(std::size_t)> next = [&](std::size_t v) {
    if (v == values.size()) {
      for (const auto& group : formula.unique) {
        for (std::size_t i = 0; i + 1 < group.size(); ++i) {
          if (values[group[i]] >= values[group[i + 1]]) return;
        }
      }
      visit(values);
      return;
    }
    if (formula.variables[v].quantified) return next(v + 1);
    for (ConstantIndex c = 0; c < domain_size(formula.variables[v].domain); ++c) {
      values[v] = c;
      next(v + 1);
    }
    values[v] = 0;
  };
  next(0);
}

std::vector<double> NaiveLearning::counts(const CompleteWorld& world) const {
  std::vector<double> result(set_.weights.size(), 0.0);
  for (std::size_t f = 0; f < set_.model.formulas().size(); ++f) {
    const Formula& formula = set_.model.formulas()[f];
    if (formula.hard) continue;
    each_binding(formula, [&](std::vector<ConstantIndex> values) {
      WeightedInstance instance{FormulaId(f), {}, 0.0};
      for (std::size_t v = 0; v < values.size(); ++v) {
        if (formula.variables[v].plus) instance.plus_constants.push_back(values[v]);
      }
      if (holds(formula.root, formula, values, world)) result[set_.weights.find(instance)] += 1.0;
    });
  }
  return result;
}

bool NaiveLearning::meets_hard_formulas(const CompleteWorld& world) const {
  bool good = true;
  for (const Formula& formula : set_.model.formulas()) {
    if (!formula.hard) continue;
    each_binding(formula, [&](std::vector<ConstantIndex> values) {
      good = good && holds(formula.root, formula, values, world);
    });
  }
  return good;
}

double NaiveLearning::log_share(const std::vector<double>& weights, const std::vector<std::size_t>& variables) const {
  CompleteWorld world = observed_;
  std::vector<double> scores;
  const auto score = [&] {
    if (!meets_hard_formulas(world)) return -std::numeric_limits<double>::infinity();
    const std::vector<double> n = counts(world);
    double sum = 0.0;
    for (std::size_t w = 0; w < n.size(); ++w) sum += weights[w] * n[w];
    return sum;
  };
  const double observed = score();
  const std::function<void(std::size_t)> next = [&](std::size_t i) {
    if (i == variables.size()) {
      scores.push_back(score());
      return;
    }
    const Variable& variable = variables_[variables[i]];
    std::vector<bool>& truth = world[variable.predicate.index()];
    const std::vector<bool> before = truth;
    for (const std::size_t atom : variable.atoms) truth[atom] = false;
    if (variable.none) next(i + 1);
    for (const std::size_t atom : variable.atoms) {
      truth[atom] = true;
      next(i + 1);
      truth[atom] = false;
    }
    truth = before;
  };
  next(0);
  const double top = *std::max_element(scores.begin(), scores.end());
  double sum = 0.0;
  for (const double s : scores) sum += std::exp(s - top);
  return observed - top - std::log(sum);
}

double NaiveLearning::pseudo_likelihood(const std::vector<double>& weights,
                                        const std::vector<std::vector<std::size_t>>& groups) const {
  double sum = 0.0;
  for (const auto& group : groups) sum += log_share(weights, group);
  return sum;
}

double NaiveLearning::likelihood(const std::vector<double>& weights, const std::vector<bool>& predicates) const {
  std::vector<std::size_t> variables;
  for (std::size_t p = 0; p < predicates.size(); ++p) {
    if (!predicates[p]) continue;
    const auto more = variables_of(PredicateId(p));
    variables.insert(variables.end(), more.begin(), more.end());
  }
  return log_share(weights, variables);
}

std::vector<std::size_t> NaiveLearning::variables_of(PredicateId predicate) const {
  std::vector<std::size_t> result;
  for (std::size_t v = 0; v < variables_.size(); ++v) {
    if (variables_[v].predicate == predicate) result.push_back(v);
  }
  return result;
}

std::string NaiveLearning::key(std::size_t variable) const { return variables_[variable].key; }

}  // namespace sherlog::oracle
