// Dialect knowledge (convert.h). Warnings have the code "dialect".
#include "mln/convert.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>
#include <map>
#include <set>
#include <utility>

#include "mln/clauses.h"
#include "mln/lexer.h"

namespace sherlog {

using namespace syntax;

namespace {

constexpr long long kLargestWrittenOut = 100'000;  // values of a range

bool is_upper(char c) { return c >= 'A' && c <= 'Z'; }
bool is_quantifier(Kind kind) { return kind == Kind::kExists || kind == Kind::kForall; }
bool is_atom(Kind kind) { return kind == Kind::kAtom || kind == Kind::kStarAtom; }

// Letters, digits and _ only: what every system takes as a name.
bool is_word(std::string_view name) {
  return !name.empty() && std::all_of(name.begin(), name.end(), [](char c) {
    return (c >= 'a' && c <= 'z') || is_upper(c) || (c >= '0' && c <= '9') || c == '_';
  });
}

bool any_term(const Formula& formula, const auto& test) {
  return std::any_of(formula.terms.begin(), formula.terms.end(), test) ||
         std::any_of(formula.children.begin(), formula.children.end(),
                     [&](const Formula& child) { return any_term(child, test); });
}

bool has_kind(const Formula& formula, Kind kind) {
  return formula.kind == kind || std::any_of(formula.children.begin(), formula.children.end(),
                                             [&](const Formula& child) { return has_kind(child, kind); });
}

Formula negation_of(Formula formula) {
  Formula result;
  result.kind = Kind::kNot;
  result.place = formula.place;
  result.children.push_back(std::move(formula));
  return result;
}

// FORALL x f becomes !(EXIST x (!f)).
Formula without_forall(Formula formula) {
  for (Formula& child : formula.children) child = without_forall(std::move(child));
  if (formula.kind != Kind::kForall) return formula;
  formula.kind = Kind::kExists;
  formula.bracketed = false;
  formula.children[0] = negation_of(std::move(formula.children[0]));
  return negation_of(std::move(formula));
}

std::string dialect_name(Dialect dialect) {
  switch (dialect) {
    case Dialect::kAlchemy:
      return "Alchemy";
    case Dialect::kPracmln:
      return "pracmln";
    case Dialect::kTuffy:
      return "Tuffy";
    case Dialect::kSherlog:
      break;
  }
  return "Sherlog";
}

class DialectWriter {
 public:
  DialectWriter(const Model& model, Dialect dialect, Diagnostics& diagnostics)
      : model_(model), dialect_(dialect), diagnostics_(diagnostics) {
    for (const Statement& statement : model.statements) {
      if (const auto* domain = std::get_if<DomainDeclaration>(&statement)) {
        for (const Term& constant : domain->constants) members_[domain->name].insert(constant.name);
      } else if (const auto* predicate = std::get_if<PredicateDeclaration>(&statement)) {
        predicates_[predicate->name] = predicate;
      }
    }
  }

  std::string write() {
    for (std::size_t i = 0; i < model_.statements.size(); ++i) {
      std::visit([&](const auto& statement) { add(statement); }, model_.statements[i]);
    }
    return std::move(text_);
  }

 private:
  bool by_case() const { return dialect_ == Dialect::kAlchemy || dialect_ == Dialect::kTuffy; }

  void warn(const Place& place, const std::string& text) {
    diagnostics_.warning("dialect", place, dialect_name(dialect_) + " " + text);
  }

  void print_one(Statement statement) { text_ += print(Model{{std::move(statement)}, {0}}, dialect_, true); }

  void comment_out(const WeightedFormula& statement, const std::string& reason) {
    warn(statement.place, reason + "; the formula is written as a comment");
    std::string lines = print(Model{{statement}, {0}}, Dialect::kSherlog);
    for (std::size_t i = lines.find('\n'); i + 1 < lines.size(); i = lines.find('\n', i + 1)) {
      lines.insert(i + 1, "// ");
    }
    text_ += "// " + lines;
  }

