#include "inference/map.h"

#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "tests/oracles/enumeration.h"
#include "tests/support/networks.h"

namespace sherlog {
namespace {

MethodResult run(const GroundNetwork& network, const InferenceOptions& options = {}, std::span<const double> bias = {},
                 double max_seconds = std::numeric_limits<double>::infinity()) {
  Monitor monitor;
  const StopCondition stop(monitor, max_seconds);
  const auto components = all_components(network);
  return run_map({network, components, options, stop, bias});
}

Literal clause(NetworkBuilder& builder, std::vector<Literal> inputs) { return builder.make_or(inputs); }

// Friends' smoking habits tend to agree; smoking leads to cancer; neither is likely by itself.
GroundNetwork smokers(std::uint32_t people, std::mt19937_64& random) {
  NetworkBuilder builder;
  const WeightId weight = builder.add_weight({FormulaId(0), {}, 1.0});
  std::vector<Literal> smokes, cancer;
  for (std::uint32_t p = 0; p < people; ++p) {
    smokes.push_back(Literal::atom(builder.first_atom(builder.add_boolean())));
    cancer.push_back(Literal::atom(builder.first_atom(builder.add_boolean())));
  }
  for (std::uint32_t p = 0; p < people; ++p) {
    builder.add_feature(clause(builder, {~smokes[p], cancer[p]}), 1.5, weight);
    builder.add_feature(~smokes[p], random() % 3 == 0 ? -2.0 : 1.0, weight);
    builder.add_feature(~cancer[p], 1.0, weight);
    for (int k = 0; k < 3; ++k) {
      const std::size_t friend_of = random() % people;
      if (friend_of == p) continue;
      builder.add_feature(clause(builder, {~smokes[p], smokes[friend_of]}), 1.1, weight);
      builder.add_feature(clause(builder, {smokes[p], ~smokes[friend_of]}), 1.1, weight);
    }
  }
  return builder.build();
}

TEST(Map, ProvesManySmokersWhereTheGraphIsWide) {
  std::mt19937_64 random(5);
  const GroundNetwork network = smokers(1500, random);
  const MethodResult result = run(network);
  EXPECT_EQ(result.termination, Termination::kCompleted);
  EXPECT_EQ(result.map_score, result.map_bound);
  EXPECT_NEAR(oracle::score(network, result.values).value() - network.constant_score(), result.map_score, 1e-6);
}

TEST(Map, SolvesAMatchingByItsRelaxation) {
  // One-to-one between n rows and n columns, cell (i, (3 i + 1) mod n) is worth 2, every other 1: the best is 2 n (n = 14, where
  // 3 is a unit modulo 14, so the good cells are a permutation).
  constexpr std::uint32_t n = 14;
  NetworkBuilder builder;
  const WeightId weight = builder.add_weight({FormulaId(0), {}, 1.0});
  std::vector<std::vector<Literal>> cell(n);
  for (std::uint32_t i = 0; i < n; ++i) {
    for (std::uint32_t j = 0; j < n; ++j) {
      cell[i].push_back(Literal::atom(builder.first_atom(builder.add_boolean())));
      builder.add_feature(cell[i][j], j == (3 * i + 1) % n ? 2.0 : 1.0, weight);
    }
  }
  for (std::uint32_t i = 0; i < n; ++i) {
    for (std::uint32_t j = 0; j < n; ++j) {
      for (std::uint32_t k = j + 1; k < n; ++k) {
        builder.add_constraint(clause(builder, {~cell[i][j], ~cell[i][k]}), FormulaId(0));
        builder.add_constraint(clause(builder, {~cell[j][i], ~cell[k][i]}), FormulaId(0));
      }
    }
  }
  const GroundNetwork network = builder.build();
  const MethodResult result = run(network);
  EXPECT_EQ(result.termination, Termination::kCompleted);
  EXPECT_NEAR(result.map_score, 2.0 * n, 1e-9);
  EXPECT_EQ(result.map_score, result.map_bound);
}

TEST(Map, AnswersTenThousandTinyComponentsInOneGo) {
  // a and b want to differ (1), a wants to be true (0.5), so each pair scores 1.5 - and a third atom that is told to equal b
  // by a hard formula wants to be true by 0.25, which is not worth it.
  NetworkBuilder builder;
  const WeightId weight = builder.add_weight({FormulaId(0), {}, 1.0});
  constexpr int kPairs = 10000;
  for (int i = 0; i < kPairs; ++i) {
    const Literal a = Literal::atom(builder.first_atom(builder.add_boolean()));
    const Literal b = Literal::atom(builder.first_atom(builder.add_boolean()));
    const Literal c = Literal::atom(builder.first_atom(builder.add_boolean()));
    builder.add_feature(builder.make_iff(a, ~b), 1.0, weight);
    builder.add_feature(a, 0.5, weight);
    builder.add_feature(c, 0.25, weight);
    builder.add_constraint(builder.make_iff(b, c), FormulaId(0));
  }
  const GroundNetwork network = builder.build();
  const MethodResult result = run(network);
  EXPECT_EQ(result.termination, Termination::kCompleted);
  EXPECT_NEAR(network.constant_score() + result.map_score, 1.5 * kPairs, 1e-6);
  EXPECT_EQ(result.map_score, result.map_bound);
}

TEST(Map, NamesAConflictWhereNoWorldIsPossible) {
  // Three pigeons, two holes.
  NetworkBuilder builder;
  std::vector<std::vector<Literal>> in(3);
  for (auto& pigeon : in) {
    for (int hole = 0; hole < 2; ++hole) pigeon.push_back(Literal::atom(builder.first_atom(builder.add_boolean())));
    builder.add_constraint(clause(builder, {pigeon[0], pigeon[1]}), FormulaId(0));
  }
  for (std::size_t p = 0; p < 3; ++p) {
    for (std::size_t q = p + 1; q < 3; ++q) {
      for (std::size_t hole = 0; hole < 2; ++hole)
        builder.add_constraint(clause(builder, {~in[p][hole], ~in[q][hole]}), FormulaId(1));
    }
  }
  const GroundNetwork network = builder.build();
  const MethodResult result = run(network);
  EXPECT_EQ(result.termination, Termination::kNoPossibleWorld);
  EXPECT_FALSE(result.conflict.empty());
}

TEST(Map, AddsTheAtomBias) {
  NetworkBuilder builder;
  const WeightId weight = builder.add_weight({FormulaId(0), {}, 1.0});
  const VariableId a = builder.add_boolean(), block = builder.add_anonymous(3, false);
  builder.add_feature(Literal::atom(builder.first_atom(a)), -1.0, weight);
  builder.add_feature(Literal::atom(builder.first_atom(block)), 1.0, weight);
  const GroundNetwork network = builder.build();
  const std::vector<double> bias{1.5, 0.0, 0.0, 1.75};
  const MethodResult result = run(network, {}, bias);
  EXPECT_EQ(result.values, (std::vector<std::uint32_t>{0, 2}));
  EXPECT_DOUBLE_EQ(result.map_score, 0.5 + 1.75);
  EXPECT_DOUBLE_EQ(result.map_bound, 0.5 + 1.75);
}

TEST(Map, AnEmptyNetworkScoresNothing) {
  NetworkBuilder builder;
  const GroundNetwork network = builder.build();
  const MethodResult result = run(network);
  EXPECT_EQ(result.termination, Termination::kCompleted);
  EXPECT_EQ(result.map_score, 0.0);
  EXPECT_EQ(result.map_bound, 0.0);
}

// Random weights on clauses of three: nothing but search helps.
GroundNetwork random_clauses(std::uint32_t atoms, std::uint32_t clauses, std::mt19937_64& random) {
  NetworkBuilder builder;
  const WeightId weight = builder.add_weight({FormulaId(0), {}, 1.0});
  for (std::uint32_t a = 0; a < atoms; ++a) builder.add_boolean();
  std::uniform_real_distribution<double> uniform(0.1, 2.0);
  for (std::uint32_t c = 0; c < clauses; ++c) {
    std::vector<Literal> inputs;
    for (int i = 0; i < 3; ++i) inputs.push_back(Literal::atom(AtomId(random() % atoms), random() % 2 == 0));
    builder.add_feature(builder.make_or(inputs), uniform(random), weight);
  }
  return builder.build();
}

TEST(Map, KeepsToItsTimeLimitAndHandsOverABoundedWorld) {
  std::mt19937_64 random(2);
  const GroundNetwork network = random_clauses(3000, 13000, random);
  const auto start = std::chrono::steady_clock::now();
  const MethodResult result = run(network, {}, {}, 0.3);
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  EXPECT_LT(seconds, 3.0);  // generous: machines are shared
  EXPECT_EQ(result.termination, Termination::kTimeLimit);
  ASSERT_EQ(result.values.size(), network.variable_count());
  EXPECT_NEAR(oracle::score(network, result.values).value() - network.constant_score(), result.map_score, 1e-6);
  EXPECT_GT(result.map_bound, result.map_score);
  EXPECT_TRUE(std::isfinite(result.map_bound));
}

TEST(Map, GivesTheSameWorldForAnyNumberOfThreads) {
  std::mt19937_64 random(3);
  const GroundNetwork network = random_clauses(60, 250, random);
  InferenceOptions options;
  options.flips = 20000;
  options.threads = 1;
  const MethodResult one = run(network, options);
  options.threads = 3;
  EXPECT_EQ(run(network, options).values, one.values);
}

}  // namespace
}  // namespace sherlog
