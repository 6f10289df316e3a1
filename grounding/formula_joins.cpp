#include "grounding/formula_joins.h"

#include <algorithm>
#include <utility>

namespace sherlog {

double FormulaJoins::expected_visits() const {
  double visits = 0;
  for (const auto& join : joins) visits += join->expected_visits();
  return visits;
}

double FormulaJoins::expected_leaves() const {
  double leaves = 0;
  for (const auto& join : joins) leaves += join->expected_leaves();
  return leaves;
}

FormulaJoins plan_joins(NormalNode root, const Formula& formula, const std::vector<std::uint32_t>& outer,
                        const std::vector<NormalNode>& filters, bool disjunctive, AtomTable& atoms,
                        ConstantNumbers& numbers, NetworkBuilder& builder, const KeepGoing& keep_going) {
  FormulaJoins split, plain;
  if (root.shape == NodeShape::kIff) {  // the whole formula, if implications() finds any
    if (auto both = implications(formula, atoms, numbers)) {
      split.disjunctive = true;
      split.joins.push_back(std::make_unique<FormulaJoin>(root, both->first, std::nullopt, formula, outer, filters,
                                                          atoms, builder, keep_going));
      split.joins.push_back(std::make_unique<FormulaJoin>(root, both->second, both->first, formula, outer, filters,
                                                          atoms, builder, keep_going));
    }
  }
  plain.disjunctive = disjunctive;
  plain.joins.push_back(
      std::make_unique<FormulaJoin>(std::move(root), formula, outer, filters, disjunctive, atoms, builder, keep_going));
  const bool better = !split.joins.empty() && split.expected_visits() < plain.expected_visits();
  return better ? std::move(split) : std::move(plain);
}

}  // namespace sherlog
