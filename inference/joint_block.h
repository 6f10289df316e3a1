// Drawing many variables of a World at once, exactly from their joint distribution given all the others.
//
// Idea      A set of variables whose interactions have small induced width can be summed out by elimination and sampled backwards
//           in one go, however strong the weights between them: the step has no rejections and crosses between modes that
//           single flips never leave. What lies outside the set enters only through a few bits for each ground formula
//           ("some input outside is true"), so every table is made once for each value of those bits when the block is
//           built, and a draw only picks tables. Long ORs and at-most-one gates become chains of auxiliary bits.
//           A set that reads no outside bit (a whole component, say) is summed out once, and its draws are independent; with
//           few joint values it is one table of running sums.
// Source    Hamze & de Freitas, UAI 2004 (trees); Bidyuk & Dechter, JAIR 28, 2007 (cutset sampling, bounded width).
// Requires  The World's weights and demands are those of its index (no slice).
// Cost      build O(tables + formulas above the set); a draw O(cost()) time, no allocation. Blocks are constant: chains share them
//           and bring a workspace each.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "inference/elimination_plan.h"
#include "inference/rng.h"
#include "inference/world.h"

namespace sherlog {

class JointBlock {
 public:
  // What a draw writes to; one for all blocks of a chain.
  struct Workspace {
    EliminationPlan::Contents contents;
    EliminationPlan::Scratch scratch;
    std::vector<std::uint8_t> bits;
    std::vector<std::uint32_t> drawn;
  };

  // Nothing where the elimination would need more than `max_cost` table entries, or a formula cannot be cut into tables, or
  // `stop` says so.
  static std::optional<JointBlock> make(const WorldIndex& index, std::span<const VariableId> variables, double max_cost,
                                        const StopCondition* stop = nullptr);

  // Redraws the variables; false where no value of them agrees with the hard formulas outside (the World is left as it is).
  bool draw(World& world, Rng& rng, Workspace& workspace) const;

  std::span<const VariableId> variables() const { return variables_; }
  // Table entries that a draw touches.
  double cost() const { return cost_; }
  // Reads nothing outside itself: draws are independent.
  bool self_contained() const { return bits_.empty(); }

 private:
  friend class JointBlockBuilder;

  // One bit about the outside: whether some outside input of a gate is true (OR, at most one), or the outside input of
  // an IFF. Inputs inside are subtracted from the World's count.
  struct OutsideBit {
    std::uint32_t gate = 0;
    std::uint32_t inside_begin = 0, inside_end = 0;  // literals in inside_
  };
  // A table that depends on outside bits: variants one after the other, the first bit is the lowest of their number.
  struct Variants {
    std::uint32_t table = 0;
    std::uint32_t bits_begin = 0, bits_end = 0;  // bit numbers in variant_bits_
    std::uint32_t values_begin = 0;              // in variant_values_
  };

  JointBlock() = default;
  void prepare_once();
  bool draw_from_running_sums(World& world, Rng& rng) const;
  void fill(const World* world, EliminationPlan::Contents& contents, std::vector<std::uint8_t>& bits) const;

  std::vector<VariableId> variables_;
  std::vector<OutsideBit> bits_;
  std::vector<Literal> inside_;
  std::vector<Variants> variants_;
  std::vector<std::uint32_t> variant_bits_;
  std::vector<double> variant_values_;
  std::vector<double> base_;                // contents of all tables, bits aside, one after the other
  std::optional<EliminationPlan> plan_;     // none where running_sums_ says it all
  std::vector<double> running_sums_;        // by joint value, the last variable runs fastest
  EliminationPlan::Contents own_contents_;  // of a self-contained block: prepared when built
  bool possible_ = true;                    // likewise
  double cost_ = 0.0;
};

// Draws one variable from its conditional distribution, or, with `uniform`, uniformly among the values that keep all demands.
// The World's demands must be met. Returns false where its value stayed.
bool gibbs_step(World& world, VariableId v, Rng& rng, bool uniform, std::vector<double>& scratch);

}  // namespace sherlog
