// Formulas that speak of every value of a block but some, said by the block itself.
//
// Idea      In   !is(a, c, e) v e = not v rest   the variable e stands for every value of the block is(a, c, !) and for nothing
//           else. The block has exactly one value, so the disjuncts hold for all e exactly where that value is one of the
//           excepted ones:   is(a, c, not) v rest.   A rule over two blocks of k + 1 values is one ground formula for each
//           pair of blocks instead of k * k.
#pragma once

#include <cstdint>
#include <vector>

#include "grounding/normal_form.h"
#include "mln/model.h"

namespace sherlog {

// Rewrites a disjunction that is to hold for all values of the outer variables. Returns the variables that are gone.
std::vector<std::uint32_t> say_by_blocks(NormalNode& disjunction, const Formula& formula, const Model& model,
                                         const AtomTable& atoms);

}  // namespace sherlog
