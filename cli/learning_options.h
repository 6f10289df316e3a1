// The options of learning, shared by the commands that learn.
#pragma once

#include <CLI/CLI.hpp>
#include <optional>
#include <string>
#include <vector>

#include "cli/session.h"
#include "learning/learn.h"

namespace sherlog::cli {

struct LearningArguments {
  std::vector<std::string> training;  // files
  std::string method = "pll";
  std::vector<std::string> discriminative, blocks, formula_stdevs;
  double prior_mean = 0.0, prior_l1 = 0.0;
  std::string prior_stdev = "10";
  std::uint32_t max_iterations = OptimiserOptions{}.max_iterations;
  double tolerance = OptimiserOptions{}.gradient_tolerance;
  std::uint32_t samples = LearningOptions{}.samples;
  double search_gap = LearningOptions{}.search_gap;
  bool standard_errors = false;
};

void add_training_options(CLI::App& command, LearningArguments& arguments, Options& options);
void add_learning_options(CLI::App& command, LearningArguments& arguments);

// All databases of all files, in order; or nothing after printing what is wrong.
std::optional<std::vector<Evidence>> read_training(Session& session, const Model& model,
                                                   const LearningArguments& arguments);
// Names resolved against the model; or nothing after printing what is wrong.
std::optional<LearningOptions> learning_options(Session& session, const Model& model,
                                                const LearningArguments& arguments);
// The predicate, or nothing after an error that suggests a name.
std::optional<PredicateId> find_predicate(Session& session, const Model& model, const std::string& option,
                                          const std::string& name);

}  // namespace sherlog::cli
