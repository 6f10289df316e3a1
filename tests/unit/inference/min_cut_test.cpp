#include "inference/min_cut.h"

#include <gtest/gtest.h>

#include <random>
#include <vector>

#include "tests/oracles/enumeration.h"

namespace sherlog {
namespace {

MinCutResult cut(const GroundNetwork& network) {
  Monitor monitor;
  return min_cut(network, StopCondition(monitor));
}

Literal atom(std::uint32_t i, bool negated = false) { return Literal::atom(AtomId(i), negated); }

// Features over two atoms each; `agree`: all of them want their atoms equal, after a hidden half of the atoms is turned round.
GroundNetwork pairs(std::mt19937_64& random, std::uint32_t atoms, std::uint32_t features, bool agree) {
  NetworkBuilder builder;
  const WeightId weight = builder.add_weight({FormulaId(0), {}, 1.0});
  std::vector<bool> turned;
  for (std::uint32_t a = 0; a < atoms; ++a) {
    builder.add_boolean();
    turned.push_back(random() % 2 == 0);
  }
  std::uniform_real_distribution<double> uniform(-2.0, 2.0);
  for (std::uint32_t a = 0; a < atoms; ++a) builder.add_feature(atom(a), uniform(random), weight);
  for (std::uint32_t f = 0; f < features; ++f) {
    const auto a = static_cast<std::uint32_t>(random() % atoms), b = static_cast<std::uint32_t>(random() % atoms);
    if (a == b) continue;
    if (agree) {
      std::vector<Literal> inputs{atom(a, !turned[a]), atom(b, turned[b])};  // a => b, of the turned ones
      builder.add_feature(builder.make_or(inputs), std::abs(uniform(random)), weight);
    } else {
      std::vector<Literal> inputs{atom(a, random() % 2 == 0), atom(b, random() % 2 == 0)};
      builder.add_feature(random() % 3 == 0 ? builder.make_iff(inputs[0], inputs[1]) : builder.make_or(inputs),
                          uniform(random), weight);
    }
  }
  return builder.build();
}

TEST(FlowGraph, FindsTheFlowOfATextbookGraph) {
  // s = 0, t = 3: 0-1 (3), 0-2 (2), 1-2 (1), 1-3 (2), 2-3 (3): 2 through 1-3, 1 through 1-2-3, 2 through 2-3.
  FlowGraph graph(4);
  graph.add_arc(0, 1, 3);
  graph.add_arc(0, 2, 2);
  graph.add_arc(1, 2, 1);
  graph.add_arc(1, 3, 2);
  graph.add_arc(2, 3, 3);
  Monitor monitor;
  ASSERT_TRUE(graph.solve(0, 3, StopCondition(monitor)));
  EXPECT_EQ(graph.flow(), 5);
  EXPECT_TRUE(graph.reachable(0));
  EXPECT_FALSE(graph.reachable(3));
}

TEST(MinCut, ProvesPairsThatAgreeAfterTurning) {
  std::mt19937_64 random(11);
  for (int i = 0; i < 60; ++i) {
    const GroundNetwork network = pairs(random, 9, 16, true);
    const auto truth = oracle::enumerate(network);
    const MinCutResult result = cut(network);
    ASSERT_EQ(result.status, MinCutStatus::kOptimal);
    EXPECT_NEAR(oracle::score(network, result.values).value(), truth.best_score, 1e-9);
    EXPECT_NEAR(result.bound + network.constant_score(), truth.best_score, 1e-6);
  }
}

TEST(MinCut, RoofDualityKeepsABestWorldAndBoundsIt) {
  std::mt19937_64 random(12);
  int decided = 0, left = 0;
  for (int i = 0; i < 80; ++i) {
    const GroundNetwork network = pairs(random, 8, 14 + static_cast<std::uint32_t>(random() % 14), false);
    const auto truth = oracle::enumerate(network);
    const MinCutResult result = cut(network);
    ASSERT_TRUE(result.status == MinCutStatus::kOptimal || result.status == MinCutStatus::kPartial);
    EXPECT_GE(result.bound + network.constant_score(), truth.best_score - 1e-9);
    // Some best world has the decided values: try all completions.
    double best = -1e300;
    for (std::uint32_t world = 0; world < 256; ++world) {
      std::vector<std::uint32_t> values;
      bool agrees = true;
      for (std::uint32_t v = 0; v < 8; ++v) {
        values.push_back(world >> v & 1);
        if (result.values[v] != MinCutResult::kUndecided && result.values[v] != values[v]) agrees = false;
      }
      if (agrees) best = std::max(best, oracle::score(network, values).value());
    }
    EXPECT_NEAR(best, truth.best_score, 1e-9);
    for (std::uint32_t v : result.values) (v == MinCutResult::kUndecided ? left : decided)++;
  }
  EXPECT_GT(decided, 100);  // both kinds are met
  EXPECT_GT(left, 20);
}

TEST(MinCut, TakesLongFormulasThatAreOnlyPunished) {
  // !(a v b v c) is worth 2, each atom 0.9: all three together are worth 2.7.
  NetworkBuilder builder;
  const WeightId weight = builder.add_weight({FormulaId(0), {}, 1.0});
  std::vector<Literal> inputs;
  for (std::uint32_t a = 0; a < 3; ++a) inputs.push_back(Literal::atom(builder.first_atom(builder.add_boolean())));
  for (Literal l : inputs) builder.add_feature(l, 0.9, weight);
  builder.add_feature(~builder.make_or(inputs), 2.0, weight);
  const GroundNetwork network = builder.build();
  const MinCutResult result = cut(network);
  ASSERT_EQ(result.status, MinCutStatus::kOptimal);
  EXPECT_EQ(result.values, (std::vector<std::uint32_t>{0, 0, 0}));
}

TEST(MinCut, LeavesLongFormulasThatAreWantedToOthers) {
  NetworkBuilder builder;
  const WeightId weight = builder.add_weight({FormulaId(0), {}, 1.0});
  std::vector<Literal> inputs;
  for (std::uint32_t a = 0; a < 3; ++a) inputs.push_back(Literal::atom(builder.first_atom(builder.add_boolean())));
  builder.add_feature(builder.make_or(inputs), 2.0, weight);
  EXPECT_EQ(cut(builder.build()).status, MinCutStatus::kNotQuadratic);
}

TEST(MinCut, KeepsHardFormulasAndRefutesWhatCannotBe) {
  std::mt19937_64 random(13);
  int impossible = 0;
  for (int i = 0; i < 60; ++i) {
    NetworkBuilder builder;
    const WeightId weight = builder.add_weight({FormulaId(0), {}, 1.0});
    for (int a = 0; a < 6; ++a) builder.add_boolean();
    std::uniform_real_distribution<double> uniform(-5.0, 5.0);
    for (std::uint32_t a = 0; a < 6; ++a) builder.add_feature(atom(a), uniform(random), weight);
    for (int c = 0; c < 9; ++c) {
      const auto a = static_cast<std::uint32_t>(random() % 6), b = static_cast<std::uint32_t>(random() % 6);
      if (a == b) continue;
      const Literal left = atom(a, random() % 2 == 0), right = atom(b, random() % 2 == 0);
      std::vector<Literal> inputs{left, right};
      builder.add_constraint(random() % 3 == 0 ? builder.make_iff(left, right) : builder.make_or(inputs), FormulaId(0));
    }
    const GroundNetwork network = builder.build();
    const auto truth = oracle::enumerate(network);
    const MinCutResult result = cut(network);
    if (!truth.possible) {
      ++impossible;
      EXPECT_NE(result.status == MinCutStatus::kOptimal && oracle::score(network, result.values).has_value(), true);
      continue;
    }
    EXPECT_NE(result.status, MinCutStatus::kImpossible);
    if (result.status != MinCutStatus::kOptimal) continue;
    ASSERT_TRUE(oracle::score(network, result.values).has_value());
    EXPECT_NEAR(*oracle::score(network, result.values), truth.best_score, 1e-9);
  }
  EXPECT_GT(impossible, 0);
}

}  // namespace
}  // namespace sherlog
