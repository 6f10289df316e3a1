// Likelihood of models too wide for exact sums: expected counts by sampling, and diagonal Newton steps.
//
// Idea      The gradient of log P(open atoms | rest) is observed minus expected counts. Expected counts of components
//           that are narrow are exact, those of wide ones come from MC-SAT. They are noisy and the value itself is not
//           known, so there is no line search: each weight moves by its gradient over its own curvature, which is the
//           variance of its count, in steps that shrink, and the mean of the weights over the second half of the
//           iterations is the result.
//             w += a_t (n_obs - E[n] + prior') / (sum of p (1 - p) over its ground formulas + prior precision)
//             a_t = 1 / (1 + t / 10), no weight moving by more than 1 at once
// Source    Lowd & Domingos, PKDD 2007 (diagonal Newton); Polyak & Juditsky, SIAM J. Control 30, 1992 (averaging);
//           Poon & Domingos, AAAI 2006 (MC-SAT).
// Cost      of an iteration: inference on every database.
// Random    seed and iteration; the result does not depend on the number of threads.
#pragma once

#include "learning/methods.h"

namespace sherlog {

// The discriminative predicates given the rest.
PreparedOrProblem prepare_mcsat(const TrainingSet&, const LearningOptions&, bool separate, const StopCondition&);

}  // namespace sherlog
