// Negation normal form and distribution on syntax trees (clauses.h).
#include "mln/clauses.h"

#include <algorithm>
#include <string>
#include <utility>

namespace sherlog {

using syntax::Formula;
using syntax::Kind;
using syntax::Term;

namespace {

using Clauses = std::vector<SyntaxClause>;

// The comparison that is true where this one is false.
Kind opposite(Kind kind) {
  switch (kind) {
    case Kind::kEqual:
      return Kind::kNotEqual;
    case Kind::kNotEqual:
      return Kind::kEqual;
    case Kind::kLess:
      return Kind::kGreaterEqual;
    case Kind::kLessEqual:
      return Kind::kGreater;
    case Kind::kGreater:
      return Kind::kLessEqual;
    default:
      return Kind::kLess;
  }
}

Formula literal(const Formula& atom, bool negated) {
  Formula result = atom;
  result.bracketed = false;
  if (!negated) return result;
  if (atom.kind != Kind::kAtom) {
    result.kind = opposite(atom.kind);
    return result;
  }
  Formula negation;
  negation.kind = Kind::kNot;
  negation.place = atom.place;
  negation.children.push_back(std::move(result));
  return negation;
}

class Converter {
 public:
  bool dropped_forall() const { return dropped_forall_; }

  std::optional<Clauses> convert(const Formula& formula, bool negated) {
    switch (formula.kind) {
      case Kind::kStarAtom:
        return std::nullopt;
      case Kind::kNot:
        return convert(formula.children[0], !negated);
      case Kind::kAnd:
      case Kind::kOr:
        return convert_chain(formula, negated);
      case Kind::kImplies:
        return join(convert(formula.children[0], !negated), convert(formula.children[1], negated), !negated);
      case Kind::kIff:
        return convert_iff(formula, negated);
      case Kind::kExists:
      case Kind::kForall:
        return convert_quantified(formula, negated);
      default:
        return Clauses{{{}, {literal(formula, negated)}, {}}};
    }
  }

 private:
  // (a v !b) ^ (!a v b), or negated (a v b) ^ (!a v !b).
  std::optional<Clauses> convert_iff(const Formula& formula, bool negated) {
    const Formula& left = formula.children[0];
    const Formula& right = formula.children[1];
    return join(join(convert(left, false), convert(right, !negated), true),
                join(convert(left, true), convert(right, negated), true), false);
  }

  std::optional<Clauses> convert_chain(const Formula& formula, bool negated) {
    const bool disjunction = (formula.kind == Kind::kOr) != negated;
    std::optional<Clauses> result;
    for (const Formula& child : formula.children) {
      std::optional<Clauses> next = convert(child, negated);
      result = result ? join(std::move(result), std::move(next), disjunction) : std::move(next);
      if (!result) return std::nullopt;
    }
    return result;
  }

  std::optional<Clauses> convert_quantified(const Formula& formula, bool negated) {
    std::optional<Clauses> body = convert(formula.children[0], negated);
    if (!body) return std::nullopt;
    const bool for_all = (formula.kind == Kind::kForall) != negated;
    if (!for_all && body->size() != 1) return std::nullopt;
    dropped_forall_ = dropped_forall_ || for_all;
    for (SyntaxClause& clause : *body) {
      // Two quantifiers of one kind may change places, of two kinds not; of one name the inner one hides the outer one.
      const bool mixed = for_all ? !clause.exists.empty() : clause.bound.size() > clause.exists.size();
      if (mixed) return std::nullopt;
      for (const Term& variable : formula.terms) {
        if (contains(clause.bound, variable.name)) return std::nullopt;
        clause.bound.push_back(variable.name);
        if (!for_all) clause.exists.push_back(variable);
      }
    }
    return body;
  }

  std::optional<Clauses> join(std::optional<Clauses> left, std::optional<Clauses> right, bool disjunction) {
    if (!left || !right) return std::nullopt;
    if (!disjunction) {
      left->insert(left->end(), right->begin(), right->end());
      return left->size() > kMaxClauses ? std::nullopt : std::move(left);
    }
    if (left->size() * right->size() > kMaxClauses) return std::nullopt;
    Clauses product;
    for (const SyntaxClause& a : *left) {
      for (const SyntaxClause& b : *right) {
        if (meets(a, b) || meets(b, a)) return std::nullopt;
        SyntaxClause both = a;
        both.bound.insert(both.bound.end(), b.bound.begin(), b.bound.end());
        both.exists.insert(both.exists.end(), b.exists.begin(), b.exists.end());
        both.literals.insert(both.literals.end(), b.literals.begin(), b.literals.end());
        product.push_back(std::move(both));
      }
    }
    return product;
  }

  static bool contains(const std::vector<std::string>& names, const std::string& name) {
    return std::find(names.begin(), names.end(), name) != names.end();
  }

  // Whether a name that is bound in one stands in the other.
  static bool meets(const SyntaxClause& binding, const SyntaxClause& other) {
    const auto in_other = [&](const std::string& name) {
      return std::any_of(other.literals.begin(), other.literals.end(),
                         [&](const Formula& written) { return mentions(written, name); });
    };
    return std::any_of(binding.bound.begin(), binding.bound.end(), in_other);
  }

  static bool mentions(const Formula& written, const std::string& name) {
    const Formula& atom = written.kind == Kind::kNot ? written.children[0] : written;
    return std::any_of(atom.terms.begin(), atom.terms.end(), [&](const Term& term) { return term.name == name; });
  }

  bool dropped_forall_ = false;
};

// Occurrences of the name outside the quantifiers that bind it.
bool is_free(const Formula& formula, const std::string& name) {
  const auto is_it = [&](const Term& term) {
    return term.name == name && term.kind != Term::Kind::kQuoted && term.kind != Term::Kind::kNumber;
  };
  const bool here = std::any_of(formula.terms.begin(), formula.terms.end(), is_it);
  if (formula.kind == Kind::kExists || formula.kind == Kind::kForall) {
    return !here && is_free(formula.children[0], name);
  }
  return here || std::any_of(formula.children.begin(), formula.children.end(),
                             [&](const Formula& child) { return is_free(child, name); });
}

bool quantifies_a_free_name(const Formula& formula, const Formula& whole) {
  const bool quantifier = formula.kind == Kind::kExists || formula.kind == Kind::kForall;
  if (quantifier && std::any_of(formula.terms.begin(), formula.terms.end(),
                                [&](const Term& term) { return is_free(whole, term.name); })) {
    return true;
  }
  return std::any_of(formula.children.begin(), formula.children.end(),
                     [&](const Formula& child) { return quantifies_a_free_name(child, whole); });
}

}  // namespace

std::optional<std::vector<SyntaxClause>> to_clauses(const Formula& formula, bool negated, bool* keeps_groundings) {
  if (quantifies_a_free_name(formula, formula)) return std::nullopt;
  Converter converter;
  std::optional<Clauses> clauses = converter.convert(formula, negated);
  if (keeps_groundings != nullptr) {
    *keeps_groundings = clauses && clauses->size() == 1 && !converter.dropped_forall();
  }
  return clauses;
}

}  // namespace sherlog
