// The scanner of evidence_reader.h.
#include "mln/evidence_reader.h"

#include <fmt/format.h>

#include <array>
#include <charconv>
#include <deque>
#include <optional>
#include <string>

#include "mln/typing.h"

namespace sherlog {

namespace {

bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\f' || c == '\v'; }
bool is_digit(char c) { return c >= '0' && c <= '9'; }

// Bytes that cannot be part of a predicate's or domain's name.
bool ends_name(char c) {
  static constexpr std::array<bool, 256> kTable = [] {
    std::array<bool, 256> table{};
    for (const char stop : {'(', ')', '{', '}', '=', ',', '"', '/', ' ', '\t', '\r', '\n', '\f', '\v'}) {
      table[static_cast<unsigned char>(stop)] = true;
    }
    return table;
  }();
  return kTable[static_cast<unsigned char>(c)];
}

bool is_separator(std::string_view line) {
  std::size_t i = 0;
  while (i < line.size() && is_blank(line[i])) ++i;
  const std::size_t first = i;
  while (i < line.size() && line[i] == '-') ++i;
  if (i < first + 3) return false;
  while (i < line.size() && is_blank(line[i])) ++i;
  return i == line.size() || line.substr(i, 2) == "//";
}

// Whether a block comment is open behind the line, given whether one is before it.
bool comment_open_after(std::string_view line, bool open) {
  for (std::size_t i = 0; i < line.size(); ++i) {
    if (open) {
      i = line.find("*/", i);
      if (i == std::string_view::npos) return true;
      open = false;
      ++i;
    } else if (line[i] == '"') {
      for (++i; i < line.size() && line[i] != '"'; ++i) {
        if (line[i] == '\\') ++i;
      }
    } else if (line[i] == '/' && (i == 0 || is_blank(line[i - 1]) || line[i - 1] == ')')) {
      if (line.substr(i, 2) == "//") return false;
      if (line.substr(i, 2) == "/*") {
        open = true;
        ++i;
      }
    }
  }
  return open;
}

class Reader {
 public:
  Reader(std::string_view text, std::uint32_t file, const EvidenceSection& section, EvidenceContext& context,
         EvidenceBuilder& builder)
      : text_(text.substr(0, section.end)),
        file_(file),
        context_(context),
        builder_(builder),
        position_(section.begin),
        line_(section.line),
        line_begin_(section.begin),
        cursor_(section.begin) {
    if (position_ == 0 && text_.substr(0, 3) == "\xEF\xBB\xBF") position_ = line_begin_ = cursor_ = 3;
  }

  void read() {
    while (skip_to_entry()) {
      if (!read_entry()) skip_line();
    }
  }

  // Only blanks and comments up to the end. Reports nothing.
  bool is_empty() {
    silent_ = true;
    return !skip_to_entry() && !unclosed_comment_;
  }

 private:
  struct Argument {
    std::string_view text;
    std::size_t begin;
    std::size_t end;
  };

  bool at_end() const { return position_ >= text_.size(); }
  char at(std::size_t offset) const { return offset < text_.size() ? text_[offset] : '\0'; }
  bool at_line_end() const { return at_end() || text_[position_] == '\n'; }
  bool looking_at(std::string_view what) const { return text_.substr(position_, what.size()) == what; }

  // Columns are asked for from left to right: each byte of a line is counted once.
  std::uint32_t column_of(std::size_t offset) {
    if (cursor_ < line_begin_ || cursor_ > offset) {
      cursor_ = line_begin_;
      column_ = 1;
    }
    for (; cursor_ < offset; ++cursor_) {
      // A code point counts at its first byte.
      if ((static_cast<unsigned char>(text_[cursor_]) & 0xC0u) != 0x80u) ++column_;
    }
    return column_;
  }

  Place place(std::size_t begin, std::size_t end) {
    Place place;
    place.file = file_;
    place.line = line_;
    place.column = column_of(begin);
    place.length = end > begin ? column_of(end) - place.column : 1;
    return place;
  }

  bool error(const char* code, std::size_t begin, std::size_t end, std::string message) {
    if (!silent_) context_.diagnostics().error(code, place(begin, end), std::move(message));
    return false;
  }

  void new_line() {
    ++position_;
    ++line_;
    line_begin_ = cursor_ = position_;
    column_ = 1;
  }

  void skip_blanks() {
    while (!at_end() && is_blank(text_[position_])) ++position_;
  }

  void skip_line() {
    const std::size_t end = text_.find('\n', position_);
    position_ = end == std::string_view::npos ? text_.size() : end;
  }

