// Which ground formulas of a hard disjunction say the same.
//
// Idea      "A(x, u) ^ A(y, v) => x = y" is the same formula when x and y, and u and v, change places, and is true where x = y.
//           So it is enough to ground it for x before y: half of the work, and every constraint once. One-to-one rules such
//           as those of object identity are of this kind. Soft formulas count each of the two and are left alone.
#pragma once

#include <optional>
#include <utility>

#include "grounding/normal_form.h"

namespace sherlog {

// Two variables of which the first may be demanded to come before the second; nothing where no such symmetry is found.
std::optional<std::pair<std::uint32_t, std::uint32_t>> symmetric_pair(const NormalNode& disjunction,
                                                                      const Formula& formula);

}  // namespace sherlog
