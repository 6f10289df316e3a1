// How well a model predicts databases that it was not trained on: k-fold cross-validation by database.
//
// Idea      The databases are dealt into folds. For each fold the weights are learned from all others; then all atoms of
//           the target predicate are unknown in the fold's databases, everything else is evidence, and the engine's
//           marginals are compared with what was stated. Counting is done once for all folds.
//           Priors can be chosen for each fold by a second cross-validation inside its training databases: the standard
//           deviation of each group of formulas is set, one group after the other, to the value of its grid with the
//           smallest log-loss there. Test databases have no part in that.
// Examples  A block of the target predicate ('!' or '?') is one example whose labels are its values (and "none"); an atom
//           of a predicate without a mark is an example with the labels "false" and "true".
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "inference/inference.h"
#include "learning/evaluation.h"
#include "learning/learn.h"

namespace sherlog {

// Formulas that share a prior, and the standard deviations to choose from. Until its turn comes a group has the first.
struct TuningGroup {
  std::vector<FormulaId> formulas;
  std::vector<double> stdevs;
};

struct CrossValidationOptions {
  PredicateId target;
  std::uint32_t folds = 5;
  std::uint64_t seed = 1;
  std::vector<std::uint32_t> fold_of;  // by database, 0-based; empty: dealt by the seed
  LearningOptions learning;            // .discriminative is set to the target where the method wants it
  InferenceOptions inference;
  std::vector<TuningGroup> tuning;
  std::string tuning_method;  // of the inner learning; empty: the same
  std::uint32_t tuning_folds = 4;
  std::uint32_t tuning_rounds = 1;  // through all groups
  // By fold, for its first tuning groups, as an earlier run with these folds chose them (FoldResult::stdevs): only the other
  // groups are searched.
  std::vector<std::vector<double>> chosen_stdevs;
};

struct FoldResult {
  std::uint32_t databases = 0, examples = 0;
  double train_seconds = 0.0, test_seconds = 0.0;
  double accuracy = 0.0, log_loss = 0.0;
  bool converged = false;
  std::vector<double> stdevs;  // chosen, by tuning group
};

struct CrossValidationResult {
  Termination termination = Termination::kCompleted;
  std::string message;
  std::string method;  // of learning
  std::vector<std::string> labels;
  std::vector<Prediction> predictions;  // in the order of the databases
  Evaluation evaluation;
  std::vector<FoldResult> folds;
  std::vector<std::string> warnings;
  double count_seconds = 0.0, seconds = 0.0;
};

// `databases` numbers into `folds` folds whose sizes differ by at most one.
std::vector<std::uint32_t> deal_folds(std::size_t databases, std::uint32_t folds, std::uint64_t seed);

// Errors: kRefused (bad options, unfit data, an empty fold), limits; what was found until then is handed over.
CrossValidationResult cross_validate(const Model& model, std::span<const Evidence> databases,
                                     const CrossValidationOptions& options, Monitor& monitor);

}  // namespace sherlog
