// Minimises f(x) + sum l1_i |x_i| for a smooth convex f: orthant-wise limited-memory quasi-Newton (OWL-QN).
//
// Idea      Within one orthant the sum is linear. Each step takes the pseudo-gradient (the steepest of the one-sided
//           slopes), multiplies it with the L-BFGS approximation of f's inverse curvature, keeps of the direction only
//           what goes downhill, and projects every trial point back to the orthant: a weight that would change its sign
//           stops at 0.
// Source    Andrew & Gao, ICML 2007.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

namespace sherlog {

// The slope of the penalised objective (to be maximised) that matters at w: 0 where no move improves it.
double l1_slope(double slope, double w, double l1);

struct OrthantWiseOutcome {
  bool converged = false;
  std::string reason;
};

// `evaluate(x, f, gradient of f)`: false where it failed, which ends the search. `go_on(iteration, value)`: false to end.
OrthantWiseOutcome minimise_orthant_wise(
    std::vector<double>& x, const std::vector<double>& l1, std::uint32_t max_iterations, double gradient_tolerance,
    double function_tolerance,
    const std::function<bool(const std::vector<double>&, double&, std::vector<double>&)>& evaluate,
    const std::function<bool(std::uint32_t, double)>& go_on);

}  // namespace sherlog
