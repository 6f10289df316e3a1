// A model rewritten for another system: what a printer cannot do by spelling alone.
//
// Idea      Names: Alchemy and Tuffy tell constants from variables by their first letter, PRACGrammar by the ?; so each
//           name is classified by our own rules (declared domain, capital, ?x) and written by theirs. Blocks,
//           quantifiers and non-clausal formulas are written as something that means the same, where there is such a
//           thing. What there is not is written as a comment, with a warning: never as something that means less.
// Output    Text of one file, includes written out.
#pragma once

#include <string>

#include "mln/printer.h"
#include "mln/syntax.h"

namespace sherlog {

std::string convert(const syntax::Model& model, Dialect dialect, Diagnostics& diagnostics);

}  // namespace sherlog
