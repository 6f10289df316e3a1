// The weight at the head of a formula: 1.5, -log(2), log(0.15/0.85), logx(0), ...
//
// Idea      Whether a statement opens with a weight or with a formula is decided by trying: (1+2) P(x) against
//           (P(x) ^ Q(x)). An operator that no operand follows belongs to the formula: 1.5 *P(x).
// Grammar   sum of products of powers of numbers, brackets, unary signs, and log, ln, logx, exp, sqrt of a sum.
// Cost      Linear: what failed once is not tried again.
#pragma once

#include <optional>
#include <string>

#include "mln/lexer.h"

namespace sherlog {

struct Weight {
  double value = 0;      // may be infinite or not a number: the caller's error
  bool negates = false;  // logx(0): the formula is never true
  bool too_deep = false;
  std::string text;  // as written
  Token last;        // its last token
};

// The weight that starts with `first`, or nothing where none stands there. `lexer` must be of first's text.
std::optional<Weight> read_weight(Lexer lexer, const Token& first, int max_depth);

}  // namespace sherlog
