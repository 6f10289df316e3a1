// Statements: declarations, weighted formulas, directives, includes (parser.h). Formulas are in formula_parser.cpp.
//
// Idea      A statement is recognised by its first tokens; what looks like a declaration is read ahead, since the same
//           text is one only if it names a predicate that was not declared before. After an error the parser goes on at
//           the next line that can begin a statement.
#include "mln/parser.h"

#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <filesystem>
#include <unordered_set>
#include <utility>

#include "mln/formula_parser.h"
#include "mln/lexer.h"
#include "mln/text_file.h"
#include "mln/weight.h"

namespace sherlog {

using namespace syntax;

namespace {

constexpr std::size_t kMaxIncludeDepth = 100;
constexpr std::size_t kMaxIncludes = 10'000;  // in all: a file that includes the next one twice doubles the work

struct OpenFile {
  std::string canonical;  // to recognise a cycle
  std::string name;       // as shown
  Place included_at;      // in the file before
};

// What the files of one model share.
struct ModelContext {
  Diagnostics& diagnostics;
  const ParseOptions& options;
  Model model = {};
  std::unordered_set<std::string> declared = {};
  std::vector<OpenFile> open_files = {};
  std::size_t includes = 0;
};

std::string canonical_name(const std::string& name) {
  std::error_code error;
  const std::filesystem::path path = std::filesystem::weakly_canonical(name, error);
  return error ? name : path.string();
}

class StatementParser : public FormulaParser {
 public:
  StatementParser(std::string_view text, std::uint32_t file, std::string name, ModelContext& context)
      : FormulaParser(text, file, context.diagnostics, context.options), context_(context), name_(std::move(name)) {}

  void parse_all() {
    while (token_.kind != TokenKind::kEnd) {
      begin_statement();
      start_ = token_;
      if (!parse_statement()) recover();
    }
    reject_pending();
  }

 private:
  // #fixweight and #unique wait for the formula they stand before.
  struct Pending {
    bool fixed = false;
    std::vector<std::string> unique;
    Place place;
    std::string directive;  // the last one; empty: none
  };

  bool parse_statement() {
    if (token_.kind == TokenKind::kDirective) return parse_directive();
    if (token_.kind == TokenKind::kName) {
      if (at_domain()) return parse_domain();
      const bool weight = read_weight(lexer_, token_, options_.max_depth).has_value();
      if (!weight && at_function()) return false;
    }
    if (token_.kind == TokenKind::kName || token_.kind == TokenKind::kStar) {
      if (std::optional<PredicateDeclaration> declaration = read_declaration()) {
        reject_pending();
        context_.declared.insert(declaration->name);
        add(std::move(*declaration));
        return true;
      }
    }
    return parse_weighted();
  }

  void add(Statement statement) {
    context_.model.statements.push_back(std::move(statement));
    context_.model.depth.push_back(static_cast<int>(context_.open_files.size()) - 1);
  }

  void reject_pending() {
    if (!pending_.directive.empty()) {
      error("syntax", pending_.place, fmt::format("'{}' has to stand before a formula", pending_.directive));
    }
    pending_ = {};
  }

  bool end_of_statement(const std::string& expected) {
    if (at_end_of_statement()) return true;
    fail(expected);
    return false;
  }

  // Goes on at the next line that can begin a statement: outside brackets, or as far left as the broken one.
  void recover() {
    pending_ = {};
    while (token_.kind != TokenKind::kEnd) {
      const bool closes = token_.kind == TokenKind::kClose || token_.kind == TokenKind::kCloseBrace;
      if (token_.line_break && token_.begin > start_.begin && !closes && token_.kind != TokenKind::kComma &&
          !at_connective() && (open_ <= 0 || token_.column <= start_.column)) {
        return;
      }
      if (token_.kind == TokenKind::kOpen || token_.kind == TokenKind::kOpenBrace) ++open_;
      if (closes && open_ > 0) --open_;
      take();
    }
  }