  void add(const Include&) {}  // the statements of the file follow

  void add(DomainDeclaration domain) {
    if (domain.range && (dialect_ == Dialect::kPracmln || dialect_ == Dialect::kTuffy)) write_out_range(domain);
    for (Term& constant : domain.constants) constant = constant_term(std::move(constant));
    print_one(std::move(domain));
  }

  void write_out_range(DomainDeclaration& domain) {
    const auto value = [](const Term& end) { return std::strtoll(end.name.c_str(), nullptr, 10); };
    const long long first = value(domain.constants.front());
    const long long last = value(domain.constants.back());
    if (first < -kLargestWrittenOut || last - first >= kLargestWrittenOut) {
      return warn(domain.place, fmt::format("has no ranges, and that of '{}' is too long to write out", domain.name));
    }
    Term term = domain.constants.front();
    domain.constants.clear();
    domain.range = false;
    for (long long i = first; i <= last; ++i) {
      term.name = std::to_string(i);
      domain.constants.push_back(term);
    }
  }

  void add(PredicateDeclaration predicate) {
    if (predicate.closed && dialect_ != Dialect::kTuffy && dialect_ != Dialect::kSherlog) {
      warn(predicate.place,
           fmt::format("cannot declare '{}' closed here; name it closed on its command line", predicate.name));
    }
    std::vector<std::size_t> marked;
    char mark = 0;
    for (std::size_t i = 0; i < predicate.arguments.size(); ++i) {
      if (predicate.arguments[i].mark == 0) continue;
      marked.push_back(i);
      mark = predicate.arguments[i].mark;
    }
    const bool has_blocks = dialect_ != Dialect::kTuffy && !(dialect_ == Dialect::kAlchemy && mark == '?');
    const bool as_formulas = !marked.empty() && !has_blocks;
    if (as_formulas) {
      warn(predicate.place,
           fmt::format("has no blocks of this kind: that of '{}' is written as hard formulas", predicate.name));
      for (Argument& argument : predicate.arguments) argument.mark = 0;
    }
    const PredicateDeclaration kept = predicate;
    print_one(std::move(predicate));
    if (as_formulas) add_block_formulas(kept, marked, mark);
  }

  // At most one: two values of a block are the same; exactly one: there is a value, too.
  void add_block_formulas(const PredicateDeclaration& predicate, const std::vector<std::size_t>& marked, char mark) {
    const auto atom = [&](const std::string& suffix) {
      Formula result;
      result.name = predicate.name;
      for (std::size_t i = 0; i < predicate.arguments.size(); ++i) {
        const bool value = std::find(marked.begin(), marked.end(), i) != marked.end();
        result.terms.push_back({Term::Kind::kIdentifier, fmt::format("a{}{}", i + 1, value ? suffix : ""), false, {}});
      }
      return result;
    };
    for (const std::size_t i : marked) {
      WeightedFormula at_most;
      at_most.hard = true;
      Formula same;
      same.kind = Kind::kEqual;
      same.terms = {atom("x").terms[i], atom("y").terms[i]};
      at_most.formula.kind = Kind::kOr;
      at_most.formula.children = {negation_of(atom("x")), negation_of(atom("y")), same};
      print_one(std::move(at_most));
    }
    if (mark != '!') return;
    WeightedFormula some;
    some.hard = true;
    some.formula.kind = Kind::kExists;
    for (const std::size_t i : marked) some.formula.terms.push_back(atom("x").terms[i]);
    some.formula.children = {atom("x")};
    print_one(std::move(some));
  }

