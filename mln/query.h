// What is asked: predicates, ground atoms, atom patterns and ground formulas.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "mln/evidence.h"
#include "mln/model.h"

namespace sherlog {

struct QueryItem {
  enum class Kind : std::uint8_t {
    kAtoms,    // every ground atom that matches `pattern`
    kFormula,  // one ground formula
  };
  Kind kind = Kind::kAtoms;
  // kAtoms. A variable (is_variable, index) matches any constant, the same one wherever its index recurs.
  PredicateId predicate;
  std::vector<Term> pattern;
  std::uint32_t pattern_variables = 0;
  // kFormula. Without free variables; quantified ones are in `formula.variables`. formula.text is shown in results.
  Formula formula;
  std::string text;  // as the user wrote it
  // Names a constant that this database does not know: its predicates are open, and it has no answer.
  bool absent = false;
};

struct Query {
  std::vector<QueryItem> items;
};

// `texts`: what follows each -q; commas outside brackets separate items. The constants of `evidence` are known too.
// Errors: unknown predicate (with a suggestion), unknown constant, arity, syntax; then nothing is returned.
std::optional<Query> parse_query(const Model& model, const Evidence& evidence, const std::vector<std::string>& texts,
                                 Diagnostics& diagnostics);

// One query for each database. A constant has to be known to one of them; where another does not know it, the item is `absent`
// there, with a warning. A name that is a constant in one database is a constant, and no variable, in all of them.
std::optional<std::vector<Query>> parse_queries(const Model& model, std::span<const Evidence> databases,
                                                const std::vector<std::string>& texts, Diagnostics& diagnostics);

}  // namespace sherlog
