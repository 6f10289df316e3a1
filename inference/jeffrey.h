// Soft evidence read as "the posterior of this atom equals p" (Jeffrey's rule): finds a bias for each of those atoms.
//
// Idea      Of all distributions with the wanted marginals the one nearest to the model (in Kullback-Leibler divergence)
//           is the model with a bias added to each soft atom. The biases minimise the convex function
//             D(b) = log Z(b) - sum_i b_i p_i,      dD/db_i = P_b(atom i) - p_i.
//           With exact marginals: BFGS with backtracking. With sampled ones D is unknown and the gradient noisy: each
//           target takes steps of iterative proportional fitting of its own length, which shrinks where its error changes
//           sign and grows where it keeps it; later biases are averaged.
//           A wish is refused only where it is shown that nothing can meet it: for some direction d no possible world x has
//           d . x as large as d . p. The biases of a hopeless search run away in such a direction, and the error that
//           stays is another; `largest` says how large d . x can be.
// Source    Jain & Beetz, KI 2010 (MC-SAT-PC); Deming & Stephan 1940 and Csiszar 1975 (iterative proportional fitting);
//           Kesten, Ann. Math. Stat. 29, 1958 (steps by changes of sign); Polyak & Juditsky 1992 (averaging).
// Output    biases in the order of the targets, nats. met = false: `message` names the atom that cannot be met. Where the
//           targets were neither met within the tolerance nor shown to be impossible, `warning` says how near they came.
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
  std::vector<double> marginals;        // of the targets
  std::optional<double> log_partition;  // with it the marginals are exact, without they are estimates
  std::vector<double> standard_errors;  // of estimates, where they are known
};

struct JeffreyFit {
  bool met = false;
  Termination termination = Termination::kCompleted;  // of the evaluation that ended the search, where one did
  std::string message;
  std::string warning;
  std::vector<double> biases;
};

// What is asked about the network. Estimates take `share` of the draws of the final answer; `round` numbers them, so that they
// can differ in their noise.
struct JeffreyModel {
  std::function<JeffreyEvaluation(std::span<const double> biases, std::uint32_t round, double share)> evaluate;
  // An upper bound of sum_i d_i x_i over the possible worlds, x_i the truth of target i; infinity where none is known.
  std::function<double(std::span<const double> direction)> largest;
};

JeffreyFit fit_jeffrey(const GroundNetwork& network, std::span<const SoftTarget> targets, const JeffreyModel& model);

}  // namespace sherlog
