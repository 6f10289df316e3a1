#include "inference/joint_block.h"

#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <numeric>

#include "inference/block_cover.h"
#include "tests/oracles/enumeration.h"

namespace sherlog {
namespace {

// Puts the World at a random possible world; false where there is none.
bool place(World& world, const GroundNetwork& network, Rng& rng) {
  std::vector<std::vector<std::uint32_t>> possible;
  std::vector<std::uint32_t> values(network.variable_count(), 0);
  for (bool more = true; more;) {
    if (oracle::score(network, values)) possible.push_back(values);
    more = false;
    for (std::size_t v = 0; v < values.size() && !more; ++v) {
      values[v] = values[v] + 1 < network.value_count(VariableId(v)) ? values[v] + 1 : 0;
      more = values[v] != 0;
    }
  }
  if (possible.empty()) return false;
  world.assign(possible[rng.below(static_cast<std::uint32_t>(possible.size()))]);
  return true;
}

// The share of each assignment of `moving` among many draws, against the product of the formulas given the rest.
template <class Step>
void expect_conditional(const GroundNetwork& network, World& world, const std::vector<VariableId>& moving, Step step) {
  std::map<std::vector<std::uint32_t>, double> expected, seen;
  std::vector<std::uint32_t> values(world.values().begin(), world.values().end());
  for (VariableId v : moving) values[v.index()] = 0;
  double total = 0.0;
  for (bool more = true; more;) {
    if (const auto s = oracle::score(network, values)) total += expected[values] = std::exp(*s);
    more = false;
    for (std::size_t i = 0; i < moving.size() && !more; ++i) {
      std::uint32_t& value = values[moving[i].index()];
      value = value + 1 < network.value_count(moving[i]) ? value + 1 : 0;
      more = value != 0;
    }
  }
  const int draws = 4000;
  for (int i = 0; i < draws; ++i) {
    step();
    ++seen[{world.values().begin(), world.values().end()}];
  }
  for (const auto& [key, count] : seen) ASSERT_TRUE(expected.contains(key)) << "an impossible world was drawn";
  for (const auto& [key, weight] : expected) {
    const double p = weight / total;
    EXPECT_NEAR(seen[key] / draws, p, 5.0 * std::sqrt(p * (1 - p) / draws) + 1e-3);
  }
}

TEST(JointBlock, DrawsFromTheConditionalDistributionOnRandomNetworks) {
  std::mt19937_64 random(31);
  int drawn = 0;
  for (int round = 0; round < 60; ++round) {
    const GroundNetwork network = oracle::random_network(random, {.variables = 7, .constraints = 2});
    const WorldIndex index(network);
    World world(index);
    Rng rng(8, static_cast<std::uint64_t>(round));
    if (!place(world, network, rng)) continue;
    std::vector<VariableId> moving;
    for (std::uint32_t v = 0; v < 7; ++v) {
      if (rng.coin()) moving.emplace_back(v);
    }
    if (moving.empty() || moving.size() > 4) continue;
    JointBlock::Workspace workspace;
    auto block = JointBlock::make(index, moving, 1e6);
    ASSERT_TRUE(block.has_value());
    expect_conditional(network, world, moving, [&] { ASSERT_TRUE(block->draw(world, rng, workspace)); });
    ++drawn;
  }
  EXPECT_GT(drawn, 15);
}

TEST(GibbsStep, DrawsFromTheConditionalDistributionOnRandomNetworks) {
  std::mt19937_64 random(32);
  std::vector<double> scratch;
  for (int round = 0; round < 60; ++round) {
    const GroundNetwork network = oracle::random_network(random, {.variables = 6, .constraints = 2});
    const WorldIndex index(network);
    World world(index);
    Rng rng(9, static_cast<std::uint64_t>(round));
    if (!place(world, network, rng)) continue;
    const VariableId v(rng.below(6));
    expect_conditional(network, world, {v}, [&] { gibbs_step(world, v, rng, false, scratch); });
    EXPECT_TRUE(world.check());
  }
}

// At most one of twelve literals and a soft long disjunction over them: both become chains.
TEST(JointBlock, CutsLongGatesIntoChains) {
  NetworkBuilder builder;
  std::vector<Literal> all;
  const WeightId weight = builder.add_weight({FormulaId(0), {}, 1.0});
  for (int i = 0; i < 12; ++i) {
    all.push_back(Literal::atom(builder.first_atom(builder.add_boolean())));
    builder.add_feature(all.back(), 0.1 * i, weight);
  }
  const Literal extra = Literal::atom(builder.first_atom(builder.add_boolean()));
  std::vector<Literal> inputs = all;
  builder.add_feature(builder.make_iff(extra, builder.make_or(inputs)), 1.5, weight);
  builder.add_constraint(builder.make_at_most_one(all), FormulaId(0));
  const GroundNetwork network = builder.build();
  const WorldIndex index(network);
  World world(index);
  Rng rng(10, 0);
  std::vector<VariableId> everything;
  for (std::uint32_t v = 0; v < network.variable_count(); ++v) everything.emplace_back(v);
  JointBlock::Workspace workspace;
  auto block = JointBlock::make(index, everything, 4096);
  ASSERT_TRUE(block.has_value());
  EXPECT_TRUE(block->self_contained());
  expect_conditional(network, world, everything, [&] { ASSERT_TRUE(block->draw(world, rng, workspace)); });
  // Half of it, with one of the others true: then none of these may be.
  world.set(VariableId(0), 0);
  for (std::uint32_t v = 1; v < 12; ++v) world.set(VariableId(v), 1);
  const std::vector<VariableId> half(everything.begin() + 6, everything.end());
  auto part = JointBlock::make(index, half, 4096);
  ASSERT_TRUE(part.has_value());
  EXPECT_FALSE(part->self_contained());
  expect_conditional(network, world, half, [&] { ASSERT_TRUE(part->draw(world, rng, workspace)); });
}

// The inner equivalence is read through by the first formula and gets a variable of its own for the second, wide one.
TEST(JointBlock, AFormulaSharedByANarrowAndAWideOneIsReadRightByBoth) {
  NetworkBuilder builder;
  const auto value = [&](VariableId v, std::uint32_t i) {
    return Literal::atom(AtomId(builder.first_atom(v).value + i));
  };
  const VariableId x = builder.add_anonymous(3, false), y = builder.add_anonymous(4, false),
                   z = builder.add_anonymous(4, true);
  const Literal b = Literal::atom(builder.first_atom(builder.add_boolean()));
  const Literal c = Literal::atom(builder.first_atom(builder.add_boolean()));
  const WeightId weight = builder.add_weight({FormulaId(0), {}, 1.0});
  const Literal shared = builder.make_iff(value(x, 0), value(y, 0));
  std::vector<Literal> inputs{value(y, 2), ~b};
  builder.add_feature(builder.make_iff(builder.make_or(inputs), shared), -1.4, weight);
  inputs = {value(z, 1), value(z, 2), c};
  builder.add_feature(builder.make_iff(shared, builder.make_or(inputs)), -0.9, weight);
  const GroundNetwork network = builder.build();
  const WorldIndex index(network);
  World world(index);
  Rng rng(11, 0);
  std::vector<VariableId> everything;
  for (std::uint32_t v = 0; v < network.variable_count(); ++v) everything.emplace_back(v);
  JointBlock::Workspace workspace;
  auto block = JointBlock::make(index, everything, 1e5);
  ASSERT_TRUE(block.has_value());
  expect_conditional(network, world, everything, [&] { ASSERT_TRUE(block->draw(world, rng, workspace)); });
}

TEST(BlockCover, CoversEveryVariableOfAWideComponent) {
  NetworkBuilder builder;
  const std::uint32_t side = 30;
  for (std::uint32_t v = 0; v < side * side; ++v) builder.add_boolean();
  const WeightId weight = builder.add_weight({FormulaId(0), {}, 1.0});
  const auto atom = [&](std::uint32_t r, std::uint32_t c) { return Literal::atom(AtomId(r * side + c)); };
  for (std::uint32_t r = 0; r < side; ++r) {
    for (std::uint32_t c = 0; c < side; ++c) {
      if (c + 1 < side) builder.add_feature(builder.make_iff(atom(r, c), atom(r, c + 1)), 1.0, weight);
      if (r + 1 < side) builder.add_feature(builder.make_iff(atom(r, c), atom(r + 1, c)), 1.0, weight);
    }
  }
  const GroundNetwork network = builder.build();
  const WorldIndex index(network);
  Monitor monitor;
  const StopCondition stop(monitor);
  const auto variables = network.component_variables(ComponentId(0));
  const BlockCover cover = cover_component(index, variables, number_within(network, variables), 1, stop);
  EXPECT_FALSE(cover.whole);
  std::vector<int> covered(side * side, 0);
  for (const JointBlock& block : cover.blocks) {
    EXPECT_GT(block.variables().size(), 1u);
    for (VariableId v : block.variables()) ++covered[v.index()];
  }
  const auto uncovered = std::count(covered.begin(), covered.end(), 0);
  EXPECT_LT(uncovered, side * side / 20);
}

}  // namespace
}  // namespace sherlog
