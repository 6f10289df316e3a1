// Collecting and rendering of located messages (diagnostics.h).
//
// What comes from an input is never trusted: control characters and broken UTF-8 are shown as U+FFFD, so that a file
// cannot write to the terminal, and a line of any length is cut around its caret.
#include "mln/diagnostics.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>
#include <utility>

#include "mln/lexer.h"

namespace sherlog {

namespace {

constexpr std::size_t kColumns = 120;  // of a source line that are shown
constexpr std::size_t kBeforeCaret = 60;
constexpr std::size_t kTab = 4;
constexpr std::size_t kMaxDistance = 2;  // of did_you_mean
constexpr std::string_view kReplacement = "\xEF\xBF\xBD";
constexpr std::string_view kCut = "...";

struct Colours {
  std::string_view bold, error, warning, note, caret, reset;
};
constexpr Colours kPlain{};
constexpr Colours kTerminal{"\033[1m", "\033[1;31m", "\033[1;35m", "\033[1;36m", "\033[1;32m", "\033[0m"};

bool is_control(const CodePoint& point) {
  const char32_t c = point.value;
  const bool turns_direction = (c >= 0x202A && c <= 0x202E) || (c >= 0x2066 && c <= 0x2069);
  return !point.valid || c < 0x20 || (c >= 0x7F && c < 0xA0) || c == 0x2028 || c == 0x2029 || turns_direction;
}

std::string printable(std::string_view text) {
  std::string result;
  result.reserve(text.size());
  for (std::size_t i = 0; i < text.size();) {
    const CodePoint point = code_point_at(text, i);
    result += is_control(point) ? kReplacement : text.substr(i, point.bytes);
    i += point.bytes;
  }
  return result;
}

// Calls visit(index of the code point from 0, its display column from 0, its display width, its text).
template <class Visit>
void walk(std::string_view line, Visit visit) {
  std::size_t column = 0;
  std::size_t index = 0;
  for (std::size_t i = 0; i < line.size(); ++index) {
    const CodePoint point = code_point_at(line, i);
    const std::size_t width = point.value == '\t' ? kTab - column % kTab : 1;
    if (!visit(index, column, width, line.substr(i, point.bytes), point)) return;
    column += width;
    i += point.bytes;
  }
}

struct Span {
  std::size_t begin = 0;  // display columns
  std::size_t end = 0;
};

Span display_span(std::string_view line, const Place& place) {
  const std::size_t first = place.column - 1;
  const std::size_t last = first + std::max<std::size_t>(place.length, 1) - 1;
  Span span{std::string_view::npos, 0};
  std::size_t width_of_line = 0;
  walk(line, [&](std::size_t index, std::size_t column, std::size_t width, std::string_view, const CodePoint&) {
    width_of_line = column + width;
    if (index == first) span.begin = column;
    if (index >= first && index <= last) span.end = column + width;
    return index < last;
  });
  if (span.begin == std::string_view::npos) span = {width_of_line, width_of_line + 1};  // behind the end of the line
  return span;
}

struct Window {
  std::string text;
  Span caret;  // relative to the text
};

// The part of the line that is shown: all of it, or kColumns around the caret.
Window window(std::string_view line, const Place& place) {
  const Span span = display_span(line, place);
  std::size_t begin = span.begin > kColumns - 1 ? span.begin - kBeforeCaret : 0;
  Window result;
  bool cut = false;
  walk(line, [&](std::size_t, std::size_t column, std::size_t width, std::string_view text, const CodePoint& point) {
    if (column < begin) return true;
    if (column + width > begin + kColumns) {
      cut = true;
      return false;
    }
    if (point.value == '\t') {
      result.text.append(width, ' ');
    } else {
      result.text += is_control(point) ? kReplacement : text;
    }
    return true;
  });
  const std::size_t shift = begin > 0 ? kCut.size() : 0;
  if (begin > 0) result.text.insert(0, kCut);
  if (cut) result.text += kCut;
  result.caret = {span.begin - begin + shift, std::min(span.end, begin + kColumns) - begin + shift};
  return result;
}

std::string snippet(const Sources& sources, const Place& place, const Colours& colours) {
  if (place.line == 0 || place.column == 0 || place.file >= sources.size()) return "";
  const Window shown = window(sources.line(place.file, place.line), place);
  const std::size_t length = shown.caret.end > shown.caret.begin ? shown.caret.end - shown.caret.begin : 1;
  return fmt::format("{:>5} | {}\n{:>5} | {}{}^{}{}\n", place.line, shown.text, "", std::string(shown.caret.begin, ' '),
                     colours.caret, std::string(length - 1, '~'), colours.reset);
}

std::string heading(const Sources& sources, const Place& place, const Colours& colours) {
  const std::string where = sources.describe(place);
  return where.empty() ? "" : fmt::format("{}{}:{} ", colours.bold, printable(where), colours.reset);
}

// The edit distance, or anything above the bound where it is larger. Only a band around the diagonal is filled in.
std::size_t edit_distance(std::string_view a, std::string_view b, std::size_t bound) {
  if (a.size() > b.size()) std::swap(a, b);
  if (b.size() - a.size() > bound) return bound + 1;
  std::vector<std::size_t> previous(b.size() + 1, bound + 1);
  std::vector<std::size_t> current(b.size() + 1, bound + 1);
  for (std::size_t j = 0; j <= std::min(bound, b.size()); ++j) previous[j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i) {
    const std::size_t low = i > bound ? i - bound : 0;
    const std::size_t high = std::min(b.size(), i + bound);
    if (low > 0) current[low - 1] = bound + 1;
    for (std::size_t j = low; j <= high; ++j) {
      if (j == 0) {
        current[0] = i;
        continue;
      }
      const std::size_t replaced = previous[j - 1] + (a[i - 1] == b[j - 1] ? 0 : 1);
      const std::size_t removed = j <= i - 1 + bound ? previous[j] + 1 : bound + 1;
      const std::size_t inserted = j > low ? current[j - 1] + 1 : bound + 1;
      current[j] = std::min({replaced, removed, inserted});
    }
    std::swap(previous, current);
  }
  return previous[b.size()];
}

}  // namespace

std::uint32_t Sources::add(std::string name, std::string text) {
  texts_.push_back({std::move(name), std::move(text), {}});
  return static_cast<std::uint32_t>(texts_.size() - 1);
}

std::string_view Sources::line(std::uint32_t file, std::uint32_t line) const {
  if (file >= texts_.size() || line == 0) return {};
  const Text& source = texts_[file];
  if (source.line_starts.empty()) {
    source.line_starts.push_back(source.text.starts_with("\xEF\xBB\xBF") ? 3 : 0);
    for (std::size_t i = source.text.find('\n'); i != std::string::npos; i = source.text.find('\n', i + 1)) {
      source.line_starts.push_back(i + 1);
    }
  }
  if (line > source.line_starts.size()) return {};
  const std::size_t begin = source.line_starts[line - 1];
  const std::size_t end = std::min(source.text.find('\n', begin), source.text.size());
  std::string_view result = std::string_view(source.text).substr(begin, end - begin);
  if (result.ends_with('\r')) result.remove_suffix(1);
  return result;
}

std::string Sources::describe(const Place& place) const {
  if (place.file >= texts_.size()) return "";
  const std::string& file = texts_[place.file].name;
  if (place.line == 0) return file;
  if (place.column == 0) return fmt::format("{}:{}", file, place.line);
  return fmt::format("{}:{}:{}", file, place.line, place.column);
}

Diagnostics::Diagnostics() : sources_(std::make_shared<Sources>()) {}

void Diagnostics::error(std::string code, const Place& place, std::string text, std::vector<Note> notes) {
  add({Severity::kError, std::move(code), place, std::move(text), std::move(notes)});
}

void Diagnostics::warning(std::string code, const Place& place, std::string text, std::vector<Note> notes) {
  if (silenced_.contains(code)) return;
  add({Severity::kWarning, std::move(code), place, std::move(text), std::move(notes)});
}

void Diagnostics::add(Diagnostic diagnostic) {
  std::size_t& count = diagnostic.severity == Severity::kError ? error_count_ : warning_count_;
  if (count++ < kMaxShown) shown_.push_back(std::move(diagnostic));
}

std::string Diagnostics::render(const Diagnostic& diagnostic, bool colour) const {
  const Colours& colours = colour ? kTerminal : kPlain;
  const bool is_error = diagnostic.severity == Severity::kError;
  std::string result = heading(*sources_, diagnostic.place, colours);
  result += fmt::format("{}{}:{} {}", is_error ? colours.error : colours.warning, is_error ? "error" : "warning",
                        colours.reset, printable(diagnostic.text));
  if (!diagnostic.code.empty()) result += fmt::format(" [{}]", diagnostic.code);
  result += '\n';
  result += snippet(*sources_, diagnostic.place, colours);
  for (const Note& note : diagnostic.notes) {
    result += fmt::format("{}{}note:{} {}\n", heading(*sources_, note.place, colours), colours.note, colours.reset,
                          printable(note.text));
  }
  return result;
}

std::string Diagnostics::render(bool colour) const {
  std::string result;
  for (const Diagnostic& diagnostic : shown_) result += render(diagnostic, colour);
  const auto left_out = [](std::size_t count, std::string_view what) {
    const std::size_t more = count > kMaxShown ? count - kMaxShown : 0;
    return more == 0 ? "" : fmt::format("{} more {}{} not shown\n", more, what, more == 1 ? "" : "s");
  };
  return result + left_out(error_count_, "error") + left_out(warning_count_, "warning");
}

std::string did_you_mean(std::string_view name, const std::vector<std::string>& candidates) {
  std::string best;
  std::size_t best_distance = std::min(kMaxDistance + 1, name.size());
  for (const std::string& candidate : candidates) {
    const std::size_t distance = edit_distance(name, candidate, kMaxDistance);
    if (distance < best_distance) {
      best = candidate;
      best_distance = distance;
    }
  }
  return best;
}

}  // namespace sherlog
