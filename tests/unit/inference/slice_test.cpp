#include "inference/slice.h"

#include <gtest/gtest.h>

#include <cmath>
#include <map>

#include "inference/ergodicity.h"
#include "inference/joint_block.h"
#include "inference/sample_sat.h"
#include "tests/oracles/enumeration.h"

namespace sherlog {
namespace {

std::vector<VariableId> all_variables(const GroundNetwork& network) {
  std::vector<VariableId> variables;
  for (std::uint32_t v = 0; v < network.variable_count(); ++v) variables.emplace_back(v);
  return variables;
}

// Slice steps alone leave the distribution unchanged: from worlds drawn from it exactly, one step later the marginals are the same.
TEST(SliceStep, LeavesTheDistributionUnchangedOnRandomNetworks) {
  std::mt19937_64 random(41);
  int tested = 0;
  for (int round = 0; round < 40; ++round) {
    const GroundNetwork network =
        oracle::random_network(random, {.variables = 7, .constraints = static_cast<std::uint32_t>(round % 3)});
    const oracle::Enumeration truth = oracle::enumerate(network);
    if (!truth.possible) continue;
    const WorldIndex index(network);
    World world(index);
    Rng rng(12, static_cast<std::uint64_t>(round));
    const std::vector<VariableId> variables = all_variables(network);
    auto exact = JointBlock::make(index, variables, 1e6);
    ASSERT_TRUE(exact.has_value());
    const std::vector<std::uint32_t> numbers = number_within(network, variables);
    const SliceStep slice(index, variables, numbers, false);
    SliceStep::Scratch scratch;
    JointBlock::Workspace workspace;
    const int draws = 4000;
    std::vector<double> seen(network.atom_count(), 0.0);
    for (int i = 0; i < draws; ++i) {
      ASSERT_TRUE(exact->draw(world, rng, workspace));
      slice.step(world, rng, scratch);
      ASSERT_TRUE(world.broken().empty());
      for (std::uint32_t a = 0; a < seen.size(); ++a) seen[a] += world.is_true(a) ? 1.0 : 0.0;
    }
    EXPECT_TRUE(world.check());
    for (std::size_t a = 0; a < seen.size(); ++a) {
      const double p = truth.atom_marginals[a];
      EXPECT_NEAR(seen[a] / draws, p, 5.0 * std::sqrt(p * (1 - p) / draws) + 1e-9)
          << "round " << round << ", atom " << a;
    }
    ++tested;
  }
  EXPECT_GT(tested, 20);
}

TEST(SampleSat, FindsAWorldOfRandomHardFormulasWhereThereIsOne) {
  std::mt19937_64 random(42);
  int found = 0;
  for (int round = 0; round < 100; ++round) {
    const GroundNetwork network = oracle::random_network(random, {.variables = 9, .features = 0, .constraints = 8});
    const bool possible = oracle::enumerate(network).possible;
    const WorldIndex index(network);
    World world(index);
    Rng rng(13, static_cast<std::uint64_t>(round));
    const std::vector<VariableId> variables = all_variables(network);
    const bool success = sample_sat(world, rng, variables, 20000);
    EXPECT_EQ(success, possible) << "round " << round;
    if (success) {
      const std::vector<std::uint32_t> values(world.values().begin(), world.values().end());
      EXPECT_TRUE(oracle::score(network, values).has_value());
      ++found;
    }
  }
  EXPECT_GT(found, 20);
}

// x v y with hard formulas has three worlds; a biased sampler is off 1/3 by several hundredths.
TEST(SampleSat, TheSliceOfAThreeWorldModelIsUniform) {
  NetworkBuilder builder;
  const Literal x = Literal::atom(builder.first_atom(builder.add_boolean()));
  const Literal y = Literal::atom(builder.first_atom(builder.add_boolean()));
  std::vector<Literal> inputs{x, y};
  builder.add_constraint(builder.make_or(inputs), FormulaId(0));
  const GroundNetwork network = builder.build();
  const WorldIndex index(network);
  World world(index);
  world.set(VariableId(0), 0);
  Rng rng(14, 0);
  const std::vector<VariableId> variables = all_variables(network);
  const std::vector<std::uint32_t> numbers = number_within(network, variables);
  const SliceStep slice(index, variables, numbers, false);
  SliceStep::Scratch scratch;
  double both = 0.0;
  const int draws = 20000;
  for (int i = 0; i < draws; ++i) {
    slice.step(world, rng, scratch);
    both += world.is_true(x) && world.is_true(y) ? 1.0 : 0.0;
  }
  EXPECT_NEAR(both / draws, 1.0 / 3.0, 0.01);  // 3 standard errors of independent draws
}

// Single changes reach every world: decided by brute force over the worlds of random networks.
TEST(Ergodicity, AgreesWithASearchOverAllWorlds) {
  std::mt19937_64 random(43);
  int connected_count = 0, apart_count = 0;
  for (int round = 0; round < 300; ++round) {
    const GroundNetwork network = oracle::random_network(random, {.variables = 6, .features = 0, .constraints = 4});
    if (!oracle::enumerate(network).possible) continue;
    std::map<std::vector<std::uint32_t>, bool> worlds;  // reached?
    std::vector<std::uint32_t> values(network.variable_count(), 0);
    for (bool more = true; more;) {
      if (oracle::score(network, values)) worlds[values] = false;
      more = false;
      for (std::size_t v = 0; v < values.size() && !more; ++v) {
        values[v] = values[v] + 1 < network.value_count(VariableId(v)) ? values[v] + 1 : 0;
        more = values[v] != 0;
      }
    }
    std::vector<std::vector<std::uint32_t>> stack{worlds.begin()->first};
    worlds.begin()->second = true;
    std::size_t reached = 1;
    while (!stack.empty()) {
      const auto world = stack.back();
      stack.pop_back();
      for (std::size_t v = 0; v < world.size(); ++v) {
        auto other = world;
        for (other[v] = 0; other[v] < network.value_count(VariableId(v)); ++other[v]) {
          const auto found = worlds.find(other);
          if (found == worlds.end() || found->second) continue;
          found->second = true;
          ++reached;
          stack.push_back(other);
        }
      }
    }
    bool claimed = true;
    ErgodicityBudget budget;
    for (std::size_t c = 0; c < network.component_count(); ++c) {
      claimed = claimed && single_moves_reach_every_world(network, ComponentId(c), budget);
    }
    EXPECT_EQ(claimed, reached == worlds.size()) << "round " << round;
    ++(reached == worlds.size() ? connected_count : apart_count);
  }
  EXPECT_GT(connected_count, 10);
  EXPECT_GT(apart_count, 10);
}

}  // namespace
}  // namespace sherlog