  // The comment is at position_. False where it is never closed.
  bool skip_block_comment() {
    const std::size_t begin = position_;
    const std::size_t end = text_.find("*/", position_ + 2);
    if (end == std::string_view::npos) {
      error("syntax", begin, begin + 2, "comment is never closed with '*/'");
      unclosed_comment_ = true;
      position_ = text_.size();
      return false;
    }
    while (position_ < end) {
      if (text_[position_] == '\n') {
        new_line();
      } else {
        ++position_;
      }
    }
    position_ = end + 2;
    return true;
  }

  // Skips blanks, line breaks and comments; false at the end of the text.
  bool skip_to_entry() {
    while (!at_end()) {
      const char c = text_[position_];
      if (c == '\n') {
        new_line();
      } else if (is_blank(c)) {
        ++position_;
      } else if (c == '/' && at(position_ + 1) == '/') {
        skip_line();
      } else if (c == '/' && at(position_ + 1) == '*') {
        if (!skip_block_comment()) return false;
      } else {
        return true;
      }
    }
    return false;
  }

  // True at the end of a line, comments skipped.
  bool expect_line_end() {
    while (true) {
      skip_blanks();
      if (at_line_end()) return true;
      if (looking_at("//")) {
        skip_line();
        return true;
      }
      if (!looking_at("/*")) break;
      const std::uint32_t line = line_;
      if (!skip_block_comment()) return true;
      if (line_ != line) return true;
    }
    const std::size_t begin = position_;
    if (text_[begin] == '.') {
      return error("syntax", begin, begin + 1, "an atom of the evidence does not end in '.': remove it");
    }
    if (text_[begin] == '=') {
      return error("syntax", begin, begin + 1, "functions are not supported: expected the end of the line");
    }
    return error("syntax", begin, begin + 1, "expected the end of the line: evidence has one atom on a line");
  }

  bool read_entry() {
    const std::size_t begin = position_;
    EvidenceKind kind = EvidenceKind::kTrue;
    double degree = 0.0;
    if (text_[position_] == '!' || looking_at("\xC2\xAC")) {
      position_ += text_[position_] == '!' ? 1u : 2u;
      kind = EvidenceKind::kFalse;
      skip_blanks();
    } else if (text_[position_] == '?') {
      ++position_;
      kind = EvidenceKind::kUnknown;
      skip_blanks();
    } else if (const std::optional<std::size_t> end = degree_end()) {
      if (!read_degree(*end, kind, degree)) return false;
    }
    const std::size_t name_begin = position_;
    while (!at_end() && !ends_name(text_[position_])) ++position_;
    const std::string_view name = text_.substr(name_begin, position_ - name_begin);
    if (name.empty()) return error("syntax", name_begin, name_begin + 1, "expected an atom, as in 'Smokes(Anna)'");
    const std::size_t name_end = position_;
    skip_blanks();
    if (at(position_) == '=' && begin == name_begin) return read_domain(name, name_begin, name_end);
    return read_atom(begin, name, name_end, kind, degree);
  }

  // The end of a number that stands at position_ and before a blank, as a degree does.
  std::optional<std::size_t> degree_end() const {
    const char first = text_[position_];
    const bool letter = first == 'n' || first == 'N' || first == 'i' || first == 'I';  // nan, inf
    if (!is_digit(first) && first != '.' && first != '-' && first != '+' && !letter) return std::nullopt;
    std::size_t end = position_;
    while (end < text_.size() && !is_blank(text_[end]) && text_[end] != '\n' && text_[end] != '(') ++end;
    if (!is_blank(at(end))) return std::nullopt;
    std::string_view word = text_.substr(position_, end - position_);
    if (!word.empty() && word.front() == '+') word.remove_prefix(1);
    double value = 0.0;
    const auto [stop, failure] = std::from_chars(word.data(), word.data() + word.size(), value);
    if (failure == std::errc::invalid_argument || stop != word.data() + word.size()) return std::nullopt;
    std::size_t next = end;
    while (is_blank(at(next))) ++next;
    // `inf (A)` is an atom of a predicate with an odd name.
    if (letter && (at(next) == '(' || at(next) == '=')) return std::nullopt;
    return end;
  }

  bool read_degree(std::size_t end, EvidenceKind& kind, double& degree) {
    const std::size_t begin = position_;
    const std::string_view word = text_.substr(begin, end - begin);
    const std::optional<double> value = numeric_value(word);
    if (!value || !(*value >= 0.0 && *value <= 1.0)) {
      return error("degree", begin, end, fmt::format("degree '{}' is not a number from 0 to 1", shortened(word)));
    }
    position_ = end;
    skip_blanks();
    if (at(position_) == '!' || at(position_) == '?') {
      return error("degree", position_, position_ + 1,
                   "a degree and a sign together are not clear: write '0.3 P(A)' for '0.7 !P(A)'");
    }
    kind = *value <= 0.0 ? EvidenceKind::kFalse : *value >= 1.0 ? EvidenceKind::kTrue : EvidenceKind::kSoft;
    degree = kind == EvidenceKind::kSoft ? *value : 0.0;
    return true;
  }

