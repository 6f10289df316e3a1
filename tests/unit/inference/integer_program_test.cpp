#include "inference/integer_program.h"

#include <gtest/gtest.h>

#include <random>
#include <vector>

#include "tests/oracles/enumeration.h"

namespace sherlog {
namespace {

constexpr IntegerProgramEffort kEnough{1'000'000, 100'000};

IntegerProgramStatus solve(IntegerProgram& program) {
  Monitor monitor;
  const StopCondition stop(monitor);
  const IntegerProgramStatus status = program.relax(kEnough, stop);
  return status == IntegerProgramStatus::kOpen ? program.branch_and_cut({}, kEnough, stop) : status;
}

TEST(IntegerProgram, FindsTheBestOfSmallRandomNetworks) {
  std::mt19937_64 random(21);
  int possible = 0;
  for (int i = 0; i < 60; ++i) {
    const GroundNetwork network = oracle::random_network(random);
    const auto truth = oracle::enumerate(network);
    IntegerProgram program(network);
    const IntegerProgramStatus status = solve(program);
    EXPECT_EQ(status, truth.possible ? IntegerProgramStatus::kOptimal : IntegerProgramStatus::kImpossible);
    if (!truth.possible) continue;
    ++possible;
    const auto score = oracle::score(network, program.values());
    ASSERT_TRUE(score.has_value());
    EXPECT_NEAR(*score, truth.best_score, 1e-6);
    EXPECT_GE(program.bound() + network.constant_score(), truth.best_score - 1e-6);
  }
  EXPECT_GT(possible, 30);
}

TEST(IntegerProgram, KeepsAnIncumbentThatCannotBeBeaten) {
  std::mt19937_64 random(22);
  Monitor monitor;
  const StopCondition stop(monitor);
  int open = 0;
  for (int i = 0; i < 60; ++i) {
    const GroundNetwork network = oracle::random_network(random);
    IntegerProgram first(network), second(network);
    if (solve(first) != IntegerProgramStatus::kOptimal) continue;
    if (second.relax(kEnough, stop) != IntegerProgramStatus::kOpen) continue;
    ++open;
    EXPECT_EQ(second.branch_and_cut(first.values(), kEnough, stop), IntegerProgramStatus::kOptimal);
    EXPECT_NEAR(oracle::score(network, second.values()).value(), oracle::score(network, first.values()).value(), 1e-6);
  }
  EXPECT_GT(open, 5);
}

TEST(IntegerProgram, MergesEqualWeightsOverABlock) {
  // 1 (!a v !x = i) for each of ten values i: one row and one column instead of ten.
  NetworkBuilder builder;
  const WeightId weight = builder.add_weight({FormulaId(0), {}, 1.0});
  const Literal a = Literal::atom(builder.first_atom(builder.add_boolean()));
  const std::uint32_t first = builder.first_atom(builder.add_anonymous(10, true)).value;
  builder.add_feature(a, 0.5, weight);
  for (std::uint32_t i = 0; i < 10; ++i) {
    std::vector<Literal> inputs{~a, Literal::atom(AtomId(first + i), true)};
    builder.add_feature(builder.make_or(inputs), 1.0, weight);
    builder.add_feature(Literal::atom(AtomId(first + i)), 0.1 * i, weight);
  }
  const GroundNetwork network = builder.build();
  IntegerProgram program(network);
  EXPECT_EQ(program.columns(), 12u);  // a, ten candidates, one for the merged weight
  EXPECT_EQ(program.rows(), 2u);      // the block, the merged weight
  EXPECT_EQ(solve(program), IntegerProgramStatus::kOptimal);
  // x = 9 without a: 10 + 0.9; a without x: 10 + 0.5
  EXPECT_NEAR(oracle::score(network, program.values()).value(), 10.9, 1e-9);
}

TEST(IntegerProgram, CountsTheMembersOfASoftGroup) {
  // Any two of six atoms cost 1, an atom is worth 2.5: k atoms are worth 2.5 k - k (k - 1) / 2, most at k = 3 (4.5). Pair by
  // pair the relaxation would say 6 x 0.5 x 2.5.
  NetworkBuilder builder;
  const WeightId weight = builder.add_weight({FormulaId(0), {}, 1.0});
  for (std::uint32_t a = 0; a < 6; ++a) {
    builder.add_boolean();
    builder.add_feature(Literal::atom(AtomId(a)), 2.5, weight);
    for (std::uint32_t b = 0; b < a; ++b) {
      std::vector<Literal> inputs{Literal::atom(AtomId(a), true), Literal::atom(AtomId(b), true)};
      builder.add_feature(builder.make_or(inputs), 1.0, weight);
    }
  }
  const GroundNetwork network = builder.build();
  IntegerProgram program(network);
  EXPECT_EQ(program.rows(), 1u);
  Monitor monitor;
  EXPECT_EQ(program.relax(kEnough, StopCondition(monitor)), IntegerProgramStatus::kOptimal);
  EXPECT_NEAR(oracle::score(network, program.values()).value(), 15.0 + 4.5, 1e-9);
}

TEST(IntegerProgram, SpentEffortLeavesABoundAndNoProof) {
  std::mt19937_64 random(23);
  oracle::RandomNetworkOptions shape;
  shape.variables = 14;
  shape.features = 60;
  shape.constraints = 0;
  Monitor monitor;
  const StopCondition stop(monitor);
  int spent = 0;
  for (int i = 0; i < 10; ++i) {
    const GroundNetwork network = oracle::random_network(random, shape);
    IntegerProgram program(network);
    EXPECT_EQ(program.relax({1, 0}, stop), IntegerProgramStatus::kOpen);
    EXPECT_FALSE(program.is_relaxed());
    if (program.relax(kEnough, stop) != IntegerProgramStatus::kOpen) continue;
    const double bound = program.bound();
    if (program.branch_and_cut({}, {1, 1}, stop) != IntegerProgramStatus::kOpen) continue;
    ++spent;
    EXPECT_EQ(program.bound(), bound);
  }
  EXPECT_GT(spent, 0);
}

TEST(IntegerProgram, StatesAPermutationInOneRowForEachRowAndColumn) {
  // All pairs of a row or column exclude each other: 2 x 5 x 10 clauses become 2 x 5 rows, and the relaxation is whole.
  constexpr std::uint32_t n = 5;
  NetworkBuilder builder;
  const WeightId weight = builder.add_weight({FormulaId(0), {}, 1.0});
  for (std::uint32_t i = 0; i < n * n; ++i) {
    builder.add_boolean();
    builder.add_feature(Literal::atom(AtomId(i)), 1.0 + 0.37 * (i * i % 7), weight);
  }
  const auto exclude = [&](std::uint32_t a, std::uint32_t b) {
    std::vector<Literal> inputs{Literal::atom(AtomId(a), true), Literal::atom(AtomId(b), true)};
    builder.add_constraint(builder.make_or(inputs), FormulaId(0));
  };
  for (std::uint32_t i = 0; i < n; ++i) {
    for (std::uint32_t j = 0; j < n; ++j) {
      for (std::uint32_t k = j + 1; k < n; ++k) {
        exclude(i * n + j, i * n + k);
        exclude(j * n + i, k * n + i);
      }
    }
  }
  const GroundNetwork network = builder.build();
  IntegerProgram program(network);
  EXPECT_EQ(program.rows(), 2 * n);
  Monitor monitor;
  EXPECT_EQ(program.relax(kEnough, StopCondition(monitor)), IntegerProgramStatus::kOptimal);
  EXPECT_TRUE(oracle::score(network, program.values()).has_value());
}

}  // namespace
}  // namespace sherlog
