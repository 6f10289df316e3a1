// Formulas as written, before grounding, brought into clauses for systems that know nothing else.
//
// Idea      Push negations to the atoms (=> and <=> are written out), pull quantifiers out of the way where that
//           changes nothing, distribute v over ^. Only a hard formula may become several clauses: dividing a weight
//           over them would be another model. A quantifier is pulled out only where its variable meets no other of that
//           name, and an EXIST never across a FORALL. (Over an empty domain EXIST x (P(x)) v Q() and EXIST x (P(x) v Q())
//           differ; the systems that want clauses have no empty domains.)
// Cost      Exponential in the worst case, so bounded by kMaxClauses.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "mln/syntax.h"

namespace sherlog {

inline constexpr std::size_t kMaxClauses = 1000;

struct SyntaxClause {
  std::vector<syntax::Term> exists;       // quantified in front of the whole clause
  std::vector<syntax::Formula> literals;  // atoms, comparisons, and negated atoms
  std::vector<std::string> bound;         // names that a quantifier bound, those of FORALL (now free) included
};

// The clauses whose conjunction is the formula (free variables are universally quantified around it). Nothing where it
// cannot be: an EXIST over several clauses, a quantifier whose variable is used outside it too, more than kMaxClauses.
// `keeps_groundings` tells whether it is one clause whose groundings are those of the formula, so that a weight carries
// over.
std::optional<std::vector<SyntaxClause>> to_clauses(const syntax::Formula& formula, bool negated,
                                                    bool* keeps_groundings = nullptr);

}  // namespace sherlog
