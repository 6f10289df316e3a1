// Trees to text (printer.h). A bracket stands where it was written, or where the text would else be read as another
// tree.
#include "mln/printer.h"

#include <fmt/format.h>

#include <algorithm>
#include <string_view>

#include "mln/lexer.h"

namespace sherlog {

using namespace syntax;

namespace {

// How tightly a formula's own operator binds, as in the parser.
int level_of(Kind kind) {
  switch (kind) {
    case Kind::kIff:
      return 2;
    case Kind::kImplies:
      return 3;
    case Kind::kOr:
      return 4;
    case Kind::kAnd:
      return 5;
    default:
      return 6;
  }
}

bool is_comparison(Kind kind) { return kind >= Kind::kEqual && kind <= Kind::kGreaterEqual; }
bool is_quantifier(Kind kind) { return kind == Kind::kExists || kind == Kind::kForall; }

std::string_view spelling(Kind kind, Dialect dialect) {
  switch (kind) {
    case Kind::kEqual:
      return " = ";
    case Kind::kNotEqual:
      return dialect == Dialect::kPracmln ? " =/= " : " != ";
    case Kind::kLess:
      return " < ";
    case Kind::kLessEqual:
      return " <= ";
    case Kind::kGreater:
      return " > ";
    case Kind::kGreaterEqual:
      return " >= ";
    case Kind::kAnd:
      return " ^ ";
    case Kind::kOr:
      return " v ";
    case Kind::kImplies:
      return " => ";
    case Kind::kIff:
      return " <=> ";
    default:
      return "";
  }
}

class FormulaPrinter {
 public:
  explicit FormulaPrinter(Dialect dialect) : dialect_(dialect) {}

  std::string take() { return std::move(text_); }

  void write(const Formula& formula, bool brackets) {
    if (brackets) text_ += '(';
    if (is_quantifier(formula.kind)) {
      write_quantified(formula);
    } else if (formula.kind == Kind::kNot) {
      text_ += '!';
      for (const Formula& child : formula.children) write_child(formula, child, false);
    } else if (is_comparison(formula.kind)) {
      write_comparison(formula);
    } else if (formula.kind == Kind::kAtom || formula.kind == Kind::kStarAtom) {
      write_atom(formula);
    } else {
      for (std::size_t i = 0; i < formula.children.size(); ++i) {
        if (i > 0) text_ += spelling(formula.kind, dialect_);
        write_child(formula, formula.children[i], i > 0);
      }
    }
    if (brackets) text_ += ')';
  }

 private:
  bool needs_brackets(const Formula& parent, const Formula& child, bool last) const {
    const int level = level_of(child.kind);
    switch (parent.kind) {
      case Kind::kNot:
        return level < 6 || is_comparison(child.kind) || (is_quantifier(child.kind) && dialect_ != Dialect::kSherlog);
      case Kind::kExists:
      case Kind::kForall:
        // A body without brackets would reach to the end of the formula.
        return !is_quantifier(child.kind) || dialect_ != Dialect::kSherlog;
      case Kind::kAnd:
        return level < 6;
      case Kind::kOr:
        return level < 5 || (level == 5 && dialect_ != Dialect::kSherlog);
      case Kind::kImplies:
        return level < (last ? 3 : 4);
      case Kind::kIff:
        return level < (last ? 2 : 3);
      default:
        return false;
    }
  }

  void write_child(const Formula& parent, const Formula& child, bool last) {
    write(child, child.bracketed || needs_brackets(parent, child, last));
  }

  void write_quantified(const Formula& formula) {
    text_ += formula.kind == Kind::kExists ? "EXIST " : "FORALL ";
    write_terms(formula.terms, ", ");
    text_ += ' ';
    for (const Formula& child : formula.children) write(child, needs_brackets(formula, child, false));
  }

  void write_comparison(const Formula& formula) {
    text_ += print(formula.terms.front(), dialect_);
    text_ += spelling(formula.kind, dialect_);
    text_ += print(formula.terms.back(), dialect_);
  }

  void write_atom(const Formula& formula) {
    if (formula.kind == Kind::kStarAtom) text_ += '*';
    text_ += formula.name;
    text_ += '(';
    write_terms(formula.terms, ", ");
    text_ += ')';
  }

  void write_terms(const std::vector<Term>& terms, std::string_view separator) {
    for (std::size_t i = 0; i < terms.size(); ++i) {
      if (i > 0) text_ += separator;
      text_ += print(terms[i], dialect_);
    }
  }

