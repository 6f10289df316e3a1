// Located messages about input texts, and the texts themselves for the carets.
//
//   models/kitchen.mln:14:6: error: predicate 'on' takes 2 arguments, 3 given [arity]
//      14 | 1.5  on(x, y, z) => supports(y, x)
//         |      ^~~~~~~~~~~
//   models/kitchen.mln:3:1: note: 'on' is declared here
//
// A message is lower case, without a full stop, with names in quotes and a code that can be silenced. The library never
// prints: a front end renders.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <set>
#include <string>
#include <string_view>
#include <vector>

namespace sherlog {

// A stretch of one line in a source text. line and column count from 1 (columns in code points); 0: no place.
struct Place {
  std::uint32_t file = 0;
  std::uint32_t line = 0;
  std::uint32_t column = 0;
  std::uint32_t length = 1;
};

// The texts that were read, in order. Shared by everything that holds places into them.
class Sources {
 public:
  // Adds a text under the name shown in messages; returns its number (Place::file).
  std::uint32_t add(std::string name, std::string text);
  std::size_t size() const { return texts_.size(); }
  const std::string& name(std::uint32_t file) const { return texts_[file].name; }
  const std::string& text(std::uint32_t file) const { return texts_[file].text; }
  // The line without its line break; cut to a sensible length by the renderer, not here. Empty if there is none.
  std::string_view line(std::uint32_t file, std::uint32_t line) const;
  // "file:line:column", or "file:line" where column is 0, or the file's name where line is 0.
  std::string describe(const Place& place) const;

 private:
  struct Text {
    std::string name;
    std::string text;
    mutable std::vector<std::size_t> line_starts;  // filled on first use
  };
  std::vector<Text> texts_;
};

enum class Severity : std::uint8_t { kWarning, kError };

struct Note {
  Place place;
  std::string text;
};

struct Diagnostic {
  Severity severity = Severity::kError;
  std::string code;  // e.g. "arity", "syntax", "unknown-predicate"
  Place place;
  std::string text;
  std::vector<Note> notes;
};

// Collects at most `kMaxShown` errors and as many warnings; the rest are counted.
class Diagnostics {
 public:
  static constexpr std::size_t kMaxShown = 20;

  Diagnostics();

  Sources& sources() { return *sources_; }
  const Sources& sources() const { return *sources_; }
  std::shared_ptr<const Sources> shared_sources() const { return sources_; }

  void error(std::string code, const Place& place, std::string text, std::vector<Note> notes = {});
  void warning(std::string code, const Place& place, std::string text, std::vector<Note> notes = {});
  // Warnings of this code are dropped from now on.
  void silence(std::string code) { silenced_.insert(std::move(code)); }

  bool has_errors() const { return error_count_ > 0; }
  std::size_t error_count() const { return error_count_; }
  std::size_t warning_count() const { return warning_count_; }
  const std::vector<Diagnostic>& all() const { return shown_; }

  // Every message with its line and caret, notes below it, and a last line that counts what was left out.
  // Lines longer than 120 columns are cut around the caret. With `colour`, ANSI colours.
  std::string render(bool colour = false) const;
  std::string render(const Diagnostic& diagnostic, bool colour = false) const;

 private:
  void add(Diagnostic diagnostic);

  std::shared_ptr<Sources> sources_;
  std::vector<Diagnostic> shown_;
  std::set<std::string> silenced_;
  std::size_t error_count_ = 0;
  std::size_t warning_count_ = 0;
};

// The candidate nearest to `name` with an edit distance of at most 2 (and less than the name's length), or "".
std::string did_you_mean(std::string_view name, const std::vector<std::string>& candidates);

}  // namespace sherlog