  bool at_domain() {
    const State before = save();
    take();
    const bool equals = take_if(TokenKind::kEqual);
    const bool result = equals && token_.kind == TokenKind::kOpenBrace;
    restore(before);
    return result;
  }

  // `fluent move(id, id)` or `id move(id)`: a function's declaration. Reports it.
  bool at_function() {
    const State before = save();
    const Token first = token_;
    take();
    bool result = false;
    if (at(TokenKind::kName) && token_.text != "v") {
      const bool keyword = first.text == "fluent";
      const Token second = token_;
      take();
      result = at(TokenKind::kOpen) && token_.glued && (keyword || !is_quantifier(first.text));
      if (result) error("functions", lexer_.place(first, second), "functions are not supported in this release");
    }
    restore(before);
    return result && (take(), true);
  }

  static bool is_quantifier(std::string_view word) {
    return word == "EXIST" || word == "EXISTS" || word == "FORALL" || word == "exist" || word == "exists" ||
           word == "forall" || word == "Exist" || word == "Exists" || word == "Forall";
  }

  bool parse_domain() {
    reject_pending();
    DomainDeclaration domain;
    domain.name = token_.text;
    domain.place = lexer_.place(token_);
    if (domain.name == "v") {  // behind another statement it would be read as the connective
      error("syntax", domain.place, "'v' means 'or' and cannot name a domain");
      return false;
    }
    take();  // name
    take();  // =
    const std::vector<Note> opened = {{lexer_.place(token_), "the bracket is opened here"}};
    ++open_;
    take();  // {
    bool after_ellipsis = false;
    while (token_.kind != TokenKind::kCloseBrace || !domain.constants.empty()) {
      if (token_.kind == TokenKind::kEllipsis && domain.constants.size() == 1 && !after_ellipsis) {
        after_ellipsis = domain.range = true;
        take();
      } else {
        std::optional<Term> constant = parse_term("a constant");
        if (!constant) return false;
        if (constant->plus || constant->kind == Term::Kind::kVariable) {
          error("syntax", constant->place, "a domain lists constants, not variables");
          return false;
        }
        domain.constants.push_back(std::move(*constant));
      }
      if (token_.kind == TokenKind::kCloseBrace) break;
      if (token_.kind != TokenKind::kComma) {
        fail("',' or '}'", opened);
        return false;
      }
      take();
    }
    --open_;
    take();  // }
    if (domain.range && !check_range(domain)) return false;
    if (!end_of_statement("end of line after the domain")) return false;
    add(std::move(domain));
    return true;
  }

  bool check_range(const DomainDeclaration& domain) {
    long long ends[2] = {0, 0};
    bool good = domain.constants.size() == 2;
    for (std::size_t i = 0; good && i < 2; ++i) {
      const std::string& text = domain.constants[i].name;
      const auto read = std::from_chars(text.data(), text.data() + text.size(), ends[i]);
      good = domain.constants[i].kind == Term::Kind::kNumber && read.ec == std::errc() &&
             read.ptr == text.data() + text.size();
    }
    if (good && ends[0] <= ends[1]) return true;
    error("range", domain.place,
          fmt::format("a range is written {{first, ..., last}} with whole numbers, the first not above the last: "
                      "domain '{}'",
                      domain.name));
    return false;
  }

  // Reads a declaration if one stands here, else leaves the cursor alone.
  std::optional<PredicateDeclaration> read_declaration() {
    const State before = save();
    PredicateDeclaration declaration;
    bool marked = false;
    if (scan_declaration(declaration, marked) && at_end_of_statement() && !at_connective() &&
        (marked || !context_.declared.contains(declaration.name))) {
      return declaration;
    }
    restore(before);
    return std::nullopt;
  }

