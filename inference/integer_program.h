// The most probable world as a 0/1 linear program, solved by its relaxation and, where that is not whole, by branch and cut.
//
// Idea      A 0/1 column for each atom; a column for each gate that carries weight or feeds one that does, tied to its inputs by
//           rows only in the directions that are pushed: an OR that is wanted true is at most the sum of its inputs, one
//           that is wanted false is at least each of them. Blocks are rows "exactly one" or "at most one". Four things make
//           the relaxation tight on matchings, where it otherwise says nothing:
//             groups   of which at most one is true, found among pairwise hard clauses, are one row instead of a row for each pair
//             sums     an OR over members of such a group is at least their sum, not only each of them
//             merging  equal weights on R v !a for all a of a group are one weight on R v !(some a)
//             counting soft groups of one weight (soft_cliques.h) cost by the number of their true members, a convex function
//           The rest is the solver's: Clp for the relaxation, Cbc for branch and cut.
// Source    Riedel, UAI 2008; Noessner, Niepert & Stuckenschmidt (RockIt), AAAI 2013, for cutting planes and merged evidence;
//           COIN-OR Clp and Cbc.
// Numbers   the solvers work to about 1e-7; a world's score is computed from its features.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "grounding/network.h"
#include "mln/monitor.h"

namespace sherlog {

struct IntegerProgramEffort {
  std::uint64_t iterations = 0;  // of the simplex method
  std::uint32_t nodes = 0;       // of branch and cut
};

enum class IntegerProgramStatus : std::uint8_t {
  kOptimal,     // values() is a most probable world
  kImpossible,  // no world meets the hard formulas
  kOpen,        // the effort was spent, or `stop` was reached; bound() holds
};

class IntegerProgram {
 public:
  explicit IntegerProgram(const GroundNetwork& network);
  ~IntegerProgram();
  IntegerProgram(const IntegerProgram&) = delete;
  IntegerProgram& operator=(const IntegerProgram&) = delete;

  std::size_t columns() const;
  std::size_t rows() const;
  std::size_t entries() const;
  std::size_t memory_bytes() const;  // estimate, with what the solvers add

  // Solves the relaxation. kOptimal where it came out whole.
  IntegerProgramStatus relax(const IntegerProgramEffort& effort, const StopCondition& stop);
  // After relax() said kOpen and is_relaxed(). `incumbent`: a possible world to beat, or empty; kOptimal leaves it in values()
  // where nothing is better.
  IntegerProgramStatus branch_and_cut(std::span<const std::uint32_t> incumbent, const IntegerProgramEffort& effort,
                                      const StopCondition& stop);

  bool is_relaxed() const;
  // No world's features sum to more (constant_score left out); infinity where nothing is known.
  double bound() const;
  // kOptimal: the world; otherwise, after is_relaxed(), the relaxation rounded (it may break hard formulas), or the best world
  // that branch and cut met.
  const std::vector<std::uint32_t>& values() const;

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace sherlog
