// Gibbs sampling: every variable in turn from its conditional distribution; a `!` or `?` block is one variable. Sets of variables of
// bounded width are drawn jointly in between, which changes nothing in the distribution and much in the mixing.
//
// Requires  That changing one variable at a time reaches every possible world (ergodicity.h): hard formulas can make that
//           impossible, and then the method refuses and says what to use.
// See       sampler.h (the loop, its output and errors), joint_block.h
// Source    Geman & Geman, PAMI 6, 1984.
#pragma once

#include "inference/inference.h"

namespace sherlog {

MethodResult run_gibbs(const MethodContext& context);

}  // namespace sherlog
