// Matchers to compare the Markov logic models with: two simple ones, and an upper reference that knows the simulator.
#pragma once

#include <memory>

#include "perception_bridge/identity_belief.h"

namespace sherlog {

struct BaselineOptions {
  double sigma_color = 0.25;  // of the paper's similarity g, see grades.h
  double sigma_position = 0.25;
  double least_similarity = 0.05;  // pairs whose combined similarity is less are none; the best of a coarse search
};

// Each new cluster takes the old one with the largest similarity x proximity; where several want the same, the most similar
// has it and the others have appeared.
std::unique_ptr<Matcher> nearest_neighbour_matcher(const BaselineOptions& options = {});

// The matching with the largest sum of similarity x proximity.
std::unique_ptr<Matcher> hungarian_matcher(const BaselineOptions& options = {});

// Exact Bayesian matching with the simulator's own densities and frequencies: what can be known at all.
//
// Idea      Given what happened to it, an old object's place and colour now are distributed as the simulator draws them; how
//           often what happens to an object in so many actions is a small Markov chain (object_fates.h). A pair's
//           weight sums over what may have happened; objects that were nowhere at first are rows of their own.
//           The posterior over matchings is summed exactly (matching_sum.h). The one approximation: what happens to different
//           objects is taken to be independent, though the number of actions is fixed.
std::unique_ptr<Matcher> generative_matcher(const FourTablesConfig& config);

}  // namespace sherlog
