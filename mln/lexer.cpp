// The scanner behind lexer.h: longest match first, no tables, no recursion.
#include "mln/lexer.h"

#include <fmt/format.h>

#include <array>
#include <utility>

namespace sherlog {

namespace {

constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";
constexpr std::size_t kShownCharacters = 40;  // of a token in a message

bool is_ascii(char c) { return static_cast<unsigned char>(c) < 0x80; }
bool is_digit(char c) { return c >= '0' && c <= '9'; }
bool is_joiner(char c) { return c == '\'' || c == '-' || c == '.' || c == '!'; }

// Blocks of Unicode that hold punctuation and operators but no letters.
bool is_symbol(char32_t c) {
  if (c < 0xC0) return c != 0xAA && c != 0xB5 && c != 0xBA;
  if (c == 0xD7 || c == 0xF7) return true;
  return (c >= 0x2000 && c <= 0x206F) || (c >= 0x2190 && c <= 0x2BFF) || (c >= 0x3000 && c <= 0x3004) ||
         (c >= 0x3008 && c <= 0x3020) || (c >= 0xE000 && c <= 0xF8FF) || c == 0xFEFF || c == 0xFFFD;
}

bool is_blank(char32_t c) {
  return c == ' ' || c == '\t' || c == '\r' || c == '\f' || c == '\v' || c == 0xA0 || c == 0xFEFF || c == 0x3000 ||
         (c >= 0x2000 && c <= 0x200B) || c == 0x202F;
}

struct Spelling {
  std::string_view text;
  TokenKind kind;
};

// Longer spellings stand before their own beginnings.
constexpr std::array kSymbols = {
    Spelling{"<=>", TokenKind::kIff},       Spelling{"=/=", TokenKind::kNotEqual},
    Spelling{"...", TokenKind::kEllipsis},  Spelling{"=>", TokenKind::kImplies},
    Spelling{"<=", TokenKind::kLessEqual},  Spelling{">=", TokenKind::kGreaterEqual},
    Spelling{"!=", TokenKind::kNotEqual},   Spelling{":-", TokenKind::kIf},
    Spelling{"(", TokenKind::kOpen},        Spelling{")", TokenKind::kClose},
    Spelling{"{", TokenKind::kOpenBrace},   Spelling{"}", TokenKind::kCloseBrace},
    Spelling{",", TokenKind::kComma},       Spelling{".", TokenKind::kDot},
    Spelling{":", TokenKind::kColon},       Spelling{"!", TokenKind::kNot},
    Spelling{"^", TokenKind::kAnd},         Spelling{"&", TokenKind::kAnd},
    Spelling{"|", TokenKind::kOr},          Spelling{"=", TokenKind::kEqual},
    Spelling{"<", TokenKind::kLess},        Spelling{">", TokenKind::kGreater},
    Spelling{"+", TokenKind::kPlus},        Spelling{"-", TokenKind::kMinus},
    Spelling{"*", TokenKind::kStar},        Spelling{"/", TokenKind::kSlash},
    Spelling{"?", TokenKind::kQuestion},    Spelling{"@", TokenKind::kAt},
    Spelling{"\u00AC", TokenKind::kNot},    Spelling{"\u2227", TokenKind::kAnd},
    Spelling{"\u2228", TokenKind::kOr},     Spelling{"\u2192", TokenKind::kImplies},
    Spelling{"\u2194", TokenKind::kIff},    Spelling{"\u2203", TokenKind::kExists},
    Spelling{"\u2200", TokenKind::kForall},
};

}  // namespace

CodePoint code_point_at(std::string_view text, std::size_t offset) {
  const CodePoint broken{0xFFFD, 1, false};
  const auto byte = [&](std::size_t i) { return static_cast<unsigned char>(text[i]); };
  const unsigned char first = byte(offset);
  if (first < 0x80) return {first, 1, true};
  const std::size_t bytes = first >= 0xF0 ? 4 : first >= 0xE0 ? 3 : 2;
  if (first < 0xC2 || first > 0xF4 || offset + bytes > text.size()) return broken;
  char32_t value = first & (0xFFu >> (bytes + 1));
  for (std::size_t i = 1; i < bytes; ++i) {
    if ((byte(offset + i) & 0xC0u) != 0x80u) return broken;
    value = (value << 6) | (byte(offset + i) & 0x3Fu);
  }
  const bool overlong = (bytes == 3 && value < 0x800) || (bytes == 4 && value < 0x10000);
  if (overlong || value > 0x10FFFF || (value >= 0xD800 && value <= 0xDFFF)) return broken;
  return {value, bytes, true};
}

std::size_t code_point_count(std::string_view text) {
  std::size_t count = 0;
  for (std::size_t i = 0; i < text.size(); i += code_point_at(text, i).bytes) ++count;
  return count;
}

std::size_t find_invalid_utf8(std::string_view text) {
  for (std::size_t i = 0; i < text.size();) {
    if (is_ascii(text[i])) {
      ++i;
      continue;
    }
    const CodePoint point = code_point_at(text, i);
    if (!point.valid) return i;
    i += point.bytes;
  }
  return std::string_view::npos;
}

std::size_t name_character(std::string_view text, std::size_t offset) {
  if (offset >= text.size()) return 0;
  const char c = text[offset];
  if (is_ascii(c)) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || is_digit(c) || c == '_' ? 1 : 0;
  }
  const CodePoint point = code_point_at(text, offset);
  return !point.valid || is_symbol(point.value) || is_blank(point.value) ? 0 : point.bytes;
}

