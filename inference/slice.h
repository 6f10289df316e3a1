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
// Cost      O(weighted nodes + occurrences of the variables that move) time and memory.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "inference/rng.h"
#include "inference/world.h"

namespace sherlog {

class SliceStep {
 public:
  // `variables`: those that may move. With `jump`: SampleSAT from a random world before the uniform moves.
  SliceStep(const WorldIndex& index, std::span<const VariableId> variables, bool jump);

  void step(World& world, Rng& rng);

 private:
  void choose(World& world, Rng& rng);
  void group(const World& world);
  void draw_group(World& world, Rng& rng, std::span<const std::uint32_t> members, bool constrained);
  std::uint32_t root(std::uint32_t v);

  struct WeightedNode {
    std::uint32_t node;
    bool positive;
    double stay;  // 1 - exp(-|weight|)
  };

  const WorldIndex* index_;
  std::vector<VariableId> variables_;
  std::vector<std::uint32_t> local_;  // by variable of the network, or kOutside
  std::vector<WeightedNode> weighted_;
  std::vector<std::uint32_t> hard_gates_;
  bool jump_;
  // Of the current slice.
  std::vector<std::uint32_t> demanded_;      // nodes, to be released again
  std::vector<std::uint32_t> active_;        // gates whose demand still leaves a choice
  std::vector<std::uint32_t> parent_;        // union-find over variables_
  std::vector<std::uint32_t> constraints_of_;  // active gates in each group, by root
  std::vector<std::uint32_t> members_, group_start_, old_values_;
  std::vector<double> scratch_;
};

}  // namespace sherlog
