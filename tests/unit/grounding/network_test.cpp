#include "grounding/network.h"

#include <gtest/gtest.h>

#include "tests/oracles/enumeration.h"

namespace sherlog {
namespace {

Literal value(NetworkBuilder& b, VariableId v, std::uint32_t i) {
  return Literal::atom(AtomId(b.first_atom(v).value + i));
}

TEST(NetworkBuilder, AnOrWithAComplementIsTrue) {
  NetworkBuilder b;
  const Literal x = value(b, b.add_boolean(), 0);
  std::vector<Literal> inputs{x, ~x};
  EXPECT_EQ(b.make_or(inputs), Literal::constant(true));
}

TEST(NetworkBuilder, TwoDeniedValuesOfOneBlockAreATautology) {
  NetworkBuilder b;
  const VariableId v = b.add_anonymous(3, true);
  std::vector<Literal> inputs{~value(b, v, 0), ~value(b, v, 2)};
  EXPECT_EQ(b.make_or(inputs), Literal::constant(true));
}

TEST(NetworkBuilder, AllValuesOfAnExactlyOneBlockAreATautologyAndOfAnAtMostOneBlockAreNot) {
  NetworkBuilder b;
  const VariableId v = b.add_anonymous(2, false);
  const VariableId w = b.add_anonymous(2, true);
  std::vector<Literal> all{value(b, v, 0), value(b, v, 1)};
  EXPECT_EQ(b.make_or(all), Literal::constant(true));
  std::vector<Literal> some{value(b, w, 0), value(b, w, 1)};
  EXPECT_TRUE(b.make_or(some).is_gate());
}

TEST(NetworkBuilder, EqualFormulasShareAGateWhateverTheirOrder) {
  NetworkBuilder b;
  const Literal x = value(b, b.add_boolean(), 0), y = value(b, b.add_boolean(), 0);
  std::vector<Literal> first{x, ~y}, second{~y, x};
  EXPECT_EQ(b.make_or(first), b.make_or(second));
  EXPECT_EQ(b.make_iff(x, y), ~b.make_iff(y, ~x));
}

TEST(NetworkBuilder, EqualFeaturesOfOneWeightAreMerged) {
  NetworkBuilder b;
  const Literal x = value(b, b.add_boolean(), 0);
  const WeightId w = b.add_weight({FormulaId(0), {}, 1.5});
  b.add_feature(x, 1.5, w);
  b.add_feature(x, 1.5, w);
  b.add_feature(~x, 1.0, w);
  const GroundNetwork network = b.build();
  ASSERT_EQ(network.features().size(), 2u);
  EXPECT_DOUBLE_EQ(network.features()[0].weight, 3.0);
  EXPECT_EQ(network.features()[0].count, 2u);
  // 1.0 * [!x] = 1.0 - 1.0 * [x]
  EXPECT_DOUBLE_EQ(network.features()[1].weight, -1.0);
  EXPECT_DOUBLE_EQ(network.constant_score(), 1.0);
}

TEST(GroundNetwork, ReweightedScoresAWorldAsIfGroundedWithTheNewWeights) {
  const auto build = [](double first, double second) {
    NetworkBuilder b;
    const Literal x = value(b, b.add_boolean(), 0), y = value(b, b.add_boolean(), 0);
    const WeightId v = b.add_weight({FormulaId(0), {}, first}), w = b.add_weight({FormulaId(1), {}, second});
    std::vector<Literal> both{x, y};
    const Literal any = b.make_or(both);
    b.add_feature(any, first, v);
    b.add_feature(any, first, v);
    b.add_feature(~x, second, w);
    b.add_feature(~any, first, v);
    b.add_feature(y, 0.75, kVirtualEvidence);
    return b.build();
  };
  const GroundNetwork expected = build(-2.0, 0.5);
  const std::vector<double> weights{-2.0, 0.5};
  const GroundNetwork network = reweighted(build(1.5, -1.0), weights);
  ASSERT_EQ(network.features().size(), expected.features().size());
  for (std::size_t f = 0; f < expected.features().size(); ++f) {
    EXPECT_EQ(network.features()[f].literal, expected.features()[f].literal);
    EXPECT_DOUBLE_EQ(network.features()[f].weight, expected.features()[f].weight);
  }
  EXPECT_DOUBLE_EQ(network.constant_score(), expected.constant_score());
  EXPECT_DOUBLE_EQ(network.weights()[1].weight, 0.5);
}

TEST(NetworkBuilder, AHardConjunctionIsSplitAndDoesNotJoinComponents) {
  NetworkBuilder b;
  const Literal x = value(b, b.add_boolean(), 0), y = value(b, b.add_boolean(), 0);
  std::vector<Literal> both{x, y};
  EXPECT_TRUE(b.add_constraint(b.make_and(both), FormulaId(0)));
  const GroundNetwork network = b.build();
  EXPECT_EQ(network.constraints().size(), 2u);
  EXPECT_EQ(network.gate_count(), 0u);
  EXPECT_EQ(network.component_count(), 2u);
}

TEST(NetworkBuilder, ADemandForFalseIsRefused) {
  NetworkBuilder b;
  EXPECT_FALSE(b.add_constraint(Literal::constant(false), FormulaId(0)));
  EXPECT_TRUE(b.add_constraint(Literal::constant(true), FormulaId(0)));
}

TEST(GroundNetwork, ComponentsListTheirVariablesFeaturesConstraintsAndQueries) {
  NetworkBuilder b;
  const Literal x = value(b, b.add_boolean(), 0), y = value(b, b.add_boolean(), 0), z = value(b, b.add_boolean(), 0);
  const WeightId w = b.add_weight({FormulaId(0), {}, 1.0});
  std::vector<Literal> inputs{x, z};
  b.add_feature(b.make_or(inputs), 1.0, w);
  b.add_constraint(~y, FormulaId(1));
  b.add_query({y, false, ""});
  const GroundNetwork network = b.build();
  ASSERT_EQ(network.component_count(), 2u);
  const ComponentId joined = network.component_of(x);
  EXPECT_EQ(network.component_of(z), joined);
  EXPECT_EQ(network.component_variables(joined).size(), 2u);
  EXPECT_EQ(network.component_features(joined).size(), 1u);
  EXPECT_EQ(network.component_queries(network.component_of(y)).size(), 1u);
  EXPECT_EQ(network.component_constraints(network.component_of(y)).size(), 1u);
}

}  // namespace
}  // namespace sherlog
