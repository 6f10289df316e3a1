// Syntax trees back to text. Parse, print, parse is the identity.
#pragma once

#include <string>

#include "mln/syntax.h"

namespace sherlog {

enum class Dialect : std::uint8_t { kSherlog, kAlchemy, kPracmln, kTuffy };

// The formula with the fewest brackets that our precedence needs; for another dialect with that dialect's spelling and, where
// its precedence differs or is not sure, with brackets around every mix.
std::string print(const syntax::Formula& formula, Dialect dialect = Dialect::kSherlog);
// The whole model, one statement a line. Statements that came through an include (depth > 0) are left out and the include
// kept, unless `inline_includes`.
std::string print(const syntax::Model& model, Dialect dialect = Dialect::kSherlog, bool inline_includes = false);

// One term; a constant in quotes only where it was written so or needs them.
std::string print(const syntax::Term& term, Dialect dialect = Dialect::kSherlog);

// Whether two trees are the same but for their places. Brackets that were written count.
bool equal(const syntax::Formula& left, const syntax::Formula& right);
bool equal(const syntax::Model& left, const syntax::Model& right);

}  // namespace sherlog
