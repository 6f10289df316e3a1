// Joint draws of what hard formulas lock together.
//
// Idea      Where single changes cannot reach every world, the variables that hard formulas tie are drawn as a whole, exactly
//           given all the others, if that is narrow enough: then single changes and these draws reach every world and leave the
//           distribution as it is. A search from a random world (sample_sat.h) reaches every world as well, but finds some kinds of
//           worlds more often than others, and no number of draws mends that.
// Cost      a build of a JointBlock for each locked group
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "inference/ergodicity.h"
#include "inference/joint_block.h"

namespace sherlog {

struct Unlocking {
  std::vector<JointBlock> blocks;
  double cost = 0.0;        // of drawing all of them once, table entries
  bool is_complete = true;  // false: a locked group is too wide, or not known
};

// For a component of the index's network. `numbers`: see number_within(); variables without one are defined by others.
Unlocking unlock(const WorldIndex& index, ComponentId component, std::span<const std::uint32_t> numbers,
                 ErgodicityBudget& budget, const StopCondition& stop);

}  // namespace sherlog
