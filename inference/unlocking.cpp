#include "inference/unlocking.h"

#include <utility>

namespace sherlog {
namespace {

constexpr double kMostCost = 1 << 18;  // table entries of one block

}  // namespace

Unlocking unlock(const WorldIndex& index, ComponentId component, std::span<const std::uint32_t> numbers,
                 ErgodicityBudget& budget, const StopCondition& stop) {
  Unlocking result;
  auto locked = locked_groups(index.network(), component, budget);
  if (!locked) {
    result.is_complete = false;
    return result;
  }
  for (std::vector<VariableId>& group : *locked) {
    std::erase_if(group, [&](VariableId v) { return numbers[v.index()] == kNoNumber; });
    if (group.empty()) continue;
    auto block = JointBlock::make(index, group, kMostCost, &stop);
    if (!block) {
      result.is_complete = false;
      continue;
    }
    result.cost += block->cost();
    result.blocks.push_back(std::move(*block));
  }
  return result;
}

}  // namespace sherlog
