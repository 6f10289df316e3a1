// Which sets of variables the samplers draw jointly.
//
// Idea      A component narrow enough is one block. Otherwise blocks of bounded cost grow around seeds: next comes the
//           variable that shares most with the block, as long as the elimination stays cheap. Every variable seeds or joins a
//           block, and a second cover with other seeds makes blocks overlap, so that no border stays in one place. At-most-one
//           groups and long ORs give blocks of their own: a row of a matching moves as one, with what hangs on it.
//           A component that is a thousand times as large may cost as many table entries as one block: it is summed out once, and
//           a draw of it costs what a sweep does.
// Cost      A few builds of each block; the number of blocks is linear in the number of variables, and so is the work, by a budget of
//           builds.
#pragma once

#include <span>
#include <vector>

#include "inference/joint_block.h"
#include "mln/monitor.h"

namespace sherlog {

struct BlockCoverOptions {
  double whole_cost = 1 << 20;         // table entries up to which a component is one block,
  double whole_cost_of_variable = 64;  // or so many for each of its variables
  double block_cost = 1 << 13;         // likewise for a part of a component
  std::uint32_t block_variables = 96;
  std::uint32_t covers = 2;
  // Where an atom is used by more gates than this on average, everything is tied to everything and no set is narrow.
  double most_uses = 48.0;
};

struct BlockCover {
  std::vector<JointBlock> blocks;
  bool whole = false;  // one block, the whole component
};

// `numbers`: see number_within(). Ends early, with fewer blocks, where `stop` says so.
BlockCover cover_component(const WorldIndex& index, std::span<const VariableId> variables,
                           std::span<const std::uint32_t> numbers, std::uint64_t seed, const StopCondition& stop,
                           const BlockCoverOptions& options = {});

}  // namespace sherlog
