// Which stated evidence a ground formula speaks of.
#pragma once

#include <span>
#include <vector>

#include "mln/evidence.h"
#include "mln/model.h"

namespace sherlog::cli {

// A line of evidence: index into evidence.of(predicate).
struct StatedAtom {
  PredicateId predicate;
  std::size_t index = 0;
  bool operator==(const StatedAtom&) const = default;
};

// In the order in which the formula names them, each once; quantified variables run over their domains (cut short where
// that is very many). `by_variable`: a constant for each outer variable of the formula.
std::vector<StatedAtom> stated_atoms_of(const Model& model, const Evidence& evidence, const Formula& formula,
                                        std::vector<ConstantIndex> by_variable);

}  // namespace sherlog::cli
