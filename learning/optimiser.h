// Maximises an objective plus a prior over the free weights.
//
// Idea      Smooth problems go to Ceres' gradient solver: L-BFGS with a Wolfe line search. With an L1 prior the
//           function has kinks where a weight is 0: orthant-wise L-BFGS stays in one orthant for each step, and many
//           weights end at exactly 0.
// Source    Nocedal & Wright, Numerical Optimization, 2006, ch. 7; Andrew & Gao, ICML 2007 (orthant-wise).
// Output    The best point that was evaluated, also where work was cut short.
#pragma once

#include <string>
#include <vector>

#include "learning/objective.h"
#include "learning/optimiser_options.h"
#include "learning/prior.h"

namespace sherlog {

struct OptimiserResult {
  std::vector<double> weights;
  double objective = 0.0;  // without the prior
  double objective_with_prior = 0.0;
  double gradient_norm = 0.0;  // largest entry, with prior, over the free weights
  std::uint32_t iterations = 0;
  bool converged = false;
  std::string reason;  // why it ended, a sentence without full stop
  Termination termination = Termination::kCompleted;
  std::vector<double> trace;  // objective with prior, by iteration
};

// `free`: weights that may move; the others stay at `start`. `priors`: one for each weight; they count for all weights
// that are free.
OptimiserResult maximise(Objective& objective, std::span<const double> start, const std::vector<bool>& free,
                         std::span<const Prior> priors, const OptimiserOptions& options, const StopCondition& stop);

}  // namespace sherlog
