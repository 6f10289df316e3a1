// Soft evidence read as "the posterior of this atom equals p" (Jeffrey's rule): finds a bias for each of those atoms.
//
// Idea      Of all distributions with the wanted marginals the one nearest to the model (in Kullback-Leibler divergence) is the
//           model with a bias added to each soft atom. The biases minimise the convex function
//             D(b) = log Z(b) - sum_i b_i p_i,      dD/db_i = P_b(atom i) - p_i.
//           With exact marginals: BFGS with backtracking. With sampled ones D is unknown and the gradient noisy: damped
//           steps of iterative proportional fitting, the later ones averaged. Where D has no minimum the wish cannot be met: a
//           bias runs away while its marginal stays off.
// Source    Jain & Beetz, KI 2010 (MC-SAT-PC); Deming & Stephan 1940 and Csiszar 1975 (iterative proportional fitting).
// Output    biases in the order of the targets, nats. met = false: `message` names the atom that cannot be met.
// Cost      tens of runs of the method underneath.
#pragma once

#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "grounding/network.h"
#include "mln/monitor.h"

namespace sherlog {

struct JeffreyEvaluation {
  Termination termination = Termination::kCompleted;
  std::vector<double> marginals;         // of the targets
  std::optional<double> log_partition;   // with it the marginals are exact, without they are estimates
};

struct JeffreyFit {
  bool met = false;
  Termination termination = Termination::kCompleted;  // of the evaluation that ended the search, where one did
  std::string message;
  std::vector<double> biases;
};

JeffreyFit fit_jeffrey(const GroundNetwork& network, std::span<const SoftTarget> targets,
                       const std::function<JeffreyEvaluation(std::span<const double> biases)>& evaluate);

}  // namespace sherlog
