// Typing of one formula: which names are predicates, variables and constants, and the domain of each variable.
//
// Idea      An atom gives every argument its domain; with the domain known, a plain name is a constant or a variable by
//           the rules of the language. The two sides of an equality or comparison share a domain, which flows from one
//           side to the other until nothing changes. Models and queries differ only in their constants: a model appends
//           those it meets, a query refuses those it does not know. A Vocabulary hides that difference.
// Errors    Go to the diagnostics with their places; a formula with an error is not returned.
// Cost      Linear in the formula for atoms; at most quadratic in the number of comparisons.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "mln/formula.h"
#include "mln/model.h"
#include "mln/syntax.h"

namespace sherlog {

// What a formula's names are looked up in.
class Vocabulary {
 public:
  virtual ~Vocabulary() = default;
  virtual std::optional<PredicateId> find_predicate(std::string_view name) const = 0;
  virtual const Predicate& predicate(PredicateId id) const = 0;
  virtual const std::string& domain_name(DomainId id) const = 0;
  // Whether the plain name is a constant of the domain whatever its first letter.
  virtual bool is_member(DomainId domain, const std::string& name) const = 0;
  // The number of a constant. A model appends what is new; a query reports it and returns nothing.
  virtual std::optional<ConstantIndex> constant(DomainId domain, const syntax::Term& term) = 0;
  // The note that shows where a predicate is declared; none where the messages are about other texts than the model's.
  virtual std::vector<Note> declaration_note(const Predicate& predicate) const = 0;
  // Reports an atom of an undeclared predicate.
  virtual void unknown_predicate(const syntax::Formula& atom) = 0;
};

struct TypedFormula {
  Formula formula;                      // root, variables and place; the rest is the caller's
  std::vector<std::size_t> star_atoms;  // atoms written *P(...), counted from 0 over all atoms in text order
};

std::optional<TypedFormula> type_formula(const syntax::Formula& formula, Vocabulary& vocabulary,
                                         Diagnostics& diagnostics);

// The number that a constant is, if it is one as a whole.
std::optional<double> numeric_value(std::string_view constant);
// "; did you mean 'x'?" or nothing.
std::string suggestion(std::string_view name, const std::vector<std::string>& candidates);
// "'name' is declared here"; nothing where the model was read with other diagnostics, whose places mean nothing here.
std::vector<Note> declaration_note(const Model& model, const Diagnostics& diagnostics, const Place& place,
                                   std::string_view name);
// "1 argument", "2 arguments".
std::string counted(std::size_t count, std::string_view noun);

}  // namespace sherlog
