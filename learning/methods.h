// The methods of learning: each makes an objective from a training set. To add one: its files, and its line in
// methods.cpp.
#pragma once

#include <memory>

#include "learning/objective.h"
#include "learning/training_set.h"

namespace sherlog {

struct ObjectiveOrProblem {
  std::unique_ptr<Objective> objective;
  TrainingProblem problem;
};

struct LearningMethod {
  LearningMethodInfo info;
  ObjectiveOrProblem (*make)(const TrainingSet&, const LearningOptions&, const StopCondition&);
};

std::span<const LearningMethod> learning_method_table();

// pll and dpll: one term for each variable of the mentioned / discriminative predicates.
ObjectiveOrProblem make_pll(const TrainingSet& set, const LearningOptions& options, const StopCondition& stop);
ObjectiveOrProblem make_dpll(const TrainingSet& set, const LearningOptions& options, const StopCondition& stop);
// bpll: atoms of predicates of one block with the same unmarked arguments are one variable.
ObjectiveOrProblem make_bpll(const TrainingSet& set, const LearningOptions& options, const StopCondition& stop);

// cll: the discriminative predicates given the rest; ll: everything. Exact.
ObjectiveOrProblem make_cll(const TrainingSet& set, const LearningOptions& options, const StopCondition& stop);
ObjectiveOrProblem make_ll(const TrainingSet& set, const LearningOptions& options, const StopCondition& stop);

}  // namespace sherlog