  bool scan_declaration(PredicateDeclaration& declaration, bool& marked) {
    const Token first = token_;
    declaration.closed = take_if(TokenKind::kStar);
    if (!at(TokenKind::kName) || token_.text == "v") return false;
    const char initial = token_.text.front();
    if (initial >= '0' && initial <= '9') return false;
    declaration.name = token_.text;
    take();
    if (!at(TokenKind::kOpen)) return false;
    ++open_;
    take();
    while (token_.kind != TokenKind::kClose || !declaration.arguments.empty()) {
      if (token_.kind != TokenKind::kName) return false;
      Argument argument{std::string(token_.text), 0, lexer_.place(token_)};
      take();
      if (token_.kind == TokenKind::kNot || token_.kind == TokenKind::kQuestion) {
        argument.mark = token_.kind == TokenKind::kNot ? '!' : '?';
        marked = true;
        take();
      }
      declaration.arguments.push_back(std::move(argument));
      if (token_.kind == TokenKind::kClose) break;
      if (token_.kind != TokenKind::kComma) return false;
      take();
    }
    --open_;
    take();
    declaration.place = lexer_.place(first, last_);
    return true;
  }

  bool parse_directive() {
    const Token directive = token_;
    take();
    if (directive.text == "#include") return parse_include(directive);
    if (directive.text == "#unique") {
      if (!parse_unique()) return false;
    } else if (directive.text == "#fixweight") {
      pending_.fixed = true;
    } else {
      const std::string near = did_you_mean(directive.text, {"#include", "#unique", "#fixweight"});
      error("syntax", lexer_.place(directive),
            fmt::format("unknown directive {}{}", describe(directive),
                        near.empty() ? "" : fmt::format("; did you mean '{}'?", near)));
      return false;
    }
    pending_.place = lexer_.place(directive);
    pending_.directive = directive.text;
    return true;
  }

  bool parse_unique() {
    if (!pending_.unique.empty()) {
      error("syntax", lexer_.place(last_), "'#unique' is given twice for one formula");
      return false;
    }
    if (!at(TokenKind::kOpenBrace)) {
      fail("'{' after '#unique'");
      return false;
    }
    ++open_;
    take();
    while (true) {
      std::optional<Term> term = parse_term("a variable with '+'");
      if (!term) return false;
      const bool variable = term->kind == Term::Kind::kVariable || term->kind == Term::Kind::kIdentifier;
      if (!term->plus || !variable) {
        error("syntax", term->place, "'#unique' lists variables with '+', as in #unique{+?a,+?b}");
        return false;
      }
      pending_.unique.push_back(std::move(term->name));
      if (token_.kind == TokenKind::kCloseBrace) break;
      if (token_.kind != TokenKind::kComma) {
        fail("',' or '}'");
        return false;
      }
      take();
    }
    --open_;
    take();
    return true;
  }

  bool parse_weighted() {
    WeightedFormula result;
    const Token first = token_;
    result.fixed = pending_.fixed;
    if (take_if(TokenKind::kAt)) {
      result.fixed = true;
      statement_begin_ = token_.begin;
      if (!parse_weight(result)) return false;
      if (!result.weight) {
        if (!result.negated) fail("a weight after '@'");
        return result.negated && finish_formula(first, std::move(result));
      }
    } else if (!parse_weight(result)) {
      return false;
    }
    return finish_formula(first, std::move(result));
  }

  // The weight at the cursor, if there is one; false after an error.
  bool parse_weight(WeightedFormula& result) {
    const State before = save();
    const std::optional<Weight> weight = read_weight(lexer_, token_, options_.max_depth);
    if (!weight) return true;
    const Place place = lexer_.place(token_, weight->last);
    if (weight->too_deep) {
      error("nesting", lexer_.place(token_),
            fmt::format("the formula is nested more than {} deep", options_.max_depth));
      return false;
    }
    lexer_.resume_after(weight->last);
    last_ = weight->last;
    token_ = lexer_.next();
    if (at_comparison()) {  // 5 < x: no weight but a term
      restore(before);
      return true;
    }
    take_if(TokenKind::kColon);
    if (weight->negates) {
      result.hard = result.negated = true;
    } else if (!std::isfinite(weight->value)) {
      error("weight", place, "weight is not a finite number; end the formula in '.' to make it hard");
      return false;
    } else {
      result.weight = weight->value;
    }
    result.weight_text = weight->text;
    if (at_end_of_statement()) {
      fail("a formula after the weight");
      return false;
    }
    if (token_.kind == TokenKind::kNumber) {
      Lexer ahead = lexer_;
      const TokenKind next = ahead.next().kind;
      if (next == TokenKind::kName || next == TokenKind::kOpen || next == TokenKind::kNot) {
        fail("a formula after the weight");
        return false;
      }
    }
    return true;
  }