Lexer::Lexer(std::string_view text, std::uint32_t file) : text_(text), file_(file) {
  if (text_.starts_with(kByteOrderMark)) offset_ = kByteOrderMark.size();  // takes no column
}

void Lexer::rewind(const Token& token) {
  offset_ = token.begin;
  line_ = token.line;
  column_ = token.column;
  line_break_ = token.line_break;
}

void Lexer::resume_after(const Token& token) {
  offset_ = token.end;
  line_ = token.end_line;
  column_ = token.end_column;
  line_break_ = false;
}

Place Lexer::place(const Token& token) const { return place(token, token); }

Place Lexer::place(const Token& first, const Token& last) const {
  const Token& end = last.end_line == first.line ? last : first;
  const bool one_line = end.end_line == first.line && end.end_column > first.column;
  return {file_, first.line, first.column, one_line ? end.end_column - first.column : 1};
}

Place Lexer::behind(const Token& token) const { return {file_, token.end_line, token.end_column, 1}; }

void Lexer::advance(std::size_t bytes) {
  const std::size_t end = offset_ + bytes;
  while (offset_ < end) {
    if (text_[offset_] == '\n') {
      ++line_;
      column_ = 1;
      ++offset_;
    } else {
      offset_ += is_ascii(text_[offset_]) ? 1 : code_point_at(text_, offset_).bytes;
      ++column_;
    }
  }
}

bool Lexer::skip_comment() {
  if (at(offset_ + 1) == '/') {
    const std::size_t end = text_.find('\n', offset_);
    advance((end == std::string_view::npos ? text_.size() : end) - offset_);
    return true;
  }
  const std::size_t end = text_.find("*/", offset_ + 2);
  if (end == std::string_view::npos) return false;
  const std::uint32_t line = line_;
  advance(end + 2 - offset_);
  if (line_ != line) line_break_ = true;
  return true;
}

bool Lexer::skip_blank() {
  while (offset_ < text_.size()) {
    const char c = text_[offset_];
    if (c == '\n') {
      line_break_ = true;
      advance(1);
    } else if (c == '/' && (at(offset_ + 1) == '/' || at(offset_ + 1) == '*')) {
      if (!skip_comment()) return false;
    } else {
      const CodePoint point = code_point_at(text_, offset_);
      if (!is_blank(point.value)) return true;
      advance(point.bytes);
    }
  }
  return true;
}

