// The part of the parser that reads formulas: a token cursor, terms, atoms, connectives. parser.cpp adds statements.
//
// Idea      Operator precedence with an explicit stack in each bracket level, so that a level of nesting costs a few
//           small stack frames; negations are counted, not recursed into. The height of every tree is bounded by
//           ParseOptions::max_depth, so that walking and destroying it may recurse.
// Errors    The first error of a statement is reported where it stands; every function then returns nothing.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "mln/lexer.h"
#include "mln/parser.h"

namespace sherlog {

class FormulaParser {
 public:
  FormulaParser(std::string_view text, std::uint32_t file, Diagnostics& diagnostics, const ParseOptions& options);

  // A formula up to where no connective follows; warns about mixed connectives.
  std::optional<syntax::Formula> parse_whole_formula();
  bool at_end_of_statement() const;
  bool at_end_of_text() const { return token_.kind == TokenKind::kEnd; }
  // Reports what stands at the cursor instead of what was expected.
  void fail(const std::string& expected, std::vector<Note> notes = {});

 protected:
  struct State {
    Lexer lexer;
    Token token;
    Token last;
    int open = 0;
  };
  struct Operand {
    syntax::Formula formula;
    int height = 1;
  };

  State save() const { return {lexer_, token_, last_, open_}; }
  void restore(const State& state);
  void take();
  bool at(TokenKind kind) const { return token_.kind == kind && !at_end_of_statement(); }
  bool take_if(TokenKind kind);
  // Starts a new statement at the cursor: its first token may stand on a new line.
  void begin_statement();
  void error(std::string code, const Place& place, std::string text, std::vector<Note> notes = {});
  void functions_error(const Token& first);
  bool at_connective() const;
  bool at_comparison() const;

  std::optional<syntax::Term> parse_term(std::string_view expected);

  Lexer lexer_;
  Token token_;   // at the cursor
  Token last_;    // before it
  int open_ = 0;  // brackets around the cursor: a line break ends the statement where there are none
  std::size_t statement_begin_ = 0;
  Diagnostics& diagnostics_;
  const ParseOptions& options_;

 private:
  struct Operator {
    syntax::Kind kind = syntax::Kind::kAnd;
    bool reversed = false;  // head :- body
    int level = 0;          // larger binds tighter
    Place place;
  };

  std::optional<Operand> parse_operators();
  std::optional<Operand> parse_unary();
  std::optional<Operand> parse_primary();
  std::optional<Operand> parse_bracketed();
  std::optional<Operand> parse_quantified();
  std::optional<Operand> parse_atom(bool star);
  std::optional<Operand> parse_comparison();
  bool parse_arguments(const Token& name, syntax::Formula& atom);
  std::optional<syntax::Kind> quantifier() const;
  std::optional<Operator> connective() const;
  bool reduce(std::vector<Operand>& operands, std::vector<Operator>& operators);
  bool check_height(int height, const Place& place);
  void warn_if_mixed(const syntax::Formula& formula);

  int depth_ = 0;
  bool mixed_ = false;  // an unbracketed ^ under v was built
};

}  // namespace sherlog
