// Redrawing which member of an at-most-one group is true, in one step.
//
// Idea      In a matching every row and every column holds at most one pair. Changing one pair at a time has to pass through
//           "no pair", and whatever soft formulas say about unmatched rows stands in the way. Here all members of a group compete at
//           once: the one that is true, every other whose place is free, and none. Boolean variables that hang on the
//           group's members alone ("this row is unmatched") are summed out of each choice and drawn again after it: given
//           the rest they are independent of each other, so the sum is a product of 1 + exp(change of flipping it).
// Source    Liu, JASA 89, 1994 (collapsing); the step is a Gibbs draw of (choice, leaves) given everything else.
// Requires  Demands are those of the index and are met.
//           Most members' other groups are taken; they are passed over by a look at one count, a variable at a time.
// Cost      O(members + free members x (occurrences + leaves)) a draw; set up in the size of what is above the variables.
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include "inference/rng.h"
#include "inference/world.h"
#include "mln/monitor.h"

namespace sherlog {

class GroupMoves {
 public:
  // What a sweep writes to; one for all components of a chain.
  struct Scratch {
    std::vector<std::uint32_t> own_leaves, choices;
    std::vector<double> weights;
  };

  // Finds the groups (demanded at-most-one gates over atoms whose variables have one value outside the group) and the leaves.
  GroupMoves(const WorldIndex& index, std::span<const VariableId> variables);

  bool empty() const { return groups_.empty(); }
  // Whether some group covers the variable (by network variable).
  bool covers(VariableId v) const { return std::ranges::binary_search(covered_, v); }
  // One draw of every group in turn, or of the first ones until `stop`.
  void sweep(World& world, Rng& rng, Scratch& scratch, const StopCondition* stop = nullptr) const;

 private:
  struct Member {
    VariableId variable;
    std::uint32_t value;   // that makes it true
    std::uint32_t escape;  // the variable's value outside the group
    std::uint32_t leaf_begin, leaf_end;
    bool plain_escape;  // leaving the escape value costs its own weight and nothing else
    double escape_weight;
  };
  // Neighbouring members of one variable, none of which is possible while something in `rival` is true.
  struct Place {
    VariableId variable;
    std::uint32_t begin, end;  // members
    std::uint32_t escape;
    std::uint32_t rival;  // another demanded at-most-one gate over all of them, or kNoRival
  };
  struct Group {
    std::uint32_t gate;
    std::uint32_t begin, end;  // members
    std::uint32_t place_begin, place_end;
  };
  static constexpr std::uint32_t kNoRival = 0xffffffffu;

  void find_groups(const WorldIndex& index, std::span<const VariableId> variables);
  bool add_members(const WorldIndex& index, std::uint32_t gate);
  std::uint32_t find_rival(const WorldIndex& index, const Member& member, std::uint32_t gate) const;
  void find_places(const WorldIndex& index, Group& group);
  void forget_leaves();
  void find_leaves(const WorldIndex& index, std::span<const VariableId> variables);
  void draw(World& world, Rng& rng, Scratch& scratch, const Group& group) const;
  std::uint32_t current_member(const World& world, const Group& group) const;
  void try_member(World& world, Scratch& scratch, std::uint32_t number) const;
  // log of the sum over the leaves (each free to flip) of exp(score), relative to their current values.
  double leaf_sum(World& world, std::span<const std::uint32_t> leaves) const;
  std::span<const std::uint32_t> leaves_of(const Member& m) const {
    return std::span(leaves_).subspan(m.leaf_begin, m.leaf_end - m.leaf_begin);
  }

  std::vector<Group> groups_;
  std::vector<Member> members_;
  std::vector<Place> places_;
  std::vector<std::uint32_t> leaves_;  // atoms, by member
  std::vector<VariableId> covered_;    // sorted
};

}  // namespace sherlog
