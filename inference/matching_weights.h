// The weights of a matching seen in a component: what its small clusters sum to, or at best score.
//
// Idea      Each cluster of matching_structure.h is enumerated once for each state of its pair or row: off, or one of the values
//           that can be on. Relative to everything being off, a pair weighs the sum over its on-values of cluster x state of its row x state
//           of its column; for a most probable world, the largest of these. What hard formulas force (a pair that must be on, a
//           row that must not be empty) gets kForced nats more than anything else could.
// Errors    kNoPossibleWorld where a cluster has none; kRefused where weights could compete with kForced
// Cost      linear in the joint values of the clusters
#pragma once

#include <cstdint>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "inference/inference.h"
#include "inference/matching_structure.h"

namespace sherlog {

inline constexpr double kForced = 0x1p20;  // nats

// One cluster with its pair or row in one state.
struct ClusterState {
  double log_weight = -std::numeric_limits<double>::infinity();  // log of the sum, or the maximum
  std::vector<double> probability;                               // sums: by query of the cluster
  std::vector<std::uint32_t> best;                               // maxima: by variable of the cluster
};
// State 0 is off. Of a cell the others are its on-values, counted from 1; of a row, MatchingGroup::states.
using ClusterStates = std::vector<ClusterState>;

// The component as a weighted bipartite matching.
struct WeightedMatching {
  Termination termination = Termination::kCompleted;
  std::string message;
  std::vector<ClusterStates> states;              // by cluster
  double log_base = 0.0;                          // everything off
  std::vector<double> log_weights;                // rows x columns
  std::vector<std::vector<double>> value_weight;  // by cell and on-value: what log_weights sums, or maximises
  std::size_t forced = 0;                         // each adds kForced to every matching that is possible
};

// `maximise`: weights of best values instead of sums. `atom_bias`: added to the score where the atom is true, or empty.
WeightedMatching weigh_matching(const GroundNetwork& network, const MatchingStructure& structure,
                                std::span<const double> atom_bias, bool maximise);

}  // namespace sherlog
