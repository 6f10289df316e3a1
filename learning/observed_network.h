// One training database as a ground network over the predicates to be explained, and the world that was observed.
//
// Idea      Training data is closed world and complete. What the database states of the open predicates is taken out of
//           the evidence, so that their atoms become variables; everything else simplifies the network as usual. The
//           observed world is then read off the database again.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "grounding/ground.h"
#include "grounding/tuple_table.h"
#include "learning/weight_table.h"

namespace sherlog {

// The true atoms of a database, for look-ups.
class TrueAtoms {
 public:
  TrueAtoms(const Model& model, const Evidence& evidence);
  bool contains(PredicateId predicate, std::span<const ConstantIndex> arguments) const {
    return tables_[predicate.index()].find(arguments) != TupleTable::kNone;
  }

 private:
  std::vector<TupleTable> tables_;  // by predicate
};

// What makes a database unfit for learning: graded or unknown atoms, a '!' block without a value. Only predicates that
// formulas mention matter (by predicate). Empty where all is well; else a sentence about the first that has a problem.
std::string training_problem(const Model& model, std::span<const Evidence> databases,
                             const std::vector<bool>& mentioned);

// "database 3 of 50: " in front of a sentence about it; nothing where there is only one.
std::string which_database(std::size_t number, std::size_t count);

// By predicate: whether a formula mentions it.
std::vector<bool> mentioned_predicates(const Model& model);

struct ObservedNetwork {
  GroundNetwork network;
  std::vector<std::uint32_t> values;     // the observed world, by variable
  std::vector<std::uint32_t> weight_of;  // by the network's WeightId: number in the WeightTable
};

struct Observation {
  Termination termination = Termination::kCompleted;
  std::string message;                    // where not completed
  std::optional<ObservedNetwork> result;  // where completed
};

// `query`: atoms of open predicates that are asked for, as in ground().
// Errors: limits of grounding; kNoPossibleWorld where the database breaks a hard formula, with the ground formula.
Observation observe(const Model& model, const Evidence& evidence, const TrueAtoms& truth, const std::vector<bool>& open,
                    const Query& query, const WeightTable& weights, const GroundingOptions& limits, Monitor& monitor);

}  // namespace sherlog
