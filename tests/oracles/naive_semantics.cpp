#include "tests/oracles/naive_semantics.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <map>

namespace sherlog::oracle {
namespace {

using Arguments = std::vector<ConstantIndex>;

// A random variable: the atoms of a block, or a single one, and the values that it may have (an atom, or -1 for none).
struct Variable {
  std::vector<int> values;
};

class Naive {
 public:
  Naive(const Model& model, const Evidence& evidence, const Query& query, const GroundingOptions& options)
      : model_(model), evidence_(evidence), query_(query) {
    open_.assign(model.predicates().size(), false);
    for (std::size_t p = 0; p < open_.size(); ++p) {
      if (options.open_world_all && !model.predicates()[p].closed) open_[p] = true;
    }
    for (PredicateId p : options.open_world) open_[p.index()] = true;
    for (const QueryItem& item : query.items) {
      if (item.kind == QueryItem::Kind::kAtoms) {
        open_[item.predicate.index()] = true;
      } else {
        open_predicates_of(item.formula.root);
      }
    }
    number_atoms();
    make_variables();
  }

  std::optional<NaiveAnswer> answer(const NaiveLimits& limits) {
    NaiveAnswer result;
    result.worlds = 1;
    for (const Variable& v : variables_) result.worlds *= static_cast<double>(v.values.size());
    double ground_formulas = 1;
    for (const Formula& formula : model_.formulas()) ground_formulas += ground_count(formula);
    if (result.worlds > limits.worlds || result.worlds * ground_formulas > limits.steps) return std::nullopt;
    find_targets(result);
    world_.assign(atom_of_.size(), false);
    std::vector<double> sums(result.marginals.size(), 0.0);
    best_ = -std::numeric_limits<double>::infinity();
    total_ = 0;
    if (result.worlds > 0) each_world(0, sums);  // a block without values leaves none, after many attempts
    result.possible = total_ > 0;
    if (!result.possible) return result;
    result.log_partition = reference_ + std::log(total_);
    result.best_score = best_;
    for (std::size_t i = 0; i < sums.size(); ++i) result.marginals[i].second = sums[i] / total_;
    return result;
  }

 private:
  void open_predicates_of(const FormulaNode& node) {
    if (node.kind == NodeKind::kAtom) open_[node.predicate.index()] = true;
    for (const FormulaNode& child : node.children) open_predicates_of(child);
  }

  std::size_t size_of(DomainId domain) const { return evidence_.domain_size(model_, domain); }

  void number_atoms() {
    for (std::size_t p = 0; p < model_.predicates().size(); ++p) {
      const Predicate& predicate = model_.predicates()[p];
      std::vector<Arguments> rows{{}};
      for (DomainId domain : predicate.domains) {
        std::vector<Arguments> longer;
        for (const Arguments& row : rows) {
          for (ConstantIndex c = 0; c < size_of(domain); ++c) {
            longer.push_back(row);
            longer.back().push_back(c);
          }
        }
        rows = std::move(longer);
      }
      for (Arguments& row : rows) {
        const int number = static_cast<int>(atom_of_.size());
        atom_of_.emplace(std::pair{p, row}, number);
        atoms_.push_back({p, row});
      }
    }
    stated_.resize(atoms_.size());
    degree_.resize(atoms_.size());
    for (std::size_t p = 0; p < model_.predicates().size(); ++p) {
      const PredicateEvidence& stated = evidence_.of(PredicateId(p));
      const std::size_t arity = model_.predicates()[p].arity();
      for (std::size_t i = 0; i < stated.size(); ++i) {
        const auto begin = stated.arguments.begin() + static_cast<std::ptrdiff_t>(i * arity);
        const Arguments arguments(begin, begin + static_cast<std::ptrdiff_t>(arity));
        const auto atom = static_cast<std::size_t>(atom_of_.at({p, arguments}));
        stated_[atom] = stated.kinds[i];
        degree_[atom] = stated.degrees[i];
      }
    }
  }

  bool is(std::size_t atom, EvidenceKind kind) const { return stated_[atom] == kind; }

  // Whether the evidence alone, without the rules of blocks, lets the atom be true.
  bool may_be_true(std::size_t atom) const {
    const Predicate& predicate = model_.predicates()[atoms_[atom].first];
    if (stated_[atom]) return !is(atom, EvidenceKind::kFalse);
    return open_[atoms_[atom].first] || predicate.block == BlockKind::kExactlyOne;
  }

