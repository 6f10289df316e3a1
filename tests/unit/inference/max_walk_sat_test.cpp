#include "inference/max_walk_sat.h"

#include <gtest/gtest.h>

#include <random>
#include <vector>

#include "tests/oracles/enumeration.h"

namespace sherlog {
namespace {

LocalOptimum search(const GroundNetwork& network, std::uint64_t flips, std::uint32_t threads = 1) {
  Monitor monitor;
  const StopCondition stop(monitor);
  MaxWalkSatOptions options;
  options.flips = flips;
  options.threads = threads;
  return max_walk_sat(network, options, stop);
}

TEST(MaxWalkSat, FindsTheBestOfSmallRandomNetworks) {
  std::mt19937_64 random(17);
  int missed = 0, possible = 0;
  for (int i = 0; i < 60; ++i) {
    const GroundNetwork network = oracle::random_network(random);
    const auto truth = oracle::enumerate(network);
    const LocalOptimum found = search(network, 5000);
    EXPECT_EQ(found.broken == 0, oracle::score(network, found.values).has_value());
    if (!truth.possible) continue;
    ++possible;
    const auto score = oracle::score(network, found.values);
    if (!score || *score < truth.best_score - 1e-9) ++missed;
    if (!score) continue;
    EXPECT_NEAR(*score - network.constant_score(), found.score, 1e-9);
  }
  EXPECT_GT(possible, 30);
  EXPECT_EQ(missed, 0);
}

TEST(MaxWalkSat, MovesBlocksAsAWhole) {
  // Eight blocks of eight values, all different (hard): a permutation, which is worth 1 for each block on its own number.
  NetworkBuilder builder;
  const WeightId weight = builder.add_weight({FormulaId(0), {}, 1.0});
  constexpr std::uint32_t n = 8;
  std::vector<std::uint32_t> first;
  for (std::uint32_t b = 0; b < n; ++b) first.push_back(builder.first_atom(builder.add_anonymous(n, false)).value);
  for (std::uint32_t b = 0; b < n; ++b) {
    builder.add_feature(Literal::atom(AtomId(first[b] + b)), 1.0, weight);
    for (std::uint32_t c = b + 1; c < n; ++c) {
      for (std::uint32_t value = 0; value < n; ++value) {
        std::vector<Literal> inputs{Literal::atom(AtomId(first[b] + value), true),
                                    Literal::atom(AtomId(first[c] + value), true)};
        builder.add_constraint(builder.make_or(inputs), FormulaId(0));
      }
    }
  }
  const GroundNetwork network = builder.build();
  const LocalOptimum found = search(network, 100000);
  EXPECT_EQ(found.broken, 0u);
  EXPECT_DOUBLE_EQ(found.score, 8.0);
}

TEST(MaxWalkSat, IsTheSameForAnyNumberOfThreads) {
  std::mt19937_64 random(4);
  oracle::RandomNetworkOptions shape;
  shape.variables = 60;
  shape.features = 200;
  const GroundNetwork network = oracle::random_network(random, shape);
  EXPECT_EQ(search(network, 3000, 1).values, search(network, 3000, 3).values);
}

TEST(MaxWalkSat, DescentNeverEndsWorseThanItsStart) {
  std::mt19937_64 random(8);
  Monitor monitor;
  const StopCondition stop(monitor);
  for (int i = 0; i < 30; ++i) {
    const GroundNetwork network = oracle::random_network(random);
    std::vector<std::uint32_t> start;
    for (std::size_t v = 0; v < network.variable_count(); ++v) {
      start.push_back(static_cast<std::uint32_t>(random() % network.value_count(VariableId(v))));
    }
    const auto before = oracle::score(network, start);
    const LocalOptimum after = descend(network, start, stop);
    if (!before) continue;
    ASSERT_EQ(after.broken, 0u);
    EXPECT_GE(after.score + network.constant_score(), *before - 1e-9);
  }
}

}  // namespace
}  // namespace sherlog
