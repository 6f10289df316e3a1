// Why the evidence and the model leave no world: ground formulas as text, and the evidence that makes one false.
//
// Idea      The evidence atoms that make a ground formula false are read off the formula (a false AND needs one false
//           conjunct, a false OR all its disjuncts, ...), then each is forgotten in turn: where the formula stays false
//           under Kleene's three-valued logic without it, it is dropped. None of the rest can be.
#pragma once

#include "grounding/atom_table.h"
#include "grounding/ground.h"

namespace sherlog {

// The formula under these constants for its variables (`by_variable`: quantified ones, and those under kEveryConstant, are
// left as they are).
std::string ground_formula_text(const Model& model, const Evidence& evidence, const Formula& formula,
                                std::span<const ConstantIndex> by_variable);

// The hard formula `id` is false under these constants.
Conflict conflict_of_formula(const Model& model, const Evidence& evidence, const AtomTable& atoms, FormulaId id,
                             std::vector<ConstantIndex> by_variable);
// These ground formulas contradict each other: each with its constants by variable.
struct GroundFormula {
  FormulaId formula;
  std::vector<ConstantIndex> by_variable;
};
Conflict conflict_of_formulas(const Model& model, const Evidence& evidence, const AtomTable& atoms,
                              const std::vector<GroundFormula>& formulas);
// A '!' block has no value left.
Conflict conflict_of_block(const Model& model, const Evidence& evidence, const AtomTable::EmptyBlock& block);
// A soft atom that must have probability p is decided by the rest of the evidence.
Conflict conflict_of_soft_atom(const Model& model, const Evidence& evidence, const AtomTable& atoms,
                               PredicateId predicate, std::span<const ConstantIndex> arguments, double degree,
                               const Place& place);

}  // namespace sherlog
