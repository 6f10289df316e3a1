// The methods of learning: each makes an objective from a training set. To add one: its files, and its line in
// methods.cpp.
#pragma once

#include <memory>
#include <optional>

#include "learning/objective.h"
#include "learning/optimiser.h"
#include "learning/training_set.h"

namespace sherlog {

// Where the optimiser starts, by weight: the model's weights; what the data says nothing about is at its prior's mode.
struct StartingPoint {
  std::vector<double> weights;
  std::vector<bool> free;
  std::vector<Prior> priors;
};

// The training databases counted once; an objective for some of them is then cheap.
class PreparedData {
 public:
  virtual ~PreparedData() = default;
  // Numbers of databases; where they were not kept separate: all or nothing. The PreparedData outlives the objective.
  virtual std::unique_ptr<Objective> objective(std::span<const std::uint32_t> databases) = 0;
  // Where an optimum of the objective is hard to reach from afar: another objective whose optimum is near it; else null.
  virtual std::unique_ptr<Objective> nearby(std::span<const std::uint32_t>) { return nullptr; }
  // Where the objective has no value to be compared: a search of its own. Its result has no finite objective.
  virtual std::optional<OptimiserResult> search(std::span<const std::uint32_t>, const StartingPoint&,
                                                const OptimiserOptions&, const StopCondition&) {
    return std::nullopt;
  }
};

struct PreparedOrProblem {
  std::unique_ptr<PreparedData> data;
  TrainingProblem problem;
};

// `separate`: keep the databases apart, for cross-validation; else their common counts are all that is held.
struct LearningMethod {
  LearningMethodInfo info;
  PreparedOrProblem (*prepare)(const TrainingSet&, const LearningOptions&, bool separate, const StopCondition&);
};

std::span<const LearningMethod> learning_method_table();
const LearningMethod* find_learning_method(std::string_view name);

StartingPoint starting_point(const TrainingSet& set, const LearningOptions& options, const Objective& objective);

// From the starting point by way of the nearby objective, where there is one.
OptimiserResult maximise(PreparedData& data, std::span<const std::uint32_t> databases, Objective& objective,
                         const StartingPoint& start, const OptimiserOptions& options, const StopCondition& stop);

// pll and dpll: one term for each variable of the mentioned / discriminative predicates.
PreparedOrProblem prepare_pll(const TrainingSet&, const LearningOptions&, bool separate, const StopCondition&);
PreparedOrProblem prepare_dpll(const TrainingSet&, const LearningOptions&, bool separate, const StopCondition&);
// bpll: atoms of predicates of one block with the same unmarked arguments are one variable.
PreparedOrProblem prepare_bpll(const TrainingSet&, const LearningOptions&, bool separate, const StopCondition&);
// cll: the discriminative predicates given the rest; ll: everything. Exact.
PreparedOrProblem prepare_cll(const TrainingSet&, const LearningOptions&, bool separate, const StopCondition&);
PreparedOrProblem prepare_ll(const TrainingSet&, const LearningOptions&, bool separate, const StopCondition&);

}  // namespace sherlog
