#include "inference/map_reduction.h"

#include <gtest/gtest.h>

#include <vector>

#include "tests/oracles/enumeration.h"
#include "tests/support/networks.h"

namespace sherlog {
namespace {

TEST(MapReduction, PureAtomsAreDecided) {
  // a => b and b are wanted, a is not: everything has its way.
  NetworkBuilder builder;
  const WeightId weight = builder.add_weight({FormulaId(0), {}, 1.0});
  const Literal a = boolean(builder), b = boolean(builder);
  std::vector<Literal> inputs{~a, b};
  builder.add_feature(builder.make_or(inputs), 1.0, weight);
  builder.add_feature(b, 0.5, weight);
  builder.add_feature(a, -0.5, weight);
  const GroundNetwork network = builder.build();
  MapReduction reduction(network);
  ASSERT_TRUE(reduction.reduce(all_components(network)));
  EXPECT_EQ(reduction.rest().variable_count(), 0u);
  EXPECT_DOUBLE_EQ(reduction.rest().constant_score(), 1.5);
  std::vector<std::uint32_t> values(2, 7);
  reduction.lift({}, values);
  EXPECT_EQ(values, (std::vector<std::uint32_t>{1, 0}));
}

TEST(MapReduction, AnEquivalenceWithAPrivateAtomIsAlwaysMet) {
  // 4 (h <=> a ^ b): h follows a and b, so only their own weights are left, which are pure then.
  NetworkBuilder builder;
  const WeightId weight = builder.add_weight({FormulaId(0), {}, 1.0});
  const Literal a = boolean(builder), b = boolean(builder), h = boolean(builder);
  std::vector<Literal> both{a, b};
  builder.add_feature(builder.make_iff(h, builder.make_and(both)), 4.0, weight);
  builder.add_feature(a, 1.0, weight);
  builder.add_feature(b, 0.25, weight);
  const GroundNetwork network = builder.build();
  MapReduction reduction(network);
  ASSERT_TRUE(reduction.reduce(all_components(network)));
  EXPECT_EQ(reduction.rest().variable_count(), 0u);
  std::vector<std::uint32_t> values(3, 7);
  reduction.lift({}, values);
  EXPECT_EQ(values, (std::vector<std::uint32_t>{0, 0, 0}));
}

TEST(MapReduction, AWeighedPrivateAtomIsMaximisedOut) {
  // 2 (h <=> a), h is worth -3, a is worth 1.5: h true costs more than the equivalence, so with a the best is 1.5 (against
  // 2 + 1.5 - 3), without a it is 2.
  NetworkBuilder builder;
  const WeightId weight = builder.add_weight({FormulaId(0), {}, 1.0});
  const Literal a = boolean(builder), h = boolean(builder);
  builder.add_feature(builder.make_iff(h, a), 2.0, weight);
  builder.add_feature(h, -3.0, weight);
  builder.add_feature(a, 1.5, weight);
  const GroundNetwork network = builder.build();
  MapReduction reduction(network);
  ASSERT_TRUE(reduction.reduce(all_components(network)));
  EXPECT_EQ(reduction.rest().variable_count(), 0u);
  std::vector<std::uint32_t> values(2, 7);
  reduction.lift({}, values);
  EXPECT_EQ(values, (std::vector<std::uint32_t>{1, 1}));
  EXPECT_NEAR(network.constant_score() + reduction.rest().constant_score(), oracle::enumerate(network).best_score,
              1e-12);
}

TEST(MapReduction, CandidatesThatNothingMentionsStandInForEachOther) {
  // A block of five values of which two are mentioned, each for and against: the other three are one "none".
  NetworkBuilder builder;
  const WeightId weight = builder.add_weight({FormulaId(0), {}, 1.0});
  const std::uint32_t first = builder.first_atom(builder.add_anonymous(5, false)).value;
  const Literal a = boolean(builder), b = boolean(builder);
  for (std::uint32_t i = 0; i < 2; ++i) {
    builder.add_feature(builder.make_iff(Literal::atom(AtomId(first + i)), a), 1.0 + i, weight);
    builder.add_feature(builder.make_iff(Literal::atom(AtomId(first + i)), b), 2.0 - i, weight);
  }
  const GroundNetwork network = builder.build();
  MapReduction reduction(network);
  ASSERT_TRUE(reduction.reduce(all_components(network)));
  ASSERT_EQ(reduction.rest().variable_count(), 3u);
  EXPECT_EQ(reduction.rest().candidate_count(VariableId(0)), 2u);
  EXPECT_TRUE(reduction.rest().has_none(VariableId(0)));
  std::vector<std::uint32_t> values(3, 7);
  reduction.lift(std::vector<std::uint32_t>{2, 1, 1}, values);
  EXPECT_TRUE(values[0] == 2 || values[0] == 3 || values[0] == 4);
}

TEST(MapReduction, SeesAContradictionBetweenThingsThatBecameTheSame) {
  // b holds, and a differs from a v !b, which is a then.
  NetworkBuilder builder;
  const Literal a = boolean(builder), b = boolean(builder);
  std::vector<Literal> inputs{a, ~b};
  builder.add_constraint(~builder.make_iff(a, builder.make_or(inputs)), FormulaId(0));
  builder.add_constraint(b, FormulaId(1));
  const GroundNetwork network = builder.build();
  MapReduction reduction(network);
  EXPECT_FALSE(reduction.reduce(all_components(network)));
}

TEST(MapReduction, KeepsTheBestScoreAndLiftsItsWorlds) {
  std::mt19937_64 random(31);
  int smaller = 0;
  for (int i = 0; i < 150; ++i) {
    oracle::RandomNetworkOptions shape;
    shape.features = 1 + static_cast<std::uint32_t>(random() % 12);
    const GroundNetwork network = oracle::random_network(random, shape);
    const auto truth = oracle::enumerate(network);
    MapReduction reduction(network);
    if (!reduction.reduce(all_components(network))) {
      EXPECT_FALSE(truth.possible);
      continue;
    }
    const GroundNetwork& rest = reduction.rest();
    const auto rest_truth = oracle::enumerate(rest);
    ASSERT_EQ(truth.possible, rest_truth.possible);
    if (!truth.possible) continue;
    EXPECT_NEAR(network.constant_score() + rest_truth.best_score, truth.best_score, 1e-9);
    if (rest.variable_count() < network.variable_count()) ++smaller;
    // Every possible world of the rest lifts to one of the same score or more.
    std::vector<std::uint32_t> rest_values(rest.variable_count(), 0), values(network.variable_count());
    for (bool more = true; more;) {
      const auto rest_score = oracle::score(rest, rest_values);
      if (rest_score) {
        reduction.lift(rest_values, values);
        const auto score = oracle::score(network, values);
        ASSERT_TRUE(score.has_value());
        ASSERT_GE(*score, network.constant_score() + *rest_score - 1e-9);
      }
      more = false;
      for (std::size_t v = 0; v < rest_values.size() && !more; ++v) {
        more = ++rest_values[v] < rest.value_count(VariableId(v));
        if (!more) rest_values[v] = 0;
      }
    }
  }
  EXPECT_GT(smaller, 50);
}

}  // namespace
}  // namespace sherlog
