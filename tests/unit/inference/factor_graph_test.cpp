#include "inference/factor_graph.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <random>
#include <string>

#include "inference/elimination.h"
#include "inference/elimination_order.h"
#include "tests/oracles/enumeration.h"

namespace sherlog {
namespace {

Literal first(const NetworkBuilder& builder, VariableId v) { return Literal::atom(builder.first_atom(v)); }

struct Solved {
  double log_partition = 0.0;
  std::vector<double> queries;
  double largest_log2 = 0.0;
  std::size_t variables = 0;
};

// The only component, or the sum over all of them.
Solved solve(const GroundNetwork& network, const FactorGraphOptions& options) {
  Monitor monitor;
  const StopCondition stop(monitor);
  Solved solved;
  solved.queries.assign(network.queries().size(), -1.0);
  for (std::size_t c = 0; c < network.component_count(); ++c) {
    const FactorGraph graph = compile_factor_graph(network, ComponentId(c), options);
    if (!graph.possible) {
      solved.log_partition = -std::numeric_limits<double>::infinity();
      return solved;
    }
    const EliminationOrder order = find_elimination_order(graph.cardinalities, graph.scopes);
    const SumProductResult result =
        sum_product(BucketTree(graph.cardinalities, graph.scopes, order.order), graph.tables, stop);
    solved.log_partition += graph.constant + result.log_partition;
    solved.largest_log2 = std::max(solved.largest_log2, order.largest_log2);
    solved.variables += graph.cardinalities.size();
    if (solved.log_partition == -std::numeric_limits<double>::infinity()) return solved;
    const auto queries = network.component_queries(ComponentId(c));
    for (std::size_t q = 0; q < queries.size(); ++q) {
      const ValueTest& test = graph.queries[q];
      double& p = solved.queries[queries[q]];
      p = 0.0;
      if (test.is_constant()) {
        p = test.value() ? 1.0 : 0.0;
        continue;
      }
      for (std::size_t k = 0; k < test.accepted.size(); ++k) {
        if (test.accepted[k] != 0) p += result.marginals[test.variable][k];
      }
    }
  }
  return solved;
}

// Whether formulas become tables or are taken apart, the sums are those of the network.
void expect_enumeration(std::uint64_t small_joint) {
  int possible = 0;
  for (std::uint64_t seed = 0; seed < 150; ++seed) {
    SCOPED_TRACE("network " + std::to_string(seed));
    std::mt19937_64 random(seed);
    oracle::RandomNetworkOptions options;
    options.variables = 3 + static_cast<std::uint32_t>(random() % 7);
    options.constraints = static_cast<std::uint32_t>(random() % 6);
    options.max_inputs = 2 + static_cast<std::uint32_t>(random() % 7);
    const GroundNetwork network = oracle::random_network(random, options);
    const oracle::Enumeration expected = oracle::enumerate(network);
    FactorGraphOptions compilation;
    compilation.small_joint = small_joint;
    const Solved solved = solve(network, compilation);
    if (!expected.possible) {
      EXPECT_EQ(solved.log_partition, -std::numeric_limits<double>::infinity());
      continue;
    }
    ++possible;
    EXPECT_NEAR(solved.log_partition + network.constant_score() + network.free_log_count(), expected.log_partition,
                1e-9);
    for (std::size_t q = 0; q < expected.marginals.size(); ++q) {
      if (network.queries()[q].literal.is_constant()) continue;
      EXPECT_NEAR(solved.queries[q], expected.marginals[q], 1e-9) << "query " << q;
    }
  }
  EXPECT_GT(possible, 50);
}

TEST(FactorGraph, WithTablesForWholeFormulasEqualsEnumeration) { expect_enumeration(4096); }
TEST(FactorGraph, WithTheUsualMixtureEqualsEnumeration) { expect_enumeration(64); }
TEST(FactorGraph, WithTheSmallestTablesEqualsEnumeration) { expect_enumeration(1); }
TEST(FactorGraph, WithSmallFunctionsInsideEqualsEnumeration) { expect_enumeration(8); }

// Weighing the noted entries afterwards is the same as weighing while compiling.
TEST(FactorGraph, KeptFeaturesKnowWhereTheyAreTrue) {
  Monitor monitor;
  const StopCondition stop(monitor);
  std::size_t open = 0, decided = 0;
  for (std::uint64_t seed = 0; seed < 200; ++seed) {
    SCOPED_TRACE("network " + std::to_string(seed));
    std::mt19937_64 random(seed);
    oracle::RandomNetworkOptions options;
    options.variables = 3 + static_cast<std::uint32_t>(random() % 7);
    options.constraints = static_cast<std::uint32_t>(random() % 6);
    options.max_inputs = 2 + static_cast<std::uint32_t>(random() % 7);
    const GroundNetwork network = oracle::random_network(random, options);
    FactorGraphOptions compilation;
    compilation.small_joint = std::array<std::uint64_t, 3>{1, 8, 64}[seed % 3];
    for (std::size_t c = 0; c < network.component_count(); ++c) {
      compilation.keep_features = false;
      const FactorGraph weighed = compile_factor_graph(network, ComponentId(c), compilation);
      compilation.keep_features = true;
      FactorGraph kept = compile_factor_graph(network, ComponentId(c), compilation);
      ASSERT_EQ(kept.possible, weighed.possible);
      if (!kept.possible) continue;
      EXPECT_EQ(kept.scopes, weighed.scopes);
      for (const auto& table : kept.tables) {
        for (const double value : table) EXPECT_TRUE(value == 0.0 || value < -1e300) << value;
      }
      for (const auto& f : kept.features) {
        ++open;
        EXPECT_TRUE(std::is_sorted(f.entries.begin(), f.entries.end()));
        const double weight = network.features()[f.feature].weight;
        std::vector<double>& table = kept.tables[f.scope];
        std::vector<bool> listed(table.size());
        for (const std::uint32_t entry : f.entries) listed[entry] = true;
        for (std::size_t i = 0; i < table.size(); ++i) table[i] += listed[i] != f.negated ? weight : 0.0;
      }
      for (const std::uint32_t f : kept.true_features) {
        ++decided;
        kept.constant += network.features()[f].weight;
      }
      EXPECT_NEAR(kept.constant, weighed.constant, 1e-12);
      for (std::size_t t = 0; t < kept.tables.size(); ++t) {
        for (std::size_t i = 0; i < kept.tables[t].size(); ++i) {
          const double a = kept.tables[t][i], b = weighed.tables[t][i];
          EXPECT_TRUE(a == b || std::abs(a - b) < 1e-12) << "table " << t << " entry " << i << ": " << a << ", " << b;
        }
      }
    }
  }
  EXPECT_GT(open, 500u);
  EXPECT_GT(decided, 20u);
}

TEST(FactorGraph, ALongDisjunctionIsAChain) {
  NetworkBuilder builder;
  std::vector<Literal> inputs;
  for (int i = 0; i < 200; ++i) inputs.push_back(first(builder, builder.add_boolean()));
  const WeightId weight = builder.add_weight({});
  builder.add_feature(builder.make_or(inputs), -100.0, weight);
  const Solved solved = solve(builder.build(), {});
  // A world with any true atom weighs e^-100, and there are 2^200 - 1 of them: log(1 + (2^200 - 1) e^-100).
  EXPECT_NEAR(solved.log_partition, std::log1p(std::exp(200.0 * std::log(2.0) - 100.0)), 1e-9);
  EXPECT_LE(solved.largest_log2, 3.0);
}

TEST(FactorGraph, FormulasAboutOneRowShareOneChain) {
  // At most one of 40 atoms, "some atom" as a feature and as an equivalence: one bit of state, not three.
  NetworkBuilder builder;
  std::vector<Literal> row;
  for (int i = 0; i < 40; ++i) row.push_back(first(builder, builder.add_boolean()));
  const Literal absent = first(builder, builder.add_boolean());
  for (std::size_t i = 0; i < row.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      std::vector<Literal> pair{~row[i], ~row[j]};
      builder.add_constraint(builder.make_or(pair), FormulaId(0));
    }
  }
  std::vector<Literal> inputs = row;
  const Literal any = builder.make_or(inputs);
  const WeightId weight = builder.add_weight({});
  builder.add_feature(any, 1.5, weight);
  builder.add_constraint(builder.make_iff(absent, ~any), FormulaId(1));
  const Solved solved = solve(builder.build(), {});
  // No atom: 1; one of 40: 40 e^1.5.
  EXPECT_NEAR(solved.log_partition, std::log(1.0 + 40.0 * std::exp(1.5)), 1e-9);
  EXPECT_LE(solved.largest_log2, 3.0);
  EXPECT_LE(solved.variables, 41u + 39u);
}

TEST(FactorGraph, AtMostOneGatesHaveTheirTruthWhereverTheyStand) {
  for (std::uint64_t seed = 0; seed < 60; ++seed) {
    SCOPED_TRACE(seed);
    std::mt19937_64 random(seed);
    NetworkBuilder builder;
    const WeightId weight = builder.add_weight({});
    for (int i = 0; i < 6; ++i) builder.add_anonymous(i < 2 ? 3 : 1, true);
    const auto gate = [&] {
      std::vector<Literal> inputs;
      for (std::uint32_t a = 0; a < builder.atom_count(); ++a) {
        if (random() % 2 == 0) inputs.push_back(Literal::atom(AtomId(a), random() % 4 == 0));
      }
      return inputs.size() < 2 ? Literal::atom(AtomId(0)) : builder.make_at_most_one(inputs);
    };
    builder.add_feature(gate(), 0.7, weight);
    builder.add_feature(builder.make_iff(gate(), Literal::atom(AtomId(3))), -0.4, weight);
    builder.add_constraint(random() % 2 == 0 ? gate() : ~gate(), FormulaId(0));
    builder.add_query({gate(), true, "formula"});
    const GroundNetwork network = builder.build();
    const oracle::Enumeration expected = oracle::enumerate(network);
    for (const std::uint64_t small_joint : {1u, 16u, 4096u}) {
      FactorGraphOptions compilation;
      compilation.small_joint = small_joint;
      const Solved solved = solve(network, compilation);
      if (!expected.possible) {
        EXPECT_EQ(solved.log_partition, -std::numeric_limits<double>::infinity());
        continue;
      }
      EXPECT_NEAR(solved.log_partition + network.constant_score() + network.free_log_count(), expected.log_partition,
                  1e-9);
      EXPECT_NEAR(solved.queries[0], expected.marginals[0], 1e-9);
    }
  }
}

TEST(FactorGraph, ImpossibleValuesAreDropped) {
  NetworkBuilder builder;
  const VariableId block = builder.add_anonymous(3, false);
  const Literal other = first(builder, builder.add_boolean());
  const AtomId a = builder.first_atom(block);
  builder.add_constraint(Literal::atom(AtomId(a.value + 1), true), FormulaId(0));
  std::vector<Literal> inputs{Literal::atom(a), other};
  const WeightId weight = builder.add_weight({});
  builder.add_feature(builder.make_or(inputs), 1.0, weight);
  const GroundNetwork network = builder.build();
  const ComponentId component = network.component_of(block);
  const FactorGraph graph = compile_factor_graph(network, component);
  ASSERT_TRUE(graph.possible);
  EXPECT_EQ(graph.cardinalities, (std::vector<std::uint32_t>{2, 2}));
  EXPECT_EQ(graph.bindings[0].values, (std::vector<std::uint32_t>{0, 2}));
}

TEST(FactorGraph, IsLeftUnfinishedWhereTheUserWantsAnEnd) {
  class Interrupt : public Monitor {
   public:
    bool interrupted() const override { return true; }
  } monitor;
  const StopCondition stop(monitor);
  NetworkBuilder builder;
  const Literal a = Literal::atom(builder.first_atom(builder.add_boolean()));
  builder.add_feature(a, 1.0, builder.add_weight({}));
  const GroundNetwork network = builder.build();
  FactorGraphOptions options;
  options.stop = &stop;
  EXPECT_TRUE(compile_factor_graph(network, ComponentId(0), options).stopped);
  EXPECT_FALSE(compile_factor_graph(network, ComponentId(0)).stopped);
}

}  // namespace
}  // namespace sherlog