  Dialect dialect_;
  std::string text_;
};

bool mentions_marked_variable(const Formula& formula, std::string_view name) {
  const auto is_it = [&](const Term& term) { return term.kind == Term::Kind::kVariable && term.name == name; };
  return std::any_of(formula.terms.begin(), formula.terms.end(), is_it) ||
         std::any_of(formula.children.begin(), formula.children.end(),
                     [&](const Formula& child) { return mentions_marked_variable(child, name); });
}

std::string print_weight(const WeightedFormula& statement, Dialect dialect) {
  const bool expressions = dialect == Dialect::kSherlog || dialect == Dialect::kPracmln;
  if (!statement.weight_text.empty() && expressions) return statement.weight_text;
  return fmt::format("{}", *statement.weight);
}

std::string print_statement(const WeightedFormula& statement, Dialect dialect) {
  std::string text;
  if (!statement.unique.empty()) {
    text += "#unique{";
    for (const std::string& name : statement.unique) {
      const bool marked = dialect == Dialect::kPracmln || mentions_marked_variable(statement.formula, name);
      text += fmt::format("{}+{}{}", text.back() == '{' ? "" : ",", marked ? "?" : "", name);
    }
    text += "}\n";
  }
  const bool tuffy = dialect == Dialect::kTuffy;
  if (statement.fixed && !(tuffy && statement.weight)) text += "#fixweight\n";
  Formula formula = statement.formula;
  if (statement.negated && dialect != Dialect::kSherlog) {
    Formula negation;
    negation.kind = Kind::kNot;
    negation.children.push_back(std::move(formula));
    formula = std::move(negation);
  }
  const std::string body = print(formula, dialect);
  if (statement.negated && dialect == Dialect::kSherlog) {
    return text + (statement.weight_text.empty() ? "logx(0)" : statement.weight_text) + " " + body;
  }
  if (statement.hard) return text + body + ".";
  if (!statement.weight) return text + body;
  // These would be read on as part of the weight.
  const bool runs_on = std::string_view("+-*/^.0123456789").find(body.front()) != std::string_view::npos;
  const std::string weight = (statement.fixed && tuffy ? "@" : "") + print_weight(statement, dialect);
  return text + weight + (runs_on ? ": " : " ") + body;
}

std::string print_statement(const DomainDeclaration& domain, Dialect dialect) {
  std::string text = domain.name + " = {";
  for (std::size_t i = 0; i < domain.constants.size(); ++i) {
    if (i > 0) text += domain.range ? ", ..., " : ", ";
    text += print(domain.constants[i], dialect);
  }
  return text + "}";
}

std::string print_statement(const PredicateDeclaration& predicate, Dialect dialect) {
  const bool star = predicate.closed && (dialect == Dialect::kSherlog || dialect == Dialect::kTuffy);
  std::string text = (star ? "*" : "") + predicate.name + "(";
  for (std::size_t i = 0; i < predicate.arguments.size(); ++i) {
    if (i > 0) text += ", ";
    text += predicate.arguments[i].domain;
    if (predicate.arguments[i].mark != 0) text += predicate.arguments[i].mark;
  }
  return text + ")";
}

std::string print_statement(const Include& include, Dialect) { return "#include " + in_quotes(include.file); }

bool equal(const Term& left, const Term& right) {
  return left.kind == right.kind && left.name == right.name && left.plus == right.plus;
}

bool equal(const std::vector<Term>& left, const std::vector<Term>& right) {
  return std::equal(left.begin(), left.end(), right.begin(), right.end(),
                    [](const Term& a, const Term& b) { return equal(a, b); });
}

bool equal(const DomainDeclaration& left, const DomainDeclaration& right) {
  return left.name == right.name && left.range == right.range && equal(left.constants, right.constants);
}

bool equal(const PredicateDeclaration& left, const PredicateDeclaration& right) {
  const auto same = [](const Argument& a, const Argument& b) { return a.domain == b.domain && a.mark == b.mark; };
  return left.name == right.name && left.closed == right.closed &&
         std::equal(left.arguments.begin(), left.arguments.end(), right.arguments.begin(), right.arguments.end(), same);
}

bool equal(const WeightedFormula& left, const WeightedFormula& right) {
  return left.weight == right.weight && left.weight_text == right.weight_text && left.hard == right.hard &&
         left.negated == right.negated && left.fixed == right.fixed && left.unique == right.unique &&
         sherlog::equal(left.formula, right.formula);
}

bool equal(const Include& left, const Include& right) { return left.file == right.file; }

}  // namespace

std::string print(const Term& term, Dialect dialect) {
  const std::string sign = term.plus ? "+" : "";
  switch (term.kind) {
    case Term::Kind::kQuoted:
      return sign + in_quotes(term.name);
    case Term::Kind::kIdentifier:
      return sign + quoted_if_needed(term.name);
    case Term::Kind::kNumber:
      return sign + term.name;
    case Term::Kind::kVariable:
      break;
  }
  const bool marks = dialect == Dialect::kSherlog || dialect == Dialect::kPracmln;
  return sign + (marks ? "?" : "") + term.name;
}

std::string print(const Formula& formula, Dialect dialect) {
  FormulaPrinter printer(dialect);
  printer.write(formula, formula.bracketed);
  return printer.take();
}

std::string print(const Model& model, Dialect dialect, bool inline_includes) {
  std::string text;
  for (std::size_t i = 0; i < model.statements.size(); ++i) {
    const int depth = i < model.depth.size() ? model.depth[i] : 0;
    if (depth > 0 && !inline_includes) continue;
    const bool followed = i + 1 < model.depth.size() && model.depth[i + 1] > depth;
    if (inline_includes && followed && std::holds_alternative<Include>(model.statements[i])) continue;
    text += std::visit([&](const auto& statement) { return print_statement(statement, dialect); }, model.statements[i]);
    text += '\n';
  }
  return text;
}

bool equal(const Formula& left, const Formula& right) {
  return left.kind == right.kind && left.name == right.name && left.bracketed == right.bracketed &&
         equal(left.terms, right.terms) &&
         std::equal(left.children.begin(), left.children.end(), right.children.begin(), right.children.end(),
                    [](const Formula& a, const Formula& b) { return equal(a, b); });
}

bool equal(const Model& left, const Model& right) {
  const auto same = [](const Statement& a, const Statement& b) {
    if (a.index() != b.index()) return false;
    return std::visit([&](const auto& x) { return equal(x, std::get<std::decay_t<decltype(x)>>(b)); }, a);
  };
  return left.depth == right.depth && std::equal(left.statements.begin(), left.statements.end(),
                                                 right.statements.begin(), right.statements.end(), same);
}

}  // namespace sherlog
