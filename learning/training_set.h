// All training databases under one model, ready to be counted: the common first half of every method of learning.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "learning/learn.h"
#include "learning/observed_network.h"

namespace sherlog {

struct TrainingSet {
  Model model;                      // with all shared constants
  std::vector<Evidence> databases;  // of that model
  std::vector<bool> mentioned;      // by predicate: in a formula
  WeightTable weights;

  // By predicate: not declared closed (*P). What a method that explains the whole database explains.
  std::vector<bool> varying() const;

  TrainingSet(const Model& given, std::span<const Evidence> given_databases);
};

// By predicate: whether it is among these.
std::vector<bool> opened(const Model& model, std::span<const PredicateId> predicates);

// observe() with the time and memory that the options leave. `truth`: of that evidence.
Observation observe_within_limits(const TrainingSet& set, const Evidence& evidence, const TrueAtoms& truth,
                                  const std::vector<bool>& open, const LearningOptions& options,
                                  const StopCondition& stop);

// Where databases state no true atom of a predicate that is to be predicted: a sentence that says how many; else nothing.
std::string target_warning(const TrainingSet& set, PredicateId target);

// What came of work on all databases; the first problem in their order.
struct TrainingProblem {
  Termination termination = Termination::kCompleted;
  std::string message;
};

// Runs `work(database)` for all databases on `threads` threads, then `collect(database)` in their order on this one, a
// batch at a time so that only a batch's intermediate results are held.
TrainingProblem for_each_database(std::size_t count, std::uint32_t threads, const StopCondition& stop,
                                  std::string_view stage, const std::function<TrainingProblem(std::size_t)>& work,
                                  const std::function<void(std::size_t)>& collect);

}  // namespace sherlog
