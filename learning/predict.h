// The target predicate's marginals in a database under learned weights, as examples for an evaluation.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "inference/inference.h"
#include "learning/evaluation.h"
#include "learning/observed_network.h"
#include "learning/training_set.h"

namespace sherlog {

// A database grounded once with the target unknown.
struct PredictionTask {
  struct Example {
    std::string name;
    std::uint32_t truth = 0;             // label
    std::vector<std::uint32_t> queries;  // by label: query of the network; kNone: not among them
    std::vector<double> given;           // by label: probability where it has no query
  };
  static constexpr std::uint32_t kNone = 0xffffffffu;
  ObservedNetwork observed;
  std::vector<Example> examples;
  std::uint32_t database = 0;
  bool boolean = false, has_none = false;  // the target's kind
};

// Labels of a predicate's examples: values of its marked arguments (and "none" for '?'), or "false" and "true".
std::vector<std::string> target_labels(const Model& model, PredicateId target);

struct TaskOrProblem {
  std::optional<PredictionTask> task;
  TrainingProblem problem;
};
// Requires  the marked arguments' domains are shared (mln/shared_domains.h).
TaskOrProblem make_prediction_task(const TrainingSet& set, std::uint32_t database, PredicateId target,
                                   const GroundingOptions& limits, Monitor& monitor);

// Appends one Prediction for each example. `weights`: by weight of the set's table.
TrainingProblem predict(const PredictionTask& task, std::span<const double> weights, const InferenceOptions& options,
                        Monitor& monitor, std::vector<Prediction>& predictions);

}  // namespace sherlog
