// Model + training databases to weights: the one entry point of learning, its options and what it returns.
//
// Training data is closed world: what a database does not state is false. Domains that the model declares with values,
// that a + ranges over or that stand at a marked argument are shared by all databases; all others are each database's
// own. The objective of several databases is their sum.
#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "learning/optimiser_options.h"
#include "learning/prior.h"
#include "learning/weight_table.h"
#include "mln/evidence.h"
#include "mln/model.h"
#include "mln/monitor.h"

namespace sherlog {

struct LearningOptions {
  std::string method = "pll";                    // a name of learning_methods()
  std::vector<PredicateId> discriminative;       // dpll, cll, mcsat: what is to be predicted
  std::vector<std::vector<PredicateId>> blocks;  // bpll: predicates whose atoms of equal arguments are one variable
  Prior prior;                                   // for every weight ...
  std::vector<std::pair<FormulaId, Prior>> formula_priors;  // ... but those of these formulas
  OptimiserOptions optimiser;
  bool standard_errors = false;  // from the second derivatives at the end: cubic in the weights
  // cll, ll: share of a component's sum that a bounded search may leave out, where it is too wide for elimination.
  double search_gap = 1e-3;
  std::uint64_t seed = 1;            // mcsat
  std::uint32_t samples = 1000;      // mcsat: kept draws an iteration
  std::string expectation = "auto";  // mcsat: the method of inference that counts; auto: sums what is narrow
  std::uint32_t threads = 0;         // 0: as many as the machine has; the result does not depend on it
  double max_seconds = std::numeric_limits<double>::infinity();
  std::size_t max_memory = std::numeric_limits<std::size_t>::max();
};

struct LearnedWeight {
  double weight = 0.0;
  std::optional<double> standard_error;
  bool fixed = false;
  bool shared = false;     // the data cannot tell it from another weight's, see LearningResult::warnings
  bool identified = true;  // false: no choice of it changes what the data says; it has its prior mean, or what it had
};

struct LearningResult {
  std::string method;
  Termination termination = Termination::kCompleted;
  std::string message;              // where not completed: a sentence
  std::optional<double> objective;  // nats, without the prior
  std::optional<double> objective_with_prior;
  bool converged = false;
  std::string reason;  // why it ended
  std::uint32_t iterations = 0;
  std::optional<double> gradient_norm;  // largest entry, with the prior
  std::vector<double> trace;            // objective with prior, by iteration
  std::vector<LearnedWeight> weights;   // one for each soft formula after expansion, in model order; empty where
                                        // nothing was learned
  std::vector<std::string> warnings;
  // The training model: the given one with all shared constants. `weights` are numbered by WeightTable(*model).
  std::optional<Model> model;
  struct Seconds {
    double count = 0.0, optimise = 0.0, total = 0.0;
  } seconds;
  std::size_t databases = 0;
  LearningOptions options;
};

// Errors: kRefused (bad option, unfit data), kNoPossibleWorld (a database breaks a hard formula), limits, kInterrupted
// (then `weights` are the best so far, if there are any). The inputs are not changed.
LearningResult learn(const Model& model, std::span<const Evidence> databases, const LearningOptions& options,
                     Monitor& monitor);

// A bad option is answered with its name, its value and the bound that it broke; empty where all are good.
std::string validate(const LearningOptions& options);

struct LearningMethodInfo {
  const char* name;
  const char* summary;
  bool discriminative;  // wants LearningOptions::discriminative
};
std::span<const LearningMethodInfo> learning_methods();

}  // namespace sherlog
