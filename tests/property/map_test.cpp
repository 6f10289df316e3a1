// The map method against enumeration, on random networks: it always finds a best world and proves it.
// SHERLOG_RANDOM_MODELS sets how many networks are drawn.
#include "inference/map.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <random>
#include <string>
#include <vector>

#include "tests/oracles/enumeration.h"

namespace sherlog {
namespace {

int model_count() {
  const char* text = std::getenv("SHERLOG_RANDOM_MODELS");
  return text != nullptr ? std::max(1, std::atoi(text)) : 200;
}

void compare(const GroundNetwork& network, const std::string& label) {
  SCOPED_TRACE(label);
  Monitor monitor;
  const StopCondition stop(monitor);
  std::vector<ComponentId> components;
  for (std::size_t c = 0; c < network.component_count(); ++c) components.push_back(ComponentId(c));
  const InferenceOptions options;
  const MethodResult result = run_map({network, components, options, stop, {}});
  const auto truth = oracle::enumerate(network);
  if (!truth.possible) {
    EXPECT_EQ(result.termination, Termination::kNoPossibleWorld);
    EXPECT_FALSE(result.conflict.empty());
    return;
  }
  ASSERT_EQ(result.termination, Termination::kCompleted) << result.message;
  const auto score = oracle::score(network, result.values);
  ASSERT_TRUE(score.has_value()) << "the world breaks a hard formula";
  EXPECT_NEAR(*score, truth.best_score, 1e-6);
  EXPECT_NEAR(result.map_score + network.constant_score(), *score, 1e-9);
  EXPECT_EQ(result.map_bound, result.map_score) << "not proved";
}

TEST(MapProperty, EqualsEnumerationOnRandomNetworks) {
  for (int i = 0; i < model_count(); ++i) {
    std::mt19937_64 random(static_cast<std::uint64_t>(i) + 1000);
    oracle::RandomNetworkOptions shape;
    shape.variables = 3 + static_cast<std::uint32_t>(random() % 7);
    shape.features = static_cast<std::uint32_t>(random() % 18);
    shape.constraints = static_cast<std::uint32_t>(random() % 6);
    compare(oracle::random_network(random, shape), "network " + std::to_string(i));
  }
}

TEST(MapProperty, EqualsEnumerationOnWideBooleanNetworks) {
  // Enough atoms that the component is not tiny, and dense: minimum cut, integer program and search have to answer.
  for (int i = 0; i < model_count() / 10; ++i) {
    std::mt19937_64 random(static_cast<std::uint64_t>(i) + 5000);
    oracle::RandomNetworkOptions shape;
    shape.variables = 14;
    shape.features = 40;
    shape.constraints = 4;
    shape.block_share = 0.0;
    shape.max_inputs = 2 + static_cast<std::uint32_t>(random() % 3);
    compare(oracle::random_network(random, shape), "wide network " + std::to_string(i));
  }
}

}  // namespace
}  // namespace sherlog
