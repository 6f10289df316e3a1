// Warnings about models that are well formed but suspicious.
//
// Input     a finished model
// Output    warnings "unused-predicate", "unused-domain", "tautology", "contradiction", "duplicate-formula"; a hard formula that
//           no world satisfies is an error. Constant truth is decided by a truth table over at most 16 distinct atoms and
//           quantified subformulas, which are taken to be independent: a formula found constant is constant, one that
//           is constant for a deeper reason (a block, the meaning of a quantifier) is not found.
// Cost      linear in the model; at most 1024 words for each node of a formula
#pragma once

#include "mln/diagnostics.h"
#include "mln/model.h"

namespace sherlog {

void check_model(const Model& model, Diagnostics& diagnostics);

enum class ConstantTruth : std::uint8_t { kVaries, kAlwaysTrue, kAlwaysFalse };

// kVaries also where the formula has more than 16 distinct atoms.
ConstantTruth constant_truth(const Formula& formula);

// Equal for two formulas that differ in the names of their variables alone.
std::string formula_key(const Formula& formula);

}  // namespace sherlog
