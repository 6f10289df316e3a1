// Formulas from tokens (formula_parser.h). Tightest first: !, ^, v, =>, <=>, :-.
#include "mln/formula_parser.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "mln/printer.h"

namespace sherlog {

using syntax::Formula;
using syntax::Kind;
using syntax::Term;

namespace {

constexpr int kLevelIf = 1, kLevelIff = 2, kLevelImplies = 3, kLevelLoose = 4, kLevelTight = 5;
constexpr std::size_t kShownBytes = 160;  // of a formula inside a message

std::string upper(std::string_view text) {
  std::string result(text);
  for (char& c : result) {
    if (c >= 'a' && c <= 'z') c = static_cast<char>(c - 'a' + 'A');
  }
  return result;
}

bool is_comparison(TokenKind kind) {
  return kind == TokenKind::kEqual || kind == TokenKind::kNotEqual || kind == TokenKind::kLess ||
         kind == TokenKind::kLessEqual || kind == TokenKind::kGreater || kind == TokenKind::kGreaterEqual;
}

bool is_comparison(Kind kind) { return kind >= Kind::kEqual && kind <= Kind::kGreaterEqual; }

Kind comparison_kind(TokenKind kind) {
  switch (kind) {
    case TokenKind::kNotEqual:
      return Kind::kNotEqual;
    case TokenKind::kLess:
      return Kind::kLess;
    case TokenKind::kLessEqual:
      return Kind::kLessEqual;
    case TokenKind::kGreater:
      return Kind::kGreater;
    case TokenKind::kGreaterEqual:
      return Kind::kGreaterEqual;
    default:
      return Kind::kEqual;
  }
}

bool is_arithmetic(TokenKind kind) {
  return kind == TokenKind::kPlus || kind == TokenKind::kMinus || kind == TokenKind::kStar || kind == TokenKind::kSlash;
}

// The first v that has an unbracketed ^ below it.
const Formula* find_mix(const Formula& formula) {
  for (const Formula& child : formula.children) {
    if (formula.kind == Kind::kOr && child.kind == Kind::kAnd && !child.bracketed) return &formula;
    if (const Formula* found = find_mix(child)) return found;
  }
  return nullptr;
}

}  // namespace

FormulaParser::FormulaParser(std::string_view text, std::uint32_t file, Diagnostics& diagnostics,
                             const ParseOptions& options)
    : lexer_(text, file), diagnostics_(diagnostics), options_(options) {
  token_ = lexer_.next();
  last_ = token_;
  last_.end = token_.begin;
  last_.end_line = token_.line;
  last_.end_column = token_.column;
  begin_statement();
}

void FormulaParser::restore(const State& state) {
  lexer_ = state.lexer;
  token_ = state.token;
  last_ = state.last;
  open_ = state.open;
}

void FormulaParser::take() {
  last_ = token_;
  token_ = lexer_.next();
}

bool FormulaParser::take_if(TokenKind kind) {
  if (!at(kind)) return false;
  take();
  return true;
}

void FormulaParser::begin_statement() {
  statement_begin_ = token_.begin;
  open_ = 0;
  depth_ = 0;
  mixed_ = false;
}

bool FormulaParser::at_end_of_statement() const {
  if (token_.kind == TokenKind::kEnd) return true;
  return open_ == 0 && token_.line_break && token_.begin != statement_begin_;
}

void FormulaParser::error(std::string code, const Place& place, std::string text, std::vector<Note> notes) {
  diagnostics_.error(std::move(code), place, std::move(text), std::move(notes));
}

void FormulaParser::fail(const std::string& expected, std::vector<Note> notes) {
  const Place place = lexer_.place(token_);
  switch (token_.kind) {
    case TokenKind::kUnclosedString:
      return error("syntax", place, "a string is not closed at the end of its line");
    case TokenKind::kUnclosedComment:
      return error("syntax", place, "a comment is not closed: '*/' is missing");
    case TokenKind::kStray:
      return error("syntax", place, fmt::format("unexpected {}", describe(token_)));
    default:
      break;
  }
  if (at_end_of_statement()) {
    const bool file_ends = token_.kind == TokenKind::kEnd && open_ > 0;
    const char* found = file_ends ? "end of file" : "end of line";
    return error("syntax", lexer_.behind(last_), fmt::format("expected {}, found {}", expected, found),
                 std::move(notes));
  }
  error("syntax", place, fmt::format("expected {}, found {}", expected, describe(token_)), std::move(notes));
}

void FormulaParser::functions_error(const Token& first) {
  error("functions", lexer_.place(first, token_), "functions are not supported in this release");
}

bool FormulaParser::at_comparison() const { return is_comparison(token_.kind) && !at_end_of_statement(); }

std::optional<FormulaParser::Operator> FormulaParser::connective() const {
  const bool and_tighter = options_.precedence == Precedence::kAndTighter;
  const Place place = lexer_.place(token_);
  switch (token_.kind) {
    case TokenKind::kAnd:
      return Operator{Kind::kAnd, false, and_tighter ? kLevelTight : kLevelLoose, place};
    case TokenKind::kOr:
      return Operator{Kind::kOr, false, and_tighter ? kLevelLoose : kLevelTight, place};
    case TokenKind::kImplies:
      return Operator{Kind::kImplies, false, kLevelImplies, place};
    case TokenKind::kIff:
      return Operator{Kind::kIff, false, kLevelIff, place};
    case TokenKind::kIf:
      return Operator{Kind::kImplies, true, kLevelIf, place};
    case TokenKind::kName:
      break;
    default:
      return std::nullopt;
  }
  if (token_.text != "v") return std::nullopt;
  // On a new line v( opens an atom.
  if (open_ == 0 && token_.line_break && lexer_.text().substr(token_.end).starts_with('(')) return std::nullopt;
  return Operator{Kind::kOr, false, and_tighter ? kLevelLoose : kLevelTight, place};
}

bool FormulaParser::at_connective() const { return connective().has_value(); }

std::optional<Kind> FormulaParser::quantifier() const {
  if (token_.kind == TokenKind::kExists) return Kind::kExists;
  if (token_.kind == TokenKind::kForall) return Kind::kForall;
  if (token_.kind != TokenKind::kName || token_.text.size() > 6) return std::nullopt;
  const std::string word = upper(token_.text);
  if (word != "EXIST" && word != "EXISTS" && word != "FORALL") return std::nullopt;
  Lexer ahead = lexer_;
  const Token next = ahead.next();
  if (next.kind != TokenKind::kName && next.kind != TokenKind::kVariable) return std::nullopt;  // a predicate's name
  return word == "FORALL" ? Kind::kForall : Kind::kExists;
}

std::optional<Formula> FormulaParser::parse_whole_formula() {
  std::optional<Operand> result = parse_operators();
  if (!result) return std::nullopt;
  if (mixed_ && options_.precedence == Precedence::kAndTighter) warn_if_mixed(result->formula);
  return std::move(result->formula);
}

bool FormulaParser::check_height(int height, const Place& place) {
  if (height <= options_.max_depth) return true;
  error("nesting", place, fmt::format("the formula is nested more than {} deep", options_.max_depth));
  return false;
}

// Joins the two topmost operands by the topmost operator; ^ and v collect the operands of a chain.
bool FormulaParser::reduce(std::vector<Operand>& operands, std::vector<Operator>& operators) {
  const Operator op = operators.back();
  operators.pop_back();
  Operand right = std::move(operands.back());
  operands.pop_back();
  Operand& left = operands.back();
  const bool chains = op.kind == Kind::kAnd || op.kind == Kind::kOr;
  if (op.kind == Kind::kOr) {
    for (const Operand* side : {&left, &right}) {
      mixed_ = mixed_ || (side->formula.kind == Kind::kAnd && !side->formula.bracketed);
    }
  }
  if (chains && left.formula.kind == op.kind && !left.formula.bracketed) {
    left.height = std::max(left.height, right.height + 1);
    left.formula.children.push_back(std::move(right.formula));
    return check_height(left.height, op.place);
  }
  if (op.reversed) {
    // The body comes first in the tree; it keeps its meaning there only in brackets.
    if (right.formula.kind == Kind::kImplies || right.formula.kind == Kind::kIff) right.formula.bracketed = true;
    if (left.formula.kind == Kind::kIff) left.formula.bracketed = true;
    std::swap(left, right);
  }
  Operand joined;
  joined.formula.kind = op.kind;
  joined.formula.place = op.place;
  joined.height = 1 + std::max(left.height, right.height);
  joined.formula.children.reserve(2);
  joined.formula.children.push_back(std::move(left.formula));
  joined.formula.children.push_back(std::move(right.formula));
  left = std::move(joined);
  return check_height(left.height, op.place);
}

std::optional<FormulaParser::Operand> FormulaParser::parse_operators() {
  std::vector<Operand> operands;
  std::vector<Operator> operators;
  while (true) {
    std::optional<Operand> operand = parse_unary();
    if (!operand) return std::nullopt;
    operands.push_back(std::move(*operand));
    const std::optional<Operator> op = connective();
    if (!op) break;
    const auto binds_before = [&](const Operator& before) {
      // => and <=> group to the right (which for <=> means the same), the others to the left.
      const bool right = op->level == kLevelImplies || op->level == kLevelIff;
      return before.level > op->level || (before.level == op->level && !right);
    };
    while (!operators.empty() && binds_before(operators.back())) {
      if (operators.back().reversed) {
        error("syntax", op->place, "':-' can stand only once in a rule");
        return std::nullopt;
      }
      if (!reduce(operands, operators)) return std::nullopt;
    }
    operators.push_back(*op);
    if (!check_height(static_cast<int>(operators.size()), op->place)) return std::nullopt;
    take();
    statement_begin_ = token_.begin;  // the operand may stand on the next line
  }
  while (!operators.empty()) {
    if (!reduce(operands, operators)) return std::nullopt;
  }
  return std::move(operands.front());
}

std::optional<FormulaParser::Operand> FormulaParser::parse_unary() {
  std::vector<Place> negations;
  while (at(TokenKind::kNot)) {
    negations.push_back(lexer_.place(token_));
    if (!check_height(depth_ + static_cast<int>(negations.size()), negations.back())) return std::nullopt;
    take();
  }
  std::optional<Operand> operand = parse_primary();
  if (!operand) return std::nullopt;
  if (!check_height(operand->height + static_cast<int>(negations.size()), operand->formula.place)) return std::nullopt;
  if (!negations.empty() && is_comparison(operand->formula.kind)) operand->formula.bracketed = true;
  for (auto place = negations.rbegin(); place != negations.rend(); ++place) {
    Formula negation;
    negation.kind = Kind::kNot;
    negation.place = *place;
    negation.children.push_back(std::move(operand->formula));
    operand->formula = std::move(negation);
    ++operand->height;
  }
  return operand;
}

std::optional<FormulaParser::Operand> FormulaParser::parse_primary() {
  if (at_end_of_statement()) {
    fail("a formula");
    return std::nullopt;
  }
  if (token_.kind == TokenKind::kOpen) return parse_bracketed();
  if (quantifier()) return parse_quantified();
  if (token_.kind == TokenKind::kStar) {
    take();
    if (at(TokenKind::kName)) return parse_atom(true);
    fail("a predicate after '*'");
    return std::nullopt;
  }
  if (token_.kind == TokenKind::kName) {
    Lexer ahead = lexer_;
    const Token next = ahead.next();
    if (next.kind == TokenKind::kOpen && (open_ > 0 || !next.line_break)) return parse_atom(false);
  }
  return parse_comparison();
}

std::optional<FormulaParser::Operand> FormulaParser::parse_bracketed() {
  const Token bracket = token_;
  if (!check_height(depth_ + 1, lexer_.place(bracket))) return std::nullopt;
  ++depth_;
  ++open_;
  take();
  std::optional<Operand> inner = parse_operators();
  if (!inner) return std::nullopt;
  if (token_.kind != TokenKind::kClose) {
    fail("a connective or ')'", {{lexer_.place(bracket), "the bracket is opened here"}});
    return std::nullopt;
  }
  --open_;
  --depth_;
  take();
  inner->formula.bracketed = true;
  return inner;
}

std::optional<FormulaParser::Operand> FormulaParser::parse_quantified() {
  Operand result;
  result.formula.kind = *quantifier();
  result.formula.place = lexer_.place(token_);
  if (!check_height(depth_ + 1, result.formula.place)) return std::nullopt;
  take();
  do {
    if (!at(TokenKind::kName) && !at(TokenKind::kVariable)) {
      fail("a variable");
      return std::nullopt;
    }
    const Term::Kind kind = token_.kind == TokenKind::kName ? Term::Kind::kIdentifier : Term::Kind::kVariable;
    result.formula.terms.push_back({kind, std::string(token_.text), false, lexer_.place(token_)});
    take();
  } while (take_if(TokenKind::kComma));
  ++depth_;
  // A body without brackets reaches as far as it can, as in Tuffy's and Alchemy's own models.
  const bool delimited = at(TokenKind::kOpen) || quantifier().has_value();
  std::optional<Operand> body = delimited ? parse_unary() : parse_operators();
  if (!body) return std::nullopt;
  --depth_;
  const bool connective = body->formula.kind >= Kind::kAnd && body->formula.kind <= Kind::kIff;
  if (!delimited && connective) {
    diagnostics_.warning(
        "quantifier-scope", result.formula.place,
        "without brackets a quantifier reaches to the end of the formula; put what it is about in brackets");
  }
  body->formula.bracketed = false;  // the brackets are the quantifier's own: the printer always writes them
  result.height = body->height + 1;
  if (!check_height(result.height, result.formula.place)) return std::nullopt;
  result.formula.children.push_back(std::move(body->formula));
  return result;
}

std::optional<Term> FormulaParser::parse_term(std::string_view expected) {
  Term term;
  const Token first = token_;
  if (take_if(TokenKind::kPlus)) term.plus = true;
  const bool negative = take_if(TokenKind::kMinus);
  const Token token = token_;
  const bool ended = at_end_of_statement();
  if (!ended && token.kind == TokenKind::kNumber) {
    term.kind = Term::Kind::kNumber;
    term.name = (negative ? "-" : "") + std::string(token.text);
  } else if (!ended && !negative && token.kind == TokenKind::kName) {
    term.name = token.text;
  } else if (!ended && !negative && token.kind == TokenKind::kVariable) {
    term.kind = Term::Kind::kVariable;
    term.name = token.text;
  } else if (!ended && !negative && !term.plus && token.kind == TokenKind::kString) {
    term.kind = Term::Kind::kQuoted;
    term.name = unquoted(token.text);
  } else {
    fail(negative ? "a number" : term.plus ? "a variable after '+'" : std::string(expected));
    return std::nullopt;
  }
  take();
  term.place = lexer_.place(first, token);
  if (!at_end_of_statement() && (token_.kind == TokenKind::kOpen || is_arithmetic(token_.kind))) {
    functions_error(first);
    return std::nullopt;
  }
  return term;
}

bool FormulaParser::parse_arguments(const Token& name, Formula& atom) {
  const Token bracket = token_;
  const std::vector<Note> opened = {{lexer_.place(bracket), "the bracket is opened here"}};
  ++open_;
  take();
  if (token_.kind == TokenKind::kClose) {
    --open_;
    take();
    return true;
  }
  while (true) {
    std::optional<Term> term = parse_term("an argument");
    if (!term) return false;
    atom.terms.push_back(std::move(*term));
    if (token_.kind == TokenKind::kComma) {
      take();
      continue;
    }
    if (token_.kind == TokenKind::kClose) break;
    if (token_.kind == TokenKind::kNot || token_.kind == TokenKind::kQuestion) {
      error("syntax", lexer_.place(token_),
            fmt::format("'{}' marks an argument in the declaration of '{}', not in a formula", token_.text, name.text));
    } else {
      fail("',' or ')'", opened);
    }
    return false;
  }
  --open_;
  take();
  return true;
}

std::optional<FormulaParser::Operand> FormulaParser::parse_atom(bool star) {
  const Token first = star ? last_ : token_;
  const Token name = token_;
  const char initial = name.text.front();
  if (name.text == "v") {
    error("syntax", lexer_.place(name), "'v' means 'or' and cannot name a predicate");
    return std::nullopt;
  }
  if (initial >= '0' && initial <= '9') {
    error("syntax", lexer_.place(name),
          fmt::format("a predicate cannot begin with a digit, found {}: put a blank behind a weight", describe(name)));
    return std::nullopt;
  }
  take();
  if (!at(TokenKind::kOpen)) {
    fail(fmt::format("'(' after {}", describe(name)));
    return std::nullopt;
  }
  Operand result;
  result.formula.kind = star ? Kind::kStarAtom : Kind::kAtom;
  result.formula.name = name.text;
  if (!parse_arguments(name, result.formula)) return std::nullopt;
  result.formula.place = lexer_.place(first, last_);
  if (at_comparison()) {
    functions_error(first);
    return std::nullopt;
  }
  return result;
}

std::optional<FormulaParser::Operand> FormulaParser::parse_comparison() {
  const Token first = token_;
  if (first.kind == TokenKind::kName && first.text == "v") {
    fail("a formula");
    return std::nullopt;
  }
  // `v = {A, B}`, read as going on from the line before.
  if (first.kind == TokenKind::kEqual && last_.kind == TokenKind::kName && last_.text == "v") {
    error("syntax", lexer_.place(last_), "'v' means 'or' and cannot name a domain");
    return std::nullopt;
  }
  std::optional<Term> left = parse_term("a formula");
  if (!left) return std::nullopt;
  if (!at_comparison()) {
    const bool is_word = left->kind == Term::Kind::kIdentifier && !left->plus;
    fail(is_word ? fmt::format("'(' or a comparison after {}", describe(first))
                 : fmt::format("a comparison after {}", describe(first)));
    return std::nullopt;
  }
  Operand result;
  result.formula.kind = comparison_kind(token_.kind);
  take();
  std::optional<Term> right = parse_term("a variable or constant");
  if (!right) return std::nullopt;
  result.formula.place = lexer_.place(first, last_);
  if (at_comparison()) {
    error("syntax", lexer_.place(token_), "comparisons do not chain: join two of them by '^'");
    return std::nullopt;
  }
  result.formula.terms.push_back(std::move(*left));
  result.formula.terms.push_back(std::move(*right));
  return result;
}

void FormulaParser::warn_if_mixed(const Formula& formula) {
  const Formula* mix = find_mix(formula);
  if (mix == nullptr) return;
  Formula shown = *mix;
  shown.bracketed = false;
  for (Formula& child : shown.children) child.bracketed = child.bracketed || child.kind == Kind::kAnd;
  std::string text = print(shown);
  if (text.size() > kShownBytes) {
    text.resize(kShownBytes);
    while (find_invalid_utf8(text) != std::string::npos) text.pop_back();
    text += "...";
  }
  diagnostics_.warning("mixed-connectives", mix->place,
                       fmt::format("'^' binds tighter than 'v' here, not in every system: this is read as '{}'; "
                                   "brackets would say so",
                                   text));
}

}  // namespace sherlog
