#include "inference/world.h"

#include <gtest/gtest.h>

#include "inference/rng.h"
#include "tests/oracles/enumeration.h"

namespace sherlog {
namespace {

TEST(World, IncrementalCountsAndScoreEqualARecountOnRandomNetworks) {
  std::mt19937_64 random(11);
  for (int round = 0; round < 200; ++round) {
    const GroundNetwork network = oracle::random_network(random);
    const WorldIndex index(network);
    World world(index);
    Rng rng(3, static_cast<std::uint64_t>(round));
    for (int step = 0; step < 50; ++step) {
      const VariableId v(rng.below(static_cast<std::uint32_t>(network.variable_count())));
      const double before = world.score();
      const double change = world.set(v, rng.below(network.value_count(v)));
      ASSERT_NEAR(world.score(), before + change, 1e-9);
      ASSERT_TRUE(world.check());
      const std::vector<std::uint32_t> values(world.values().begin(), world.values().end());
      const auto expected = oracle::score(network, values);
      ASSERT_EQ(world.broken().empty(), expected.has_value());
      if (expected) {
        ASSERT_NEAR(world.score() + network.constant_score(), *expected, 1e-9);
      }
    }
  }
}

TEST(World, APeekSaysWhatAFlipWouldDo) {
  std::mt19937_64 random(12);
  for (int round = 0; round < 200; ++round) {
    const GroundNetwork network = oracle::random_network(random);
    const WorldIndex index(network);
    World world(index);
    Rng rng(4, static_cast<std::uint64_t>(round));
    for (int step = 0; step < 50; ++step) {
      const VariableId v(rng.below(static_cast<std::uint32_t>(network.variable_count())));
      world.set(v, rng.below(network.value_count(v)));
      const std::uint32_t atom = rng.below(index.atom_count());
      const std::size_t broken = world.broken().size();
      if (broken > 0) continue;
      const double peek = world.peek(atom);
      const double change = world.flip_atom(atom);
      if (world.broken().size() > 0) {
        EXPECT_EQ(peek, World::kBreaks);
      } else {
        EXPECT_NEAR(peek, change, 1e-9);
      }
      world.flip_atom(atom);
      ASSERT_TRUE(world.check());
    }
  }
}

}  // namespace
}  // namespace sherlog
