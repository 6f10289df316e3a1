// Text to syntax trees. One hand-written grammar for the union of what Alchemy, Tuffy, pracmln and the paper write.
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "mln/syntax.h"

namespace sherlog {

// How tightly ^ and v bind: the same text means different things to different systems.
enum class Precedence : std::uint8_t {
  kAndTighter,  // ours, Alchemy, LoMRF, PRACGrammar
  kOrTighter,   // pracmln's StandardGrammar, ProbCog's Python engine
};

struct ParseOptions {
  Precedence precedence = Precedence::kAndTighter;
  bool follow_includes = true;
  int max_depth = 1000;  // brackets and negations nested deeper are an error
};

// Parses one text; recovers at the next statement. Includes are read relative to the folder of `name`; a cycle is an error.
// Errors go to `diagnostics`; what could be parsed is returned all the same.
syntax::Model parse_syntax(std::string_view text, const std::string& name, Diagnostics& diagnostics,
                           const ParseOptions& options = {});
// A single formula (as in a query), without weight. Nothing where it has an error.
std::optional<syntax::Formula> parse_formula(std::string_view text, const std::string& name, Diagnostics& diagnostics,
                                             const ParseOptions& options = {});

// Reads a whole file; "-" is standard input. Errors (missing, a folder, binary, not UTF-8, too large) go to `diagnostics`.
std::optional<std::string> read_text_file(const std::string& path, Diagnostics& diagnostics);

}  // namespace sherlog
