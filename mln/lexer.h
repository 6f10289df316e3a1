// Text to tokens, one at a time, for models, queries and evidence.
//
// Idea      A cursor over the text that can be copied and put back: the parser looks ahead by trying, and memory stays
//           bounded for a line of any length. Comments and blanks are skipped; a token says whether a line break came
//           before it, since a line break ends a statement in this language. Tokens are views into the text.
// Names     Letters (every UTF-8 letter), digits and '_'; and one of ' - . ! between two such characters. A word that
//           is a number as a whole is a number. In arithmetic (weights) the four do not join: 1-2 is a difference.
// Errors    None are reported here: stray characters, unclosed strings and comments are tokens of their own kind.
// Cost      Linear in the text.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

#include "mln/diagnostics.h"

namespace sherlog {

enum class TokenKind : std::uint8_t {
  kEnd,
  kName,      // smokes, v, COR_500.000_
  kVariable,  // ?x (text without the ?)
  kNumber,    // 12, 0.5, 1e-3; unsigned
  kString,    // "Dr Oetker" (text with the quotes; see unquoted)
  kOpen,      // (
  kClose,     // )
  kOpenBrace,
  kCloseBrace,
  kComma,
  kDot,
  kEllipsis,  // ...
  kColon,
  kIf,            // :-
  kNot,           // ! ¬
  kAnd,           // ^ & ∧
  kOr,            // | ∨ (the letter v is a name here)
  kImplies,       // => →
  kIff,           // <=> ↔
  kExists,        // ∃
  kForall,        // ∀
  kEqual,         // =
  kNotEqual,      // != =/=
  kLess,          // <
  kLessEqual,     // <=
  kGreater,       // >
  kGreaterEqual,  // >=
  kPlus,
  kMinus,
  kStar,
  kSlash,
  kQuestion,   // a ? that no name follows
  kAt,         // @
  kDirective,  // #include (text with the #)
  kSeparator,  // --- (three or more, alone on its line)
  kUnclosedString,
  kUnclosedComment,
  kStray,  // any other character, or a byte that is not UTF-8
};

struct Token {
  TokenKind kind = TokenKind::kEnd;
  std::string_view text;
  std::size_t begin = 0;  // byte offsets into the text
  std::size_t end = 0;
  std::uint32_t line = 1;
  std::uint32_t column = 1;    // in code points, from 1
  std::uint32_t end_line = 1;  // of the place right behind it
  std::uint32_t end_column = 1;
  bool line_break = true;  // first on its line (or at the end of the text)
  bool glued = false;      // nothing stands between it and the token before
};

class Lexer {
 public:
  enum class Mode : std::uint8_t { kNames, kArithmetic };

  explicit Lexer(std::string_view text, std::uint32_t file = 0);

  Token next(Mode mode = Mode::kNames);
  // The next token is read from the start (the end) of this one again, which must come from this lexer's text.
  void rewind(const Token& token);
  void resume_after(const Token& token);

  std::string_view text() const { return text_; }
  std::uint32_t file() const { return file_; }
  Place place(const Token& token) const;
  // From the start of `first` to the end of `last` where they stand on one line, else `first` alone.
  Place place(const Token& first, const Token& last) const;
  // The single column right behind the token.
  Place behind(const Token& token) const;

 private:
  char at(std::size_t offset) const { return offset < text_.size() ? text_[offset] : '\0'; }
  void advance(std::size_t bytes);
  bool skip_blank();  // false at an unclosed comment
  bool skip_comment();
  bool at_separator() const;
  std::size_t number_end(std::size_t offset, Mode mode) const;
  std::size_t word_end(std::size_t offset, bool joined) const;
  TokenKind scan_word(Mode mode, std::size_t& length) const;
  TokenKind scan_string(std::size_t& length) const;
  TokenKind scan_symbol(std::size_t& length) const;
  TokenKind scan(Mode mode, std::size_t& length) const;

  std::string_view text_;
  std::uint32_t file_ = 0;
  std::size_t offset_ = 0;
  std::uint32_t line_ = 1;
  std::uint32_t column_ = 1;
  bool line_break_ = true;
};

// Code points of UTF-8 text; a byte that is not UTF-8 is one code point of its own, U+FFFD.
struct CodePoint {
  char32_t value = 0;
  std::size_t bytes = 1;
  bool valid = true;
};
CodePoint code_point_at(std::string_view text, std::size_t offset);
std::size_t code_point_count(std::string_view text);
// The offset of the first byte that is not UTF-8, or npos.
std::size_t find_invalid_utf8(std::string_view text);

// The length in bytes of the name character (letter, digit, _) at the offset, or 0.
std::size_t name_character(std::string_view text, std::size_t offset);
// Whether the text is one token of kind kName or kNumber.
bool is_name(std::string_view text);
bool is_number(std::string_view text);

// The inside of a kString token, with \" and \\ resolved; any other backslash stands for itself.
std::string unquoted(std::string_view token_text);
// The reverse: in quotes, with \ before each " and \.
std::string in_quotes(std::string_view text);
// A term as it has to be written: plain where it is a name or number, else in quotes.
std::string quoted_if_needed(std::string_view text);

// Whether a plain name that no domain lists is a constant: its first letter is upper case, or it begins with a digit.
bool is_capitalised(std::string_view name);

// What a message calls the token: "'=>'", "end of line", "a string that is not closed", ...; long ones are cut.
std::string describe(const Token& token);

}  // namespace sherlog
