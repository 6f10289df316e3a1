// The slow twin of every method: all worlds of a ground network, one after the other, in log space.
#pragma once

#include <cstdint>
#include <optional>
#include <random>
#include <vector>

#include "grounding/network.h"

namespace sherlog::oracle {

struct Enumeration {
  bool possible = false;               // some world meets all constraints
  double log_partition = 0.0;          // constant_score and free_log_count included
  double best_score = 0.0;             // of a most probable world, constant_score included
  std::vector<double> marginals;       // by query
  std::vector<double> atom_marginals;  // by atom
  double worlds = 0;
};

// True value of the literal in the world (values by variable), by recursion over the gates.
bool evaluate(const GroundNetwork& network, Literal literal, const std::vector<std::uint32_t>& values);
// Sum of the features, constant_score included; nothing where a constraint is broken.
std::optional<double> score(const GroundNetwork& network, const std::vector<std::uint32_t>& values);
Enumeration enumerate(const GroundNetwork& network);

struct RandomNetworkOptions {
  std::uint32_t variables = 8;
  std::uint32_t features = 12;
  std::uint32_t constraints = 3;
  double block_share = 0.3;  // of the variables are blocks with 2 to 4 candidates
  double weight = 2.0;       // largest absolute weight
  std::uint32_t max_inputs = 4;
};
// Nested random formulas as features, hard clauses as constraints, every atom and two formulas queried.
GroundNetwork random_network(std::mt19937_64& random, const RandomNetworkOptions& options = {});

}  // namespace sherlog::oracle
