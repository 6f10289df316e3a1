// How probable each pair of a one-to-one matching is, by sampling: for matchings too wide for matching_sum.h.
//
// Idea      A chain holds a matching. Each column in turn lets its row go and draws among the rows that are free and being alone;
//           then columns that want a row which another one holds offer their own for it (Metropolis-Hastings), since two that hold what
//           the other wants would have to be alone first. What is averaged is not the draw but the probabilities
//           it was drawn from (Rao-Blackwell), so that rare pairs are seen, too. Chains start from the best matching.
//           Errors come from batch means. 100 rows x 30 columns: 20,000 sweeps in 0.4 s.
// Source    Walker, ACM Trans. Math. Softw. 3, 1977 (drawing in constant time); Liu, Monte Carlo Strategies in Scientific Computing, 2001, sections 2.5.5 and 6; Geyer, Statistical Science 7, 1992.
// Random    Rng(seed, chain); threads do not change the answer
// Cost      a sweep O(rows x columns)
#pragma once

#include <span>
#include <vector>

#include "inference/inference.h"

namespace sherlog {

struct SampledMatching {
  // (rows + 1) x (columns + 1): of each pair; at the end of a row or column the probability that it is paired at all.
  std::vector<Marginal> paired;
  std::uint64_t samples = 0;  // in all chains; fewer than asked for where `stop` cut them short
};

// `log_weights`: rows x columns, row by row; minus infinity forbids a pair.
SampledMatching sample_matchings(std::span<const double> log_weights, std::size_t rows, std::size_t columns,
                                 const InferenceOptions& options, const StopCondition& stop);

}  // namespace sherlog