std::size_t Lexer::word_end(std::size_t offset, bool joined) const {
  while (true) {
    if (const std::size_t bytes = name_character(text_, offset)) {
      offset += bytes;
      continue;
    }
    if (!joined || !is_joiner(at(offset)) || name_character(text_, offset + 1) == 0) return offset;
    ++offset;
  }
}

// The end of the number at the offset, or the offset itself where there is none.
std::size_t Lexer::number_end(std::size_t offset, Mode mode) const {
  std::size_t end = offset;
  while (is_digit(at(end))) ++end;
  const bool whole = end > offset;
  if (at(end) == '.' && is_digit(at(end + 1)) && (whole || mode == Mode::kArithmetic)) {
    ++end;
    while (is_digit(at(end))) ++end;
  }
  if (end == offset) return offset;
  if (at(end) == 'e' || at(end) == 'E') {
    std::size_t exponent = end + 1;
    if (at(exponent) == '+' || at(exponent) == '-') ++exponent;
    if (is_digit(at(exponent))) {
      while (is_digit(at(exponent))) ++exponent;
      end = exponent;
    }
  }
  return end;
}

TokenKind Lexer::scan_word(Mode mode, std::size_t& length) const {
  const std::size_t number = number_end(offset_, mode);
  const bool names = mode == Mode::kNames;
  if (number > offset_) {
    const bool joined = names && is_joiner(at(number)) && name_character(text_, number + 1) != 0;
    if (name_character(text_, number) == 0 && !joined) {
      length = number - offset_;
      return TokenKind::kNumber;
    }
  }
  length = word_end(offset_, names || number > offset_) - offset_;
  return TokenKind::kName;
}

TokenKind Lexer::scan_string(std::size_t& length) const {
  for (std::size_t i = offset_ + 1; i < text_.size() && text_[i] != '\n'; ++i) {
    if (text_[i] == '"') {
      length = i + 1 - offset_;
      return TokenKind::kString;
    }
    if (text_[i] == '\\' && (at(i + 1) == '"' || at(i + 1) == '\\')) ++i;
  }
  const std::size_t end = text_.find('\n', offset_);
  length = (end == std::string_view::npos ? text_.size() : end) - offset_;
  if (text_[offset_ + length - 1] == '\r') --length;
  return TokenKind::kUnclosedString;
}

TokenKind Lexer::scan_symbol(std::size_t& length) const {
  const std::string_view rest = text_.substr(offset_);
  for (const Spelling& symbol : kSymbols) {
    if (rest.starts_with(symbol.text)) {
      length = symbol.text.size();
      return symbol.kind;
    }
  }
  length = code_point_at(text_, offset_).bytes;
  return TokenKind::kStray;
}

bool Lexer::at_separator() const {
  if (!line_break_ || text_.substr(offset_, 3) != "---") return false;
  std::size_t end = offset_;
  while (at(end) == '-') ++end;
  while (at(end) == ' ' || at(end) == '\t' || at(end) == '\r') ++end;
  return end >= text_.size() || text_[end] == '\n';
}

TokenKind Lexer::scan(Mode mode, std::size_t& length) const {
  const char c = text_[offset_];
  if (name_character(text_, offset_) != 0) return scan_word(mode, length);
  if (c == '.' && mode == Mode::kArithmetic && is_digit(at(offset_ + 1))) return scan_word(mode, length);
  if (c == '"') return scan_string(length);
  if ((c == '?' || c == '#') && name_character(text_, offset_ + 1) != 0) {
    length = word_end(offset_ + 1, c == '?') - offset_;
    return c == '?' ? TokenKind::kVariable : TokenKind::kDirective;
  }
  if (at_separator()) {
    length = 3;
    while (at(offset_ + length) == '-') ++length;
    return TokenKind::kSeparator;
  }
  return scan_symbol(length);
}