  bool read_atom(std::size_t begin, std::string_view name, std::size_t name_end, EvidenceKind kind, double degree) {
    const std::size_t name_begin = name_end - name.size();
    const std::optional<PredicateId> id = find_predicate(name);
    arguments_.clear();
    if (at(position_) == '(') {
      if (!read_arguments()) return false;
    } else if (!id || context_.model().predicate(*id).arity() > 0) {
      return error("syntax", name_begin, name_end,
                   fmt::format("expected '(' after '{}': an atom is written as in 'Smokes(Anna)'", shortened(name)));
    }
    const std::size_t end = position_;
    if (!id) {
      if (!context_.options().ignore_unknown_predicates) {
        error("unknown-predicate", name_begin, name_end,
              fmt::format("predicate '{}' is not declared in the model{}", shortened(name),
                          context_.predicate_suggestion(name)));
      }
      return expect_line_end();
    }
    const Predicate& predicate = context_.model().predicate(*id);
    if (predicate.arity() != arguments_.size()) {
      if (!silent_) {
        context_.diagnostics().error(
            "arity", place(begin, end),
            fmt::format("predicate '{}' takes {}, {} given", predicate.name, counted(predicate.arity(), "argument"),
                        arguments_.size()),
            declaration_note(context_.model(), context_.diagnostics(), predicate.place, predicate.name));
      }
      return expect_line_end();
    }
    constants_.clear();
    for (std::size_t i = 0; i < arguments_.size(); ++i)
      constants_.push_back(constant(predicate.domains[i], arguments_[i]));
    builder_.state(*id, constants_, kind, degree, place(begin, end));
    return expect_line_end();
  }

  // Atoms of one predicate mostly stand together.
  std::optional<PredicateId> find_predicate(std::string_view name) {
    if (last_predicate_ && context_.model().predicate(*last_predicate_).name == name) return last_predicate_;
    const std::optional<PredicateId> id = context_.find_predicate(name);
    if (id) last_predicate_ = id;
    return id;
  }

  ConstantIndex constant(DomainId domain, const Argument& argument) {
    bool is_new = false;
    const ConstantIndex index = builder_.constant(domain, argument.text, is_new);
    if (is_new) context_.check_new_constant(domain, argument.text, place(argument.begin, argument.end));
    return index;
  }

  // position_ is at '(' and is left behind ')'.
  bool read_arguments() {
    const std::size_t open = position_++;
    unescaped_.clear();
    skip_blanks();
    if (at(position_) == ')') {
      ++position_;
      return true;
    }
    while (true) {
      skip_blanks();
      if (!read_constant(')')) return false;
      skip_blanks();
      const char c = at_line_end() ? '\n' : text_[position_];
      if (c == '\n') return error("syntax", open, open + 1, "bracket is not closed on its line");
      if (c != ',' && c != ')') return error("syntax", position_, position_ + 1, "expected ',' or ')'");
      ++position_;
      if (c == ')') return true;
    }
  }

  // A quoted or plain constant up to ',' or `close`, appended to arguments_.
  bool read_constant(char close) {
    const std::size_t begin = position_;
    if (at(position_) == '"') return read_quoted();
    while (!at_line_end()) {
      const char c = text_[position_];
      if (c == ',' || c == close) break;
      if (c == '(') {
        return error("syntax", position_, position_ + 1,
                     "'(' inside an argument: functions are not supported, and such a constant needs quotes");
      }
      if (c == '/' && (position_ == begin || is_blank(text_[position_ - 1]))) {
        const char next = at(position_ + 1);
        if (close == '}' && (next == '/' || next == '*')) break;
        if (next == '*') {
          return error("syntax", position_, position_ + 2,
                       "no comment inside an atom's brackets; a constant with '/*' needs quotes");
        }
      }
      ++position_;
    }
    std::size_t end = position_;
    while (end > begin && is_blank(text_[end - 1])) --end;
    if (end == begin && at_line_end() && close == ')') {
      return error("syntax", begin, begin + 1, "bracket is not closed on its line");
    }
    if (end == begin) return error("syntax", begin, begin + 1, "expected a constant");
    arguments_.push_back({text_.substr(begin, end - begin), begin, end});
    return true;
  }

  bool read_quoted() {
    const std::size_t begin = position_++;
    std::size_t end = position_;
    bool escaped = false;
    while (end < text_.size() && text_[end] != '"' && text_[end] != '\n') {
      const bool escape = text_[end] == '\\' && (at(end + 1) == '"' || at(end + 1) == '\\');
      escaped = escaped || escape;
      end += escape ? 2 : 1;
    }
    if (at(end) != '"') return error("syntax", begin, begin + 1, "quote is not closed on its line");
    std::string_view inside = text_.substr(position_, end - position_);
    position_ = end + 1;
    if (escaped) inside = unescape(inside);
    arguments_.push_back({inside, begin, position_});
    return true;
  }

