#include "inference/component_sum.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <string>

#include "inference/exact.h"
#include "tests/oracles/enumeration.h"

namespace sherlog {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

struct Learned {
  double log_partition = 0.0;          // of the features at their weights, constant_score left out
  std::vector<double> expected_truth;  // by feature
};

// Every component compiled, its entries weighed with the network's own features, summed.
Learned sum_network(const GroundNetwork& network, const InferenceOptions& options, int& searched) {
  Monitor monitor;
  const StopCondition stop(monitor);
  Learned out;
  out.expected_truth.assign(network.features().size(), 0.0);
  for (std::size_t c = 0; c < network.component_count(); ++c) {
    const CompiledComponent compiled = compile_component_sum(network, ComponentId(c), options, stop);
    if (compiled.termination == Termination::kNoPossibleWorld) {
      EXPECT_FALSE(compiled.conflict.empty());
      out.log_partition = -kInfinity;
      return out;
    }
    EXPECT_TRUE(compiled.sum.has_value()) << compiled.message;
    if (!compiled.sum) continue;
    const ComponentSum& sum = *compiled.sum;
    searched += sum.way() == ComponentSum::Way::kSearch ? 1 : 0;
    std::vector<double> potentials(sum.entry_count(), 0.0), beliefs(sum.entry_count(), 0.0);
    double constant = 0.0;  // features noted by where they are false
    for (const auto& f : sum.features()) {
      const double weight = network.features()[f.feature].weight;
      constant += f.negated ? weight : 0.0;
      for (const std::uint32_t entry : sum.entries(f)) potentials[entry] += f.negated ? -weight : weight;
    }
    double log_partition = 0.0, without_beliefs = 0.0;
    const Termination termination = sum.sum(potentials, log_partition, beliefs, stop);
    if (termination == Termination::kNoPossibleWorld) {  // search does not see it before it is asked
      EXPECT_EQ(sum.way(), ComponentSum::Way::kSearch);
      out.log_partition = -kInfinity;
      return out;
    }
    EXPECT_EQ(termination, Termination::kCompleted);
    EXPECT_EQ(sum.sum(potentials, without_beliefs, {}, stop), Termination::kCompleted);
    EXPECT_NEAR(without_beliefs, log_partition, 3e-10 * (1.0 + std::abs(log_partition)));
    out.log_partition += log_partition + constant;
    for (const auto& f : sum.features()) {
      double share = 0.0;
      for (const std::uint32_t entry : sum.entries(f)) share += beliefs[entry];
      out.expected_truth[f.feature] += f.negated ? 1.0 - share : share;
    }
    for (const std::uint32_t f : sum.true_features()) {
      out.log_partition += network.features()[f].weight;
      out.expected_truth[f] = 1.0;
    }
  }
  return out;
}

// A network whose queries are its features: the oracle's marginals are their expected truths.
GroundNetwork with_features_as_queries(const GroundNetwork& network) {
  NetworkBuilder builder(network);
  for (const Feature& f : network.features()) builder.add_query({f.literal, true, "feature"});
  return builder.build();
}

void expect_enumeration(std::uint32_t variables, double block_share, int networks, double max_table_log2 = 24) {
  int possible = 0, searched = 0;
  InferenceOptions inference;
  inference.max_table_log2 = max_table_log2;
  for (int seed = 0; seed < networks; ++seed) {
    SCOPED_TRACE("network " + std::to_string(seed));
    std::mt19937_64 random(static_cast<std::uint64_t>(seed));
    oracle::RandomNetworkOptions options;
    options.variables = variables;
    options.features = variables + static_cast<std::uint32_t>(random() % 10);
    options.constraints = static_cast<std::uint32_t>(random() % 6);
    options.block_share = block_share;
    options.max_inputs = 2 + static_cast<std::uint32_t>(random() % 7);
    const GroundNetwork network = with_features_as_queries(oracle::random_network(random, options));
    const oracle::Enumeration expected = oracle::enumerate(network);
    const Learned learned = sum_network(network, inference, searched);
    if (!expected.possible) {
      EXPECT_EQ(learned.log_partition, -kInfinity);
      continue;
    }
    ++possible;
    EXPECT_NEAR(learned.log_partition + network.constant_score() + network.free_log_count(), expected.log_partition,
                1e-9);
    const std::size_t first = network.queries().size() - network.features().size();
    for (std::size_t f = 0; f < network.features().size(); ++f) {
      EXPECT_NEAR(learned.expected_truth[f], expected.marginals[first + f], 1e-9) << "feature " << f;
    }
  }
  EXPECT_GT(possible, networks / 4);
  EXPECT_GE(searched, max_table_log2 < 24 ? networks / 4 : 0);
}

TEST(ComponentSum, OfFewWorldsEqualsEnumeration) { expect_enumeration(4, 0.3, 200); }
TEST(ComponentSum, ByEliminationEqualsEnumeration) { expect_enumeration(9, 0.5, 60); }
TEST(ComponentSum, BySearchEqualsEnumeration) { expect_enumeration(9, 0.5, 60, 2); }

TEST(ComponentSum, GradientEqualsFiniteDifferences) {
  Monitor monitor;
  const StopCondition stop(monitor);
  std::mt19937_64 random(7);
  oracle::RandomNetworkOptions options;
  options.variables = 9;
  options.features = 20;
  options.constraints = 1;
  const GroundNetwork network = oracle::random_network(random, options);
  for (std::size_t c = 0; c < network.component_count(); ++c) {
    const CompiledComponent compiled = compile_component_sum(network, ComponentId(c), {}, stop);
    ASSERT_TRUE(compiled.sum.has_value()) << compiled.message;
    const ComponentSum& sum = *compiled.sum;
    std::vector<double> potentials(sum.entry_count()), beliefs(sum.entry_count());
    std::uniform_real_distribution<double> uniform(-1.0, 1.0);
    for (double& p : potentials) p = uniform(random);
    double log_partition = 0.0, above = 0.0, below = 0.0;
    ASSERT_EQ(sum.sum(potentials, log_partition, beliefs, stop), Termination::kCompleted);
    for (std::size_t e = 0; e < sum.entry_count(); ++e) {
      const double kept = potentials[e];
      potentials[e] = kept + 1e-4;
      ASSERT_EQ(sum.sum(potentials, above, {}, stop), Termination::kCompleted);
      potentials[e] = kept - 1e-4;
      ASSERT_EQ(sum.sum(potentials, below, {}, stop), Termination::kCompleted);
      potentials[e] = kept;
      EXPECT_NEAR((above - below) / 2e-4, beliefs[e], 1e-7) << "entry " << e;
    }
  }
}

TEST(ComponentSum, BiasCountsAsPartOfTheSum) {
  Monitor monitor;
  const StopCondition stop(monitor);
  NetworkBuilder builder;
  const Literal x = Literal::atom(builder.first_atom(builder.add_boolean()));
  const WeightId weight = builder.add_weight({});
  builder.add_feature(x, 100.0, weight);
  const GroundNetwork network = builder.build();
  const std::vector<double> bias{0.5};
  const CompiledComponent compiled = compile_component_sum(network, ComponentId(0), {}, stop, bias);
  ASSERT_TRUE(compiled.sum.has_value());
  ASSERT_EQ(compiled.sum->features().size(), 1u);
  std::vector<double> potentials(compiled.sum->entry_count(), 0.0);
  potentials[compiled.sum->entries(compiled.sum->features()[0])[0]] = 0.25;
  double log_partition = 0.0;
  ASSERT_EQ(compiled.sum->sum(potentials, log_partition, {}, stop), Termination::kCompleted);
  EXPECT_NEAR(log_partition, std::log(1.0 + std::exp(0.75)), 1e-14);  // weights of the network play no part
}

TEST(ComponentSum, SaysAtWhichWeightsSearchTakesTooLong) {
  Monitor monitor;
  const StopCondition stop(monitor);
  NetworkBuilder builder;
  const WeightId weight = builder.add_weight({});
  std::vector<Literal> atoms;
  for (int i = 0; i < 30; ++i) atoms.push_back(Literal::atom(builder.first_atom(builder.add_boolean())));
  for (std::size_t i = 0; i < atoms.size(); ++i) {
    builder.add_feature(atoms[i], 1.0, weight);
    for (std::size_t j = 0; j < i; ++j) builder.add_feature(builder.make_iff(atoms[i], atoms[j]), 0.1, weight);
  }
  const GroundNetwork network = builder.build();
  ComponentSumOptions options;
  options.max_steps = 5'000'000;
  const CompiledComponent compiled = compile_component_sum(network, ComponentId(0), {}, stop, {}, options);
  ASSERT_TRUE(compiled.sum.has_value());
  const ComponentSum& sum = *compiled.sum;
  const auto sum_at = [&](double unary, double& log_partition) {
    std::vector<double> potentials(sum.entry_count(), 0.0), beliefs(sum.entry_count());
    for (const auto& f : sum.features()) {
      const bool is_atom = network.features()[f.feature].literal.is_atom();
      for (const std::uint32_t entry : sum.entries(f)) potentials[entry] += is_atom ? unary : 0.1;
    }
    return sum.sum(potentials, log_partition, beliefs, stop);
  };
  double log_partition = 0.0;
  EXPECT_EQ(sum_at(0.0, log_partition), Termination::kTooWide);
  EXPECT_EQ(sum_at(30.0, log_partition), Termination::kCompleted);
  // All true: 30 * 30 + 435 * 0.1; the next best world is e^-(30 + 2.9) less likely.
  EXPECT_NEAR(log_partition, 943.5, 1e-9);
}

// Search is tried first; where mass is spread it fails and elimination does the work.
TEST(ComponentSum, OfAnySharpnessEqualsElimination) {
  Monitor monitor;
  const StopCondition stop(monitor);
  NetworkBuilder builder;
  const WeightId weight = builder.add_weight({});
  std::vector<std::uint32_t> blocks;
  for (int i = 0; i < 5; ++i) {
    blocks.push_back(builder.first_atom(builder.add_anonymous(11, false)).value);
    for (std::uint32_t v = 0; v < 11; ++v) builder.add_feature(Literal::atom(AtomId(blocks.back() + v)), 1.0, weight);
    for (int j = 0; j < i; ++j) {
      for (std::uint32_t v = 0; v < 11; ++v) {
        std::vector<Literal> both{Literal::atom(AtomId(blocks.back() + v)),
                                  Literal::atom(AtomId(blocks[static_cast<std::size_t>(j)] + v))};
        builder.add_feature(builder.make_and(both), 1.0, weight);
      }
    }
  }
  const GroundNetwork network = builder.build();
  ComponentSumOptions without;
  without.max_searched_variables = 0;
  const CompiledComponent either = compile_component_sum(network, ComponentId(0), {}, stop);
  const CompiledComponent eliminated = compile_component_sum(network, ComponentId(0), {}, stop, {}, without);
  ASSERT_TRUE(either.sum.has_value() && eliminated.sum.has_value());
  std::mt19937_64 random(3);
  std::normal_distribution<double> normal;
  bool searched = false;
  for (int round = 0; round < 60; ++round) {
    SCOPED_TRACE(round);
    const double sharpness = 0.5 * (round % 20);
    std::vector<double> potentials(either.sum->entry_count());
    for (double& p : potentials) p = sharpness * normal(random);
    std::vector<double> beliefs(potentials.size()), expected(potentials.size());
    double log_partition = 0.0, expected_log_partition = 0.0;
    ASSERT_EQ(either.sum->sum(potentials, log_partition, beliefs, stop), Termination::kCompleted);
    ASSERT_EQ(eliminated.sum->sum(potentials, expected_log_partition, expected, stop), Termination::kCompleted);
    EXPECT_NEAR(log_partition, expected_log_partition, 1e-9);
    for (std::size_t e = 0; e < expected.size(); ++e) EXPECT_NEAR(beliefs[e], expected[e], 1e-9) << "entry " << e;
    searched = searched || log_partition != expected_log_partition;
  }
  EXPECT_TRUE(searched);
}

TEST(ComponentSum, SaysWhyThereIsNone) {
  Monitor monitor;
  const StopCondition stop(monitor);
  NetworkBuilder builder;
  const WeightId weight = builder.add_weight({});
  std::vector<Literal> atoms;
  for (int i = 0; i < 70; ++i) atoms.push_back(Literal::atom(builder.first_atom(builder.add_boolean())));
  for (std::size_t i = 0; i < atoms.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) builder.add_feature(builder.make_iff(atoms[i], atoms[j]), 0.1, weight);
  }
  // Three booleans of which no two are equal: propagation alone does not see it.
  std::vector<Literal> three;
  for (int i = 0; i < 3; ++i) three.push_back(Literal::atom(builder.first_atom(builder.add_boolean())));
  for (std::size_t i = 0; i < 3; ++i)
    builder.add_constraint(~builder.make_iff(three[i], three[(i + 1) % 3]), FormulaId(0));
  const GroundNetwork network = builder.build();
  const CompiledComponent wide = compile_component_sum(network, network.component_of(atoms[0]), {}, stop);
  EXPECT_EQ(wide.termination, Termination::kTooWide);
  EXPECT_NE(wide.message.find("entries (limit 2^24)"), std::string::npos) << wide.message;
  const CompiledComponent impossible = compile_component_sum(network, network.component_of(three[0]), {}, stop);
  EXPECT_EQ(impossible.termination, Termination::kNoPossibleWorld);
  EXPECT_EQ(impossible.conflict.size(), 3u);
}

}  // namespace
}  // namespace sherlog