Token Lexer::next(Mode mode) {
  const std::size_t before = offset_;
  const bool closed = skip_blank();
  Token token;
  token.begin = offset_;
  token.line = line_;
  token.column = column_;
  token.line_break = line_break_;
  token.glued = offset_ == before && !line_break_;
  std::size_t length = 0;
  if (!closed) {
    token.kind = TokenKind::kUnclosedComment;
    length = text_.size() - offset_;
  } else if (offset_ < text_.size()) {
    token.kind = scan(mode, length);
  } else {
    token.line_break = true;
  }
  token.text = text_.substr(offset_, length);
  if (token.kind == TokenKind::kVariable) token.text.remove_prefix(1);
  advance(length);
  token.end = offset_;
  token.end_line = line_;
  token.end_column = column_;
  line_break_ = false;
  return token;
}

bool is_name(std::string_view text) {
  Lexer lexer(text);
  const Token token = lexer.next();
  return token.kind == TokenKind::kName && token.begin == 0 && token.end == text.size();
}

bool is_number(std::string_view text) {
  if (text.starts_with('-')) text.remove_prefix(1);
  Lexer lexer(text);
  const Token token = lexer.next();
  return token.kind == TokenKind::kNumber && token.begin == 0 && token.end == text.size();
}

std::string unquoted(std::string_view token_text) {
  std::string result;
  result.reserve(token_text.size());
  for (std::size_t i = 1; i + 1 < token_text.size(); ++i) {
    const char next = token_text[i + 1];
    if (token_text[i] == '\\' && i + 2 < token_text.size() && (next == '"' || next == '\\')) ++i;
    result.push_back(token_text[i]);
  }
  return result;
}

std::string in_quotes(std::string_view text) {
  std::string result = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') result.push_back('\\');
    result.push_back(c);
  }
  result.push_back('"');
  return result;
}

std::string quoted_if_needed(std::string_view text) {
  return is_name(text) || is_number(text) ? std::string(text) : in_quotes(text);
}

std::string describe(const Token& token) {
  switch (token.kind) {
    case TokenKind::kEnd:
      return "end of file";
    case TokenKind::kUnclosedString:
      return "a string that is not closed";
    case TokenKind::kUnclosedComment:
      return "a comment that is not closed";
    case TokenKind::kStray: {
      const CodePoint point = code_point_at(token.text, 0);
      if (!point.valid || point.value < 0x20 || point.value == 0x7F) {
        return fmt::format("byte 0x{:02X}", static_cast<unsigned char>(token.text[0]));
      }
      return fmt::format("character '{}'", token.text);
    }
    default:
      break;
  }
  std::size_t end = 0;
  for (std::size_t count = 0; end < token.text.size() && count < kShownCharacters; ++count) {
    end += code_point_at(token.text, end).bytes;
  }
  const std::string_view mark = token.kind == TokenKind::kVariable ? "?" : "";
  return fmt::format("'{}{}{}'", mark, token.text.substr(0, end), end < token.text.size() ? "..." : "");
}

bool is_capitalised(std::string_view name) {
  std::size_t i = 0;
  while (i < name.size() && name[i] == '_') ++i;
  if (i == name.size()) return false;
  const auto byte = static_cast<unsigned char>(name[i]);
  if (byte < 0x80) return (byte >= 'A' && byte <= 'Z') || (byte >= '0' && byte <= '9');
  if (i + 1 == name.size() || byte < 0xC0 || byte >= 0xE0) return false;
  // The upper-case letters of Latin-1, Greek and Cyrillic; other scripts have no case that matters here.
  const unsigned code = ((byte & 0x1Fu) << 6u) | (static_cast<unsigned char>(name[i + 1]) & 0x3Fu);
  return (code >= 0xC0 && code <= 0xDE && code != 0xD7) || (code >= 0x100 && code < 0x138 && code % 2 == 0) ||
         (code >= 0x386 && code <= 0x3AB && code != 0x390) || (code >= 0x400 && code <= 0x42F);
}

}  // namespace sherlog