  // \" and \\ become " and \; any other backslash stands for itself.
  std::string_view unescape(std::string_view inside) {
    std::string& plain = unescaped_.emplace_back();
    for (std::size_t i = 0; i < inside.size(); ++i) {
      if (inside[i] == '\\' && i + 1 < inside.size() && (inside[i + 1] == '"' || inside[i + 1] == '\\')) ++i;
      plain += inside[i];
    }
    return plain;
  }

  // `name = {A, B}`, which may take several lines; position_ is at '='.
  bool read_domain(std::string_view name, std::size_t name_begin, std::size_t name_end) {
    ++position_;
    skip_blanks();
    if (at(position_) != '{') return error("syntax", position_, position_ + 1, "expected '{' after '='");
    const std::optional<DomainId> id = context_.model().find_domain(name);
    if (!id && !context_.options().ignore_unknown_predicates) {
      error("unknown-domain", name_begin, name_end,
            fmt::format("no predicate has an argument of domain '{}'{}", shortened(name),
                        context_.domain_suggestion(name)));
    }
    const Place open = place(position_, position_ + 1);
    ++position_;
    const auto unclosed = [&] {
      if (!silent_) context_.diagnostics().error("syntax", open, "brace is never closed with '}'");
      return false;
    };
    if (!skip_to_entry()) return unclosed();
    if (text_[position_] == '}') {
      ++position_;
      return expect_line_end();
    }
    while (true) {
      if (!skip_to_entry()) return unclosed();
      arguments_.clear();
      unescaped_.clear();
      if (!read_constant('}')) return false;
      if (arguments_[0].text == "...") {
        return error("syntax", arguments_[0].begin, arguments_[0].end,
                     "ranges belong into the model, not the evidence");
      }
      if (id) constant(*id, arguments_[0]);
      if (!skip_to_entry()) return unclosed();
      const char c = text_[position_];
      if (c != ',' && c != '}') return error("syntax", position_, position_ + 1, "expected ',' or '}'");
      ++position_;
      if (c == '}') return expect_line_end();
    }
  }

  std::string_view text_;
  std::uint32_t file_;
  EvidenceContext& context_;
  EvidenceBuilder& builder_;
  std::size_t position_;
  std::uint32_t line_;
  std::size_t line_begin_;
  std::size_t cursor_;        // columns are counted up to here
  std::uint32_t column_ = 1;  // of cursor_
  bool silent_ = false;
  bool unclosed_comment_ = false;
  std::optional<PredicateId> last_predicate_;
  std::vector<Argument> arguments_;
  std::vector<ConstantIndex> constants_;
  std::deque<std::string> unescaped_;  // quoted arguments with escapes, whose text is not in the file as it stands
};

// Whether the section holds blanks and comments alone.
bool is_blank_section(std::string_view text, const EvidenceSection& section) {
  const Model model;
  Diagnostics diagnostics;
  EvidenceContext context(model, diagnostics, {});
  EvidenceBuilder builder(context);
  return Reader(text, 0, section, context, builder).is_empty();
}

}  // namespace

std::vector<EvidenceSection> split_databases(std::string_view text) {
  std::vector<EvidenceSection> sections;
  EvidenceSection section;
  const bool has_comments = text.find("/*") != std::string_view::npos;
  bool in_comment = false;
  std::uint32_t line = 1;
  for (std::size_t begin = 0; begin < text.size(); ++line) {
    const std::size_t line_break = text.find('\n', begin);
    const std::size_t end = line_break == std::string_view::npos ? text.size() : line_break;
    const std::string_view content = text.substr(begin, end - begin);
    const std::size_t next = line_break == std::string_view::npos ? text.size() : line_break + 1;
    if (!in_comment && is_separator(content)) {
      section.end = begin;
      sections.push_back(section);
      section = {next, next, line + 1};
    } else if (has_comments) {
      in_comment = comment_open_after(content, in_comment);
    }
    begin = next;
  }
  section.end = text.size();
  sections.push_back(section);
  if (sections.size() > 1 && is_blank_section(text, sections.back())) sections.pop_back();
  if (sections.size() > 1 && is_blank_section(text, sections.front())) sections.erase(sections.begin());
  return sections;
}

void read_evidence(std::string_view text, std::uint32_t file, const EvidenceSection& section, EvidenceContext& context,
                   EvidenceBuilder& builder) {
  Reader(text, file, section, context, builder).read();
}

}  // namespace sherlog