  bool finish_formula(const Token& first, WeightedFormula result) {
    std::optional<Formula> formula = parse_whole_formula();
    if (!formula) return false;
    result.formula = std::move(*formula);
    if (at(TokenKind::kDot)) {
      if (!result.weight_text.empty()) {
        error(
            "weight", lexer_.place(token_),
            fmt::format("both a weight and a '.' are given: leave out one of them (weight '{}')", result.weight_text));
        return false;
      }
      result.hard = true;
      take();
    }
    if (!end_of_statement(result.hard ? "end of line" : "a connective or end of line")) return false;
    result.place = lexer_.place(first, last_);
    result.unique = std::move(pending_.unique);
    pending_ = {};
    add(std::move(result));
    return true;
  }

  bool parse_include(const Token& directive) {
    reject_pending();
    if (!at(TokenKind::kString)) {
      fail("a file name in quotes after '#include'");
      return false;
    }
    const Include include{unquoted(token_.text), lexer_.place(directive, token_)};
    take();
    if (!end_of_statement("end of line after the file name")) return false;
    add(include);
    if (options_.follow_includes) follow(include);
    return true;
  }

  void follow(const Include& include);

  ModelContext& context_;
  std::string name_;
  Token start_;
  Pending pending_;
};

void StatementParser::follow(const Include& include) {
  const std::string path = (std::filesystem::path(name_).parent_path() / include.file).string();
  const std::string canonical = canonical_name(path);
  std::vector<OpenFile>& open_files = context_.open_files;
  for (std::size_t i = 0; i < open_files.size(); ++i) {
    if (open_files[i].canonical != canonical) continue;
    std::vector<Note> notes;
    for (std::size_t j = i + 1; j < open_files.size(); ++j) {
      notes.push_back({open_files[j].included_at, fmt::format("'{}' is included here", open_files[j].name)});
    }
    return error("include", include.place, fmt::format("'{}' includes itself", path), std::move(notes));
  }
  if (open_files.size() > kMaxIncludeDepth || ++context_.includes > kMaxIncludes) {
    return error("include", include.place, fmt::format("too many files are included: '{}' is not read", path));
  }
  TextFile file = load_text_file(path);
  if (!file.text) return error("include", include.place, fmt::format("'{}' {}", path, file.problem));
  const std::uint32_t source = context_.diagnostics.sources().add(path, *file.text);
  open_files.push_back({canonical, path, include.place});
  StatementParser(*file.text, source, path, context_).parse_all();
  open_files.pop_back();
}

}  // namespace

Model parse_syntax(std::string_view text, const std::string& name, Diagnostics& diagnostics,
                   const ParseOptions& options) {
  const std::uint32_t file = diagnostics.sources().add(name, std::string(text));
  ModelContext context{diagnostics, options};
  context.open_files.push_back({canonical_name(name), name, {}});
  StatementParser(text, file, name, context).parse_all();
  return std::move(context.model);
}

std::optional<Formula> parse_formula(std::string_view text, const std::string& name, Diagnostics& diagnostics,
                                     const ParseOptions& options) {
  const std::uint32_t file = diagnostics.sources().add(name, std::string(text));
  FormulaParser parser(text, file, diagnostics, options);
  std::optional<Formula> formula = parser.parse_whole_formula();
  if (!formula) return std::nullopt;
  if (!parser.at_end_of_text()) {
    parser.fail("a connective or the end of the formula");
    return std::nullopt;
  }
  return formula;
}

}  // namespace sherlog