  void add(WeightedFormula statement) {
    const WeightedFormula original = statement;
    if (dialect_ == Dialect::kSherlog) {
      bracket_mixes(statement.formula);
      return print_one(std::move(statement));
    }
    if (by_case() && !statement.unique.empty()) return comment_out(original, "has no '#unique'");
    const bool templates = any_term(statement.formula, [](const Term& term) { return term.plus; });
    if (dialect_ == Dialect::kTuffy && (templates || has_kind(statement.formula, Kind::kStarAtom))) {
      return comment_out(original, "has no '+' and '*' templates");
    }
    if (statement.fixed && dialect_ == Dialect::kAlchemy) {
      warn(statement.place, "cannot keep a weight fixed: it would be learned");
      statement.fixed = false;
    }
    rename(statement.formula);
    if (dialect_ == Dialect::kTuffy) return add_clauses(std::move(statement), original);
    if (dialect_ == Dialect::kPracmln) {
      statement.formula = without_forall(std::move(statement.formula));
      if (!statement.weight && !statement.hard) statement.weight = 0;
    }
    print_one(std::move(statement));
  }

  static void bracket_mixes(Formula& formula) {
    for (Formula& child : formula.children) {
      if (formula.kind == Kind::kOr && child.kind == Kind::kAnd) child.bracketed = true;
      if (formula.kind == Kind::kAnd && child.kind == Kind::kOr) child.bracketed = true;
      bracket_mixes(child);
    }
  }

  // A formula that is one clause keeps its weight. One whose negation is a clause has the weight -w there: n of a
  // formula and n of its negation add up to a constant.
  void add_clauses(WeightedFormula statement, const WeightedFormula& original) {
    bool one_clause = false;
    if (statement.hard) {
      const auto clauses = to_clauses(statement.formula, statement.negated);
      if (!clauses) return comment_out(original, "takes clauses only, and this formula has no small clausal form");
      for (const SyntaxClause& clause : *clauses) print_clause(statement, clause);
      return;
    }
    if (!statement.weight) statement.weight = 0;
    for (const bool negated : {false, true}) {
      const auto clauses = to_clauses(statement.formula, negated, &one_clause);
      if (!one_clause) continue;
      if (negated) {
        statement.weight = -*statement.weight;
        statement.weight_text.clear();
      }
      return print_clause(statement, clauses->front());
    }
    comment_out(original, "takes clauses only, and dividing a weight over several would change the model");
  }

  void print_clause(const WeightedFormula& statement, const SyntaxClause& clause) {
    WeightedFormula result = statement;
    result.negated = false;
    result.formula = {};
    result.formula.kind = Kind::kOr;
    result.formula.children = clause.literals;
    if (clause.literals.size() == 1) result.formula = Formula(clause.literals.front());
    if (!clause.exists.empty()) {
      Formula quantified;
      quantified.kind = Kind::kExists;
      quantified.terms = clause.exists;
      quantified.children = {std::move(result.formula)};
      result.formula = std::move(quantified);
    }
    print_one(std::move(result));
  }

  // ---- names -------------------------------------------------------------------------------------------------------

  struct Scope {
    bool marked = false;                         // the formula writes its variables ?x
    std::set<std::string> quantified;            // plain names bound by a quantifier
    std::set<std::string> variables;             // plain names that stand for variables in some atom
    std::map<std::string, std::string> written;  // variables as they are written in this dialect
    std::set<std::string> used;
  };

  bool is_member(const std::string& predicate, std::size_t argument, const std::string& name) const {
    const auto found = predicates_.find(predicate);
    if (found == predicates_.end() || argument >= found->second->arguments.size()) return false;
    const auto domain = members_.find(found->second->arguments[argument].domain);
    return domain != members_.end() && domain->second.contains(name);
  }

  void collect(const Formula& formula, Scope& scope) const {
    for (std::size_t i = 0; i < formula.terms.size(); ++i) {
      const Term& term = formula.terms[i];
      if (term.kind == Term::Kind::kVariable) scope.marked = true;
      if (term.kind != Term::Kind::kIdentifier) continue;
      if (is_quantifier(formula.kind)) scope.quantified.insert(term.name);
      const bool variable =
          is_atom(formula.kind) && !is_capitalised(term.name) && !is_member(formula.name, i, term.name);
      if (variable || term.plus) scope.variables.insert(term.name);
    }
    for (const Formula& child : formula.children) collect(child, scope);
  }