  void make_variables() {
    std::map<std::pair<std::size_t, Arguments>, std::vector<int>> blocks;
    for (std::size_t a = 0; a < atoms_.size(); ++a) {
      const auto& [p, arguments] = atoms_[a];
      const Predicate& predicate = model_.predicates()[p];
      if (predicate.block == BlockKind::kNone) {
        Variable v;
        if (may_be_true(a)) v.values.push_back(static_cast<int>(a));
        if (!is(a, EvidenceKind::kTrue)) v.values.push_back(-1);
        variables_.push_back(v);
        continue;
      }
      Arguments key;
      for (std::size_t i = 0; i < arguments.size(); ++i) {
        if (!predicate.marked[i]) key.push_back(arguments[i]);
      }
      blocks[{p, key}].push_back(static_cast<int>(a));
    }
    // A '!' block over an empty domain has no atoms, and still no value.
    for (std::size_t p = 0; p < model_.predicates().size(); ++p) {
      const Predicate& predicate = model_.predicates()[p];
      if (predicate.block != BlockKind::kExactlyOne) continue;
      double keys = 1, values = 1;
      for (std::size_t i = 0; i < predicate.arity(); ++i) {
        (predicate.marked[i] ? values : keys) *= static_cast<double>(size_of(predicate.domains[i]));
      }
      if (keys > 0 && values == 0) variables_.emplace_back();
    }
    for (const auto& [key, members] : blocks) {
      Variable v;
      bool has_true = false;
      for (int a : members) has_true = has_true || is(static_cast<std::size_t>(a), EvidenceKind::kTrue);
      for (int a : members) {
        const auto atom = static_cast<std::size_t>(a);
        if (has_true ? is(atom, EvidenceKind::kTrue) : may_be_true(atom)) v.values.push_back(a);
      }
      if (!has_true && model_.predicates()[key.first].block == BlockKind::kAtMostOne) v.values.push_back(-1);
      variables_.push_back(v);
    }
  }

  bool is_decided(int atom) const {
    for (const Variable& v : variables_) {
      if (std::ranges::find(v.values, atom) != v.values.end()) return v.values.size() == 1;
    }
    return true;
  }

  double ground_count(const Formula& formula) const {
    double count = 1;
    for (const FormulaVariable& v : formula.variables) count *= static_cast<double>(size_of(v.domain));
    return count + 1;
  }

  void find_targets(NaiveAnswer& result) {
    std::vector<bool> listed(atoms_.size(), false);
    for (const QueryItem& item : query_.items) {
      if (item.kind == QueryItem::Kind::kFormula) {
        targets_.push_back({-1, &item.formula});
        result.marginals.emplace_back(item.formula.text, 0.0);
        continue;
      }
      for (std::size_t a = 0; a < atoms_.size(); ++a) {
        if (listed[a] || !matches(item, atoms_[a]) || is_decided(static_cast<int>(a))) continue;
        listed[a] = true;
        targets_.push_back({static_cast<int>(a), nullptr});
        result.marginals.emplace_back(atom_text(model_, evidence_, PredicateId(atoms_[a].first), atoms_[a].second),
                                      0.0);
      }
    }
  }

  static bool matches(const QueryItem& item, const std::pair<std::size_t, Arguments>& atom) {
    if (item.predicate.index() != atom.first) return false;
    std::map<std::uint32_t, ConstantIndex> values;
    for (std::size_t i = 0; i < atom.second.size(); ++i) {
      const Term& term = item.pattern[i];
      const ConstantIndex c = atom.second[i];
      if (term.is_variable ? values.emplace(term.index, c).first->second != c : term.index != c) return false;
    }
    return true;
  }

  void each_world(std::size_t depth, std::vector<double>& sums) {
    if (depth < variables_.size()) {
      for (int value : variables_[depth].values) {
        if (value >= 0) world_[static_cast<std::size_t>(value)] = true;
        each_world(depth + 1, sums);
        if (value >= 0) world_[static_cast<std::size_t>(value)] = false;
      }
      return;
    }
    const std::optional<double> score = score_of_world();
    if (!score) return;
    best_ = std::max(best_, *score);
    if (total_ == 0) reference_ = *score;
    if (*score > reference_ + 300) {  // keep the sum within the range of doubles
      const double factor = std::exp(reference_ - *score);
      total_ *= factor;
      for (double& sum : sums) sum *= factor;
      reference_ = *score;
    }
    const double weight = std::exp(*score - reference_);
    total_ += weight;
    for (std::size_t i = 0; i < targets_.size(); ++i) {
      values_.assign(targets_[i].second ? targets_[i].second->variables.size() : 0, 0);
      const bool holds = targets_[i].second ? truth(targets_[i].second->root, *targets_[i].second)
                                            : bool{world_[static_cast<std::size_t>(targets_[i].first)]};
      if (holds) sums[i] += weight;
    }
  }

