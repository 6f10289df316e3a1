// Contributions are compared with what they claim to be: the log-odds with a formula minus the log-odds without it.
#include "inference/explain.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "tests/oracles/enumeration.h"

namespace sherlog {
namespace {

double logit(double p) { return std::log(p / (1 - p)); }

const Contribution* find(const Explanation& explanation, bool is_constraint, std::uint32_t index) {
  const auto found = std::find_if(explanation.contributions.begin(), explanation.contributions.end(),
                                  [&](const auto& c) { return c.is_constraint == is_constraint && c.index == index; });
  return found == explanation.contributions.end() ? nullptr : &*found;
}

InferenceOptions exact() {
  InferenceOptions options;
  options.method = "exact";
  return options;
}

// log(P(a) / P(!a)) by enumeration, with feature `left_out` weighing nothing and constraint `dropped` not asked for.
double log_odds(const GroundNetwork& network, AtomId atom, std::size_t left_out, std::size_t dropped) {
  std::vector<std::uint32_t> values(network.variable_count(), 0);
  double sums[2] = {0, 0};
  while (true) {
    bool possible = true;
    for (std::size_t c = 0; c < network.constraints().size(); ++c) {
      possible = possible && (c == dropped || oracle::evaluate(network, network.constraints()[c].literal, values));
    }
    if (possible) {
      double score = 0;
      for (std::size_t f = 0; f < network.features().size(); ++f) {
        const Feature& feature = network.features()[f];
        if (f != left_out && oracle::evaluate(network, feature.literal, values)) score += feature.weight;
      }
      sums[oracle::evaluate(network, Literal::atom(atom), values) ? 1 : 0] += std::exp(score);
    }
    std::size_t v = 0;
    while (v < values.size() && ++values[v] == network.value_count(VariableId(v))) values[v++] = 0;
    if (v == values.size()) break;
  }
  return std::log(sums[1]) - std::log(sums[0]);
}

constexpr std::size_t kNothing = 1u << 30;

TEST(Explain, AWeightOnTheAtomItselfContributesThatWeight) {
  NetworkBuilder builder;
  const AtomId atom = builder.first_atom(builder.add_boolean());
  builder.add_feature(Literal::atom(atom), 1.5, builder.add_weight({FormulaId(0), {}, 1.5}));
  Monitor monitor;
  const Explanation explanation = explain(builder.build(), Literal::atom(atom), exact(), monitor);
  ASSERT_EQ(explanation.termination, Termination::kCompleted) << explanation.message;
  EXPECT_NEAR(explanation.log_odds, 1.5, 1e-12);
  ASSERT_EQ(explanation.contributions.size(), 1u);
  EXPECT_NEAR(explanation.contributions[0].log_odds, 1.5, 1e-12);
}

TEST(Explain, EveryContributionIsTheLogOddsWithMinusThoseWithout) {
  std::mt19937_64 random(21);
  int compared = 0;
  for (int round = 0; round < 20; ++round) {
    oracle::RandomNetworkOptions shape;
    shape.variables = 6;
    shape.features = 8;
    shape.constraints = 2;
    const GroundNetwork network = oracle::random_network(random, shape);
    const AtomId atom(random() % network.atom_count());
    const auto truth = oracle::enumerate(network);
    if (!truth.possible) continue;
    const double p = truth.atom_marginals[atom.index()];
    if (p <= 1e-12 || p >= 1 - 1e-12) continue;
    Monitor monitor;
    const Explanation explanation = explain(network, Literal::atom(atom), exact(), monitor);
    ASSERT_EQ(explanation.termination, Termination::kCompleted) << explanation.message;
    EXPECT_NEAR(explanation.log_odds, logit(p), 1e-8);
    const ComponentId component = network.component_of(Literal::atom(atom));
    for (std::uint32_t f : network.component_features(component)) {
      const Contribution* contribution = find(explanation, false, f);
      const double expected = logit(p) - log_odds(network, atom, f, kNothing);
      EXPECT_NEAR(contribution == nullptr ? 0.0 : contribution->log_odds, expected, 1e-8);
      ++compared;
    }
    for (std::uint32_t c : network.component_constraints(component)) {
      const Contribution* contribution = find(explanation, true, c);
      const double expected = logit(p) - log_odds(network, atom, kNothing, c);
      if (std::isinf(expected)) continue;
      EXPECT_NEAR(contribution == nullptr ? 0.0 : contribution->log_odds, expected, 1e-8);
      ++compared;
    }
  }
  EXPECT_GT(compared, 50);
}

// Four blocks of 16 values, each pair of them joined by features: what exact does for one question is too wide for a question
// about every feature at once, and is done in parts.
TEST(Explain, FeaturesThatAreTooWideTogetherAreAskedForInParts) {
  std::mt19937_64 random(5);
  std::uniform_real_distribution<double> weight(-1.5, 1.5);
  const auto make = [&](bool all_queried) {
    random.seed(5);
    NetworkBuilder builder;
    std::vector<AtomId> first;
    for (int v = 0; v < 4; ++v) first.push_back(builder.first_atom(builder.add_anonymous(16, false)));
    for (std::size_t a = 0; a < 4; ++a) {
      for (std::size_t b = a + 1; b < 4; ++b) {
        for (std::uint32_t value = 0; value < 16; ++value) {
          std::vector<Literal> both{Literal::atom(AtomId(first[a].value + value)),
                                    Literal::atom(AtomId(first[b].value + 15 - value))};
          const Literal pair = builder.make_and(both);
          const double w = weight(random);
          builder.add_feature(pair, w, builder.add_weight({FormulaId(0), {}, w}));
          if (all_queried) builder.add_query({pair, true, "pair"});
        }
      }
    }
    return builder.build();
  };
  InferenceOptions narrow = exact();
  narrow.max_table_log2 = 17;
  Monitor monitor;
  ASSERT_EQ(infer(make(true), narrow, monitor).termination, Termination::kTooWide) << "the limit does not bite";

  const GroundNetwork network = make(false);
  const Literal atom = Literal::atom(AtomId(0));
  const Explanation in_parts = explain(network, atom, narrow, monitor);
  ASSERT_EQ(in_parts.termination, Termination::kCompleted) << in_parts.message;
  const Explanation at_once = explain(network, atom, exact(), monitor);
  ASSERT_EQ(at_once.termination, Termination::kCompleted) << at_once.message;
  EXPECT_NEAR(in_parts.log_odds, at_once.log_odds, 1e-9);
  EXPECT_EQ(in_parts.contributions.size(), network.features().size());
  for (const Contribution& contribution : at_once.contributions) {
    const Contribution* same = find(in_parts, false, contribution.index);
    ASSERT_NE(same, nullptr);
    EXPECT_NEAR(same->log_odds, contribution.log_odds, 1e-9);
  }
}

TEST(Explain, LargestContributionComesFirst) {
  std::mt19937_64 random(22);
  const GroundNetwork network = oracle::random_network(random);
  Monitor monitor;
  const Explanation explanation = explain(network, Literal::atom(AtomId(0)), exact(), monitor);
  EXPECT_TRUE(std::is_sorted(explanation.contributions.begin(), explanation.contributions.end(),
                             [](const auto& a, const auto& b) { return std::abs(a.log_odds) > std::abs(b.log_odds); }));
}

TEST(Explain, AtomThatHardFormulasDecideNamesThem) {
  NetworkBuilder builder;
  const AtomId a = builder.first_atom(builder.add_boolean());
  const AtomId b = builder.first_atom(builder.add_boolean());
  std::vector<Literal> implies{Literal::atom(b, true), Literal::atom(a)};
  builder.add_feature(Literal::atom(b), -2.0, builder.add_weight({FormulaId(2), {}, -2.0}));
  ASSERT_TRUE(builder.add_constraint(builder.make_or(implies), FormulaId(0)));
  ASSERT_TRUE(builder.add_constraint(Literal::atom(b), FormulaId(1)));
  Monitor monitor;
  const Explanation explanation = explain(builder.build(), Literal::atom(a), exact(), monitor);
  EXPECT_EQ(explanation.probability, 1.0);
  ASSERT_EQ(explanation.contributions.size(), 2u);
  for (const Contribution& contribution : explanation.contributions) {
    EXPECT_TRUE(contribution.is_constraint);
    EXPECT_EQ(contribution.log_odds, std::numeric_limits<double>::infinity());
  }
}

TEST(Explain, ImpossibleModelIsSaidToBeImpossible) {
  NetworkBuilder builder;
  const AtomId a = builder.first_atom(builder.add_boolean());
  ASSERT_TRUE(builder.add_constraint(Literal::atom(a), FormulaId(0)));
  ASSERT_TRUE(builder.add_constraint(Literal::atom(a, true), FormulaId(1)));
  Monitor monitor;
  EXPECT_EQ(explain(builder.build(), Literal::atom(a), exact(), monitor).termination, Termination::kNoPossibleWorld);
}

TEST(Explain, RefusesWhatItCannotExplain) {
  NetworkBuilder builder;
  const AtomId a = builder.first_atom(builder.add_boolean());
  builder.add_soft_target({a, 0.7});
  const GroundNetwork network = builder.build();
  Monitor monitor;
  EXPECT_EQ(explain(network, Literal::constant(true), exact(), monitor).termination, Termination::kRefused);
  EXPECT_EQ(explain(network, Literal::atom(a), exact(), monitor).termination, Termination::kRefused);
  InferenceOptions map;
  map.method = "map";
  EXPECT_EQ(explain(network, Literal::atom(a), map, monitor).termination, Termination::kRefused);
}

}  // namespace
}  // namespace sherlog
