// The joins that ground one formula: one for most, two for an equivalence.
//
// Idea      `A <=> B` at the top of a formula is not decided by a single goal, so one join would run through all of its variables'
//           domains. It is the conjunction of two implications, and each of them joins: the possible truths of A where B may be false,
//           and the other way round. The equivalence stays one ground formula; the second join leaves out what the first had.
// Cost      that of the two implications, or of the plain join where that expects fewer steps.
#pragma once

#include <memory>
#include <vector>

#include "grounding/join.h"

namespace sherlog {

struct FormulaJoins {
  std::vector<std::unique_ptr<FormulaJoin>> joins;
  bool disjunctive = false;  // assignments that no join visits are true (else: false)

  double expected_visits() const;
  double expected_leaves() const;
  template <class Leaf>
  bool run(Leaf leaf) {
    for (const auto& join : joins) {
      if (!join->run(leaf)) return false;
    }
    return true;
  }
};

// `root`: the formula's normal form, or a conjunct of it. See FormulaJoin for the rest.
FormulaJoins plan_joins(NormalNode root, const Formula& formula, const std::vector<std::uint32_t>& outer,
                        const std::vector<NormalNode>& filters, bool disjunctive, AtomTable& atoms,
                        ConstantNumbers& numbers, NetworkBuilder& builder, const KeepGoing& keep_going);

}  // namespace sherlog