  bool is_variable(const Formula& formula, std::size_t i, const Scope& scope) const {
    const Term& term = formula.terms[i];
    if (term.kind == Term::Kind::kVariable) return true;
    if (term.kind != Term::Kind::kIdentifier) return false;
    if (term.plus || is_quantifier(formula.kind) || scope.quantified.contains(term.name)) return true;
    if (scope.marked || is_capitalised(term.name)) return false;
    if (is_atom(formula.kind)) return !is_member(formula.name, i, term.name);
    if (scope.variables.contains(term.name)) return true;
    return std::none_of(members_.begin(), members_.end(),
                        [&](const auto& domain) { return domain.second.contains(term.name); });
  }

  void rename(Formula& formula) {
    Scope scope;
    collect(formula, scope);
    rename(formula, scope);
  }

  void rename(Formula& formula, Scope& scope) {
    std::vector<Term> terms;
    for (std::size_t i = 0; i < formula.terms.size(); ++i) {
      const Term& term = formula.terms[i];
      terms.push_back(is_variable(formula, i, scope) ? variable_term(term, scope) : constant_term(term));
    }
    formula.terms = std::move(terms);
    for (Formula& child : formula.children) rename(child, scope);
  }

  // ?x and x are two variables; each gets a name of its own, in the dialect's case.
  Term variable_term(Term term, Scope& scope) const {
    const std::string key = (term.kind == Term::Kind::kVariable ? "?" : "") + term.name;
    auto found = scope.written.find(key);
    if (found == scope.written.end()) {
      std::string name;
      for (const char c : term.name) name += is_word(std::string_view(&c, 1)) ? c : '_';
      if (by_case() && is_upper(name[0])) name[0] = static_cast<char>(name[0] - 'A' + 'a');
      if (by_case() && (name[0] < 'a' || name[0] > 'z')) name.insert(0, "x");
      if (by_case() && name == "v") name = "v1";
      const std::string base = name;
      for (int i = 1; !scope.used.insert(name).second; ++i) name = fmt::format("{}_{}", base, i);
      found = scope.written.emplace(key, name).first;
    }
    term.name = found->second;
    term.kind = dialect_ == Dialect::kPracmln ? Term::Kind::kVariable : Term::Kind::kIdentifier;
    return term;
  }

  Term constant_term(Term term) {
    if (dialect_ == Dialect::kSherlog || term.kind == Term::Kind::kNumber) return term;
    const bool word = is_word(term.name);
    if (dialect_ == Dialect::kPracmln) {
      term.kind = word ? Term::Kind::kIdentifier : Term::Kind::kQuoted;
      return term;
    }
    const bool plain = word && is_upper(term.name[0]);
    if (!plain && term.kind == Term::Kind::kIdentifier && !warned_case_) {
      warned_case_ = true;
      warn(term.place, fmt::format("takes constants in capitals or quotes: '{}' and the like are written in quotes, "
                                   "and so they have to be in the evidence",
                                   term.name));
    }
    term.kind = plain ? Term::Kind::kIdentifier : Term::Kind::kQuoted;
    return term;
  }

  const Model& model_;
  Dialect dialect_;
  Diagnostics& diagnostics_;
  std::map<std::string, std::set<std::string>> members_;  // of declared domains
  std::map<std::string, const PredicateDeclaration*> predicates_;
  bool warned_case_ = false;
  std::string text_;
};

}  // namespace

std::string convert(const Model& model, Dialect dialect, Diagnostics& diagnostics) {
  return DialectWriter(model, dialect, diagnostics).write();
}

}  // namespace sherlog
