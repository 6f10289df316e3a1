// Several databases under one model that knows all their constants, and databases with something left out.
//
// Idea      Constants that a database adds are its own: the same name may stand at different places in two databases. What
//           ranges over several databases (the weights of a template, the values of a block) needs one numbering for
//           all, so the domains concerned are widened in a copy of the model and the databases are renumbered.
#pragma once

#include <span>
#include <vector>

#include "mln/evidence.h"
#include "mln/model.h"

namespace sherlog {

// Domains whose constants all databases of one training set share: declared with values, ranged over by a +, or at a
// marked argument. By domain.
std::vector<bool> shared_domains(const Model& model);

// The model with the constants that any of the databases adds to the given domains behind its own, in order of
// appearance. Ids of predicates, formulas and domains stay.
Model with_shared_constants(const Model& model, std::span<const Evidence> databases, const std::vector<bool>& domains);

// `evidence` of `from` as evidence of `to`, which is `from` with more constants.
Evidence renumbered(const Evidence& evidence, const Model& from, const Model& to);

// The database without what it states of some predicates (by predicate). All constants stay.
Evidence without(const Evidence& evidence, const std::vector<bool>& predicates);

}  // namespace sherlog
