// Likelihood of models too wide for exact sums: expected counts by sampling.
//
// Idea      The gradient of log P(open atoms | rest) is observed minus expected counts. Expected counts of components
//           that are narrow are exact, those of wide ones come from MC-SAT. They are noisy and the value itself is not
//           known: noisy_ascent.h does without. Its first guess of the curvature of a weight is the variance of its
//           count as if its ground formulas were independent, the sum of p (1 - p), plus the prior's precision.
//           A weight whose formula hard formulas decide counts as identified here; it stays at its prior all the same.
// Source    Lowd & Domingos, PKDD 2007 (learning by MC-SAT); Poon & Domingos, AAAI 2006 (MC-SAT).
// Cost      of an iteration: inference on every database.
// Random    seed and iteration; the result does not depend on the number of threads.
#pragma once

#include "learning/methods.h"

namespace sherlog {

// The discriminative predicates given the rest.
PreparedOrProblem prepare_mcsat(const TrainingSet&, const LearningOptions&, bool separate, const StopCondition&);

}  // namespace sherlog
