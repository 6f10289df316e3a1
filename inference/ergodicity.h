// Whether changing one variable at a time can reach every possible world.
//
// Idea      Hard formulas join variables into groups; inside a group the possible worlds are the nodes of a graph whose
//           edges change one variable. Sampling by single changes is right only where that graph is connected.
//             always      every variable of the group has a value that satisfies each of its formulas' literals on it: all
//                         worlds lead, one variable at a time, to the world made of these values
//             by search   a group with few joint values is enumerated and its graph walked
//           Groups that neither settles are taken as not connected.
// Cost      linear, plus O(kLargestSearch x variables) for a group that is searched, within a budget of steps for all.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "grounding/network.h"
#include "mln/monitor.h"

namespace sherlog {

// Shared by the components of one network. Once it is used up, or `stop` says so, whatever is not settled counts as not connected.
struct ErgodicityBudget {
  std::uint64_t steps = std::uint64_t{1} << 28;
  const StopCondition* stop = nullptr;
};

// Open variables of each group that is taken as not connected. Nothing where the budget ended before the groups were known.
std::optional<std::vector<std::vector<VariableId>>> locked_groups(const GroundNetwork& network, ComponentId component,
                                                                  ErgodicityBudget& budget);
bool single_moves_reach_every_world(const GroundNetwork& network, ComponentId component, ErgodicityBudget& budget);

}  // namespace sherlog
