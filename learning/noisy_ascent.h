// Maximises a concave function of which nothing but sampled slopes is known.
//
// Idea      Along a line a concave function's slope only falls. So the slope alone tells whether a step went too far (it
//           points back), how far it should have gone (where the secant crosses zero), and that something was gained (as long
//           as it does not point back, a step has gone up): no values are needed. The directions are those of L-BFGS, with
//           the curvature that the caller knows along each axis as its first guess.
//           Sampled slopes are noisy. Let H be the curvature and n the number of draws behind a slope: as the slope is a
//           sum of counts, its noise has a covariance of at most H / n, and what seems to be left to gain, slope' H^-1
//           slope / 2, is d / (2 n) from noise alone (d: dimension). Where no more than a few times that is left, the second
//           part begins: short steps with H^-1 as it is known by then, in which the noise of many slopes averages out, and
//           the mean of the points is the result. A last slope there says whether it can be believed; if not, all of it
//           starts again from there.
//           Steps of slope over own variance, as usual in learning by MC-SAT, were tried and dropped: where counts are
//           correlated the curvature is a multiple of what each count knows of itself, and the steps swing to and fro (weights
//           of a coupled model 70 nats below the optimum, reported as converged).
// Source    Nocedal & Wright, Numerical Optimization, 2006, ch. 7 (L-BFGS); Polyak & Juditsky, SIAM J. Control 30, 1992
//           (averaging).
// Cost      of a step: one evaluation, rarely more.
#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <string>
#include <vector>

namespace sherlog {

struct SampledSlope {
  std::vector<double> slope;
  std::vector<double> curvature;                           // a guess of -d2f/dx2 along each axis, > 0
  double draws = std::numeric_limits<double>::infinity();  // effective number of draws behind it; infinity: exact
};

struct NoisyAscentOptions {
  std::uint32_t max_evaluations = 200;
  double slope_tolerance = 1e-6;  // largest entry; only exact slopes get there
};

struct NoisyAscentOutcome {
  std::vector<double> x;
  double slope_norm = 0.0;  // largest entry, at or near x
  std::uint32_t evaluations = 0;
  bool converged = false;
  bool cut_short = false;  // an evaluation returned false; x is the best so far
  std::string reason;      // why it ended, a sentence without full stop
};

// `evaluate(x, number, result)`: the slope at x; `number` differs from call to call (for seeds). False: the end.
using SlopeFunction = std::function<bool(const std::vector<double>& x, std::uint32_t number, SampledSlope& result)>;

NoisyAscentOutcome noisy_ascent(std::vector<double> start, const SlopeFunction& evaluate,
                                const NoisyAscentOptions& options);

}  // namespace sherlog