  // Nothing where a hard formula is broken.
  std::optional<double> score_of_world() {
    double score = 0;
    for (std::size_t a = 0; a < atoms_.size(); ++a) {
      if (is(a, EvidenceKind::kSoft)) score += std::log(world_[a] ? degree_[a] : 1 - degree_[a]);
    }
    for (const Formula& formula : model_.formulas()) {
      values_.assign(formula.variables.size(), 0);
      const double truths = count(formula, 0, true);
      if (!formula.hard) {
        score += formula.weight * truths;
      } else if (count(formula, 0, false) > 0) {
        return std::nullopt;
      }
    }
    return score;
  }

  // Assignments of the outer variables from number `v` on that give the formula this truth value.
  double count(const Formula& formula, std::size_t v, bool wanted) {
    if (v == formula.variables.size()) return in_order(formula) && truth(formula.root, formula) == wanted ? 1 : 0;
    if (formula.variables[v].quantified) return count(formula, v + 1, wanted);
    double result = 0;
    for (ConstantIndex c = 0; c < size_of(formula.variables[v].domain); ++c) {
      values_[v] = c;
      result += count(formula, v + 1, wanted);
    }
    return result;
  }

  bool in_order(const Formula& formula) const {
    for (const auto& group : formula.unique) {
      for (std::size_t i = 0; i + 1 < group.size(); ++i) {
        if (values_[group[i]] >= values_[group[i + 1]]) return false;
      }
    }
    return true;
  }

  ConstantIndex constant(const Term& t) const { return t.is_variable ? values_[t.index] : t.index; }

  bool compared(const FormulaNode& node) const {
    const ConstantIndex left = constant(node.terms[0]), right = constant(node.terms[1]);
    if (node.kind == NodeKind::kEqual) return left == right;
    double numbers[2] = {};
    const ConstantIndex sides[2] = {left, right};
    for (int i = 0; i < 2; ++i) {
      const std::string& name = evidence_.constant_name(model_, node.domain, sides[i]);
      char* end = nullptr;
      numbers[i] = std::strtod(name.c_str(), &end);
      if (name.empty() || *end != '\0') return false;
    }
    return node.kind == NodeKind::kLess ? numbers[0] < numbers[1] : numbers[0] <= numbers[1];
  }

  bool truth(const FormulaNode& node, const Formula& formula) {
    const auto child = [&](std::size_t i) { return truth(node.children[i], formula); };
    switch (node.kind) {
      case NodeKind::kAtom: {
        Arguments arguments;
        for (const Term& t : node.terms) arguments.push_back(constant(t));
        return world_[static_cast<std::size_t>(atom_of_.at({node.predicate.index(), arguments}))];
      }
      case NodeKind::kEqual:
      case NodeKind::kLess:
      case NodeKind::kLessEqual:
        return compared(node);
      case NodeKind::kNot:
        return !child(0);
      case NodeKind::kImplies:
        return !child(0) || child(1);
      case NodeKind::kIff:
        return child(0) == child(1);
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
      case NodeKind::kExists:
        return quantified(node, formula, 0, true);
      case NodeKind::kForall:
        return !quantified(node, formula, 0, false);
    }
    return false;
  }

  // Some binding of the quantifier's variables from number `i` on gives its body the value `wanted`.
  bool quantified(const FormulaNode& node, const Formula& formula, std::size_t i, bool wanted) {
    if (i == node.bound.size()) return truth(node.children[0], formula) == wanted;
    for (ConstantIndex c = 0; c < size_of(formula.variables[node.bound[i]].domain); ++c) {
      values_[node.bound[i]] = c;
      if (quantified(node, formula, i + 1, wanted)) return true;
    }
    return false;
  }

  const Model& model_;
  const Evidence& evidence_;
  const Query& query_;
  std::vector<bool> open_;
  std::map<std::pair<std::size_t, Arguments>, int> atom_of_;
  std::vector<std::pair<std::size_t, Arguments>> atoms_;  // predicate, arguments; in order of both
  std::vector<std::optional<EvidenceKind>> stated_;
  std::vector<double> degree_;
  std::vector<Variable> variables_;
  std::vector<std::pair<int, const Formula*>> targets_;
  std::vector<bool> world_;
  std::vector<ConstantIndex> values_;
  double total_ = 0, reference_ = 0, best_ = 0;
};

}  // namespace

std::optional<NaiveAnswer> naive_semantics(const Model& model, const Evidence& evidence, const Query& query,
                                           const GroundingOptions& options, const NaiveLimits& limits) {
  return Naive(model, evidence, query, options).answer(limits);
}

}  // namespace sherlog::oracle
