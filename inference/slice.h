// The slice step of MC-SAT: a uniform move among the worlds that keep a random choice of what is true now.
//
// Idea      Every feature that the current world satisfies (weight > 0: is true; weight < 0: is false) has to stay so with
//           probability 1 - exp(-|weight|); then a new world is drawn uniformly from those that meet all these demands and the hard
//           formulas. Features are whole formulas: a demand is on one gate, never on the clauses of its normal form.
//           Uniform draws: demands fall apart into small groups of variables. A group is drawn by rejection: all its
//           variables uniformly, kept if the demands hold. After a few failures, or where it is large, each of its
//           variables is redrawn uniformly among the values that keep all demands. Both leave the uniform distribution
//           unchanged, and which of them is used does not depend on the current world, so the step is exactly invariant,
//           however small or large the group; nothing is biased by a search that prefers some solutions.
//           Where hard formulas could lock such moves in, SampleSAT (sample_sat.h) jumps first.
// Source    Poon & Domingos, AAAI 2006, Alg. 1; we differ in the sub-solver, and in whole formulas instead of clauses.
// Cost      O(weighted nodes + occurrences of the variables that move) time and memory; set up in the size of what is above the
//           variables, not of the network.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "inference/rng.h"
#include "inference/world.h"
#include "mln/monitor.h"

namespace sherlog {

class SliceStep {
 public:
  // What a step writes to; one for all components of a chain.
  struct Scratch {
    std::vector<std::uint32_t> demanded;        // nodes, to be released again
    std::vector<std::uint32_t> active;          // gates whose demand still leaves a choice
    std::vector<std::uint32_t> parent;          // union-find over the variables
    std::vector<std::uint32_t> constraints_of;  // active gates in each group, by root
    std::vector<std::uint32_t> members, group_start, old_values, stack;
    std::vector<double> weights;
  };

  // `variables`: those that may move, all of one component or of several. `numbers`: see number_within(); outlives the step. With
  // `jump`: SampleSAT from a random world before the uniform moves.
  SliceStep(const WorldIndex& index, std::span<const VariableId> variables, std::span<const std::uint32_t> numbers,
            bool jump);

  // Leaves the distribution as it is; cut short by `stop`, the world meets the hard formulas still.
  void step(World& world, Rng& rng, Scratch& scratch, const StopCondition* stop = nullptr) const;

 private:
  void choose(World& world, Rng& rng, Scratch& scratch) const;
  void jump_away(World& world, Rng& rng, Scratch& scratch, const StopCondition* stop) const;
  void group(const World& world, Scratch& scratch) const;
  void join_below(std::uint32_t gate, Scratch& scratch) const;
  void draw_group(World& world, Rng& rng, Scratch& scratch, std::span<const std::uint32_t> members,
                  bool constrained) const;

  struct WeightedNode {
    std::uint32_t node;
    bool positive;
    double stay;  // 1 - exp(-|weight|)
  };

  const WorldIndex* index_;
  std::vector<VariableId> variables_;
  std::span<const std::uint32_t> numbers_;
  std::vector<WeightedNode> weighted_;
  std::vector<std::uint32_t> hard_gates_;
  bool jump_;
};

}  // namespace sherlog
