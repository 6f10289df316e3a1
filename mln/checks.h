// Warnings about models that are well formed but suspicious, and the one rule that only the whole model can break: what is
// compared by size is numbers.
//
// Input     a finished model
// Output    warnings "unused-predicate", "unused-domain", "tautology", "contradiction", "duplicate-formula"; a hard formula that
//           no world satisfies is an error, and so is a constant that is no number in a domain that '<' compares
//           ("not-numeric"). Constant truth is decided by a truth table over at most 16 distinct atoms and
//           quantified subformulas, which are taken to be independent: a formula found constant is constant, one that
//           is constant for a deeper reason (a block, the meaning of a quantifier) is not found.
// Cost      linear in the model; at most 1024 words for each node of a formula
#pragma once

#include <optional>
#include <vector>

#include "mln/diagnostics.h"
#include "mln/model.h"

namespace sherlog {

void check_model(const Model& model, Diagnostics& diagnostics);

enum class ConstantTruth : std::uint8_t { kVaries, kAlwaysTrue, kAlwaysFalse };

// kVaries also where the formula has more than 16 distinct atoms.
ConstantTruth constant_truth(const Formula& formula);

// By domain: the place of the first '<', '<=', '>' or '>=' over it, where there is one.
std::vector<std::optional<Place>> compared_domains(const Model& model);
// The same for one formula, into `places`, which has an entry for each domain.
void add_compared_domains(const FormulaNode& node, std::vector<std::optional<Place>>& places);

// Equal for two formulas that differ in the names of their variables alone.
std::string formula_key(const Formula& formula);

}  // namespace sherlog
