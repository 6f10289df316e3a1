// exact against its slow twin: random networks, every marginal, the partition sum, the best world, every conflict.
#include "inference/exact.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <numeric>
#include <random>
#include <string>

#include "inference/conflict.h"
#include "tests/oracles/enumeration.h"

namespace sherlog {
namespace {

int random_models() {
  const char* wanted = std::getenv("SHERLOG_RANDOM_MODELS");
  return wanted != nullptr ? std::max(1, std::atoi(wanted)) : 200;
}

// A different kind of network for each number: small and large, hard and soft, blocks and booleans, short and long
// formulas.
GroundNetwork make_network(int number) {
  std::mt19937_64 random(static_cast<std::uint64_t>(number) * 7919 + 1);
  oracle::RandomNetworkOptions options;
  options.variables = 2 + static_cast<std::uint32_t>(random() % 9);
  options.features = 1 + static_cast<std::uint32_t>(random() % 15);
  options.constraints = static_cast<std::uint32_t>(random() % 9);
  options.block_share = static_cast<double>(random() % 3) * 0.3;
  options.weight = random() % 10 == 0 ? 60.0 : 2.5;
  options.max_inputs = 2 + static_cast<std::uint32_t>(random() % 7);
  return oracle::random_network(random, options);
}

struct Setting {
  Monitor monitor;
  StopCondition stop{monitor};
  InferenceOptions options;
  std::vector<ComponentId> components;

  explicit Setting(const GroundNetwork& network) {
    for (std::size_t c = 0; c < network.component_count(); ++c) components.emplace_back(c);
    options.threads = 1;
  }
  MethodContext context(const GroundNetwork& network, std::span<const double> bias = {}) const {
    return {network, components, options, stop, bias};
  }
};

// Every subset that leaves one out can be met; the set itself cannot. By enumeration of the worlds.
void expect_minimal_conflict(const GroundNetwork& network, const std::vector<std::uint32_t>& conflict) {
  ASSERT_FALSE(conflict.empty());
  std::vector<std::uint32_t> values(network.variable_count(), 0);
  std::vector<bool> met_without(conflict.size(), false);
  while (true) {
    std::size_t broken = 0, which = 0;
    for (std::size_t i = 0; i < conflict.size(); ++i) {
      if (oracle::evaluate(network, network.constraints()[conflict[i]].literal, values)) continue;
      ++broken;
      which = i;
    }
    ASSERT_GT(broken, 0u) << "a world meets the whole conflict";
    if (broken == 1) met_without[which] = true;
    std::size_t d = 0;
    while (d < values.size() && ++values[d] == network.value_count(VariableId(d))) values[d++] = 0;
    if (d == values.size()) break;
  }
  for (std::size_t i = 0; i < conflict.size(); ++i)
    EXPECT_TRUE(met_without[i]) << "constraint " << conflict[i] << " is not needed";
}

TEST(Exact, EqualsEnumerationOnRandomNetworks) {
  int possible = 0;
  for (int number = 0; number < random_models(); ++number) {
    SCOPED_TRACE("network " + std::to_string(number));
    const GroundNetwork network = make_network(number);
    const oracle::Enumeration expected = oracle::enumerate(network);
    const Setting setting(network);
    const MethodResult result = run_exact(setting.context(network));
    if (!expected.possible) {
      ASSERT_EQ(result.termination, Termination::kNoPossibleWorld);
      expect_minimal_conflict(network, result.conflict);
      continue;
    }
    ++possible;
    ASSERT_EQ(result.termination, Termination::kCompleted) << result.message;
    ASSERT_TRUE(result.log_partition.has_value());
    const double log_partition = *result.log_partition + network.constant_score() + network.free_log_count();
    EXPECT_NEAR(log_partition, expected.log_partition, 1e-9 * (1.0 + std::abs(expected.log_partition)));
    ASSERT_EQ(result.marginals.size(), expected.marginals.size());
    for (std::size_t q = 0; q < expected.marginals.size(); ++q) {
      if (network.queries()[q].literal.is_constant()) continue;  // belongs to no component
      EXPECT_NEAR(result.marginals[q].probability, expected.marginals[q], 1e-9) << "query " << q;
    }
  }
  EXPECT_GT(possible, random_models() / 3);
}

TEST(Exact, BestWorldEqualsEnumerationOnRandomNetworks) {
  for (int number = 0; number < random_models(); ++number) {
    SCOPED_TRACE("network " + std::to_string(number));
    const GroundNetwork network = make_network(number);
    const oracle::Enumeration expected = oracle::enumerate(network);
    const Setting setting(network);
    const MethodResult result = run_exact_map(setting.context(network));
    if (!expected.possible) {
      ASSERT_EQ(result.termination, Termination::kNoPossibleWorld);
      continue;
    }
    ASSERT_EQ(result.termination, Termination::kCompleted) << result.message;
    EXPECT_NEAR(result.map_score + network.constant_score(), expected.best_score,
                1e-9 * (1.0 + std::abs(expected.best_score)));
    EXPECT_EQ(result.map_bound, result.map_score);
    const auto score = oracle::score(network, result.values);
    ASSERT_TRUE(score.has_value()) << "the best world breaks a constraint";
    EXPECT_NEAR(*score, expected.best_score, 1e-9 * (1.0 + std::abs(expected.best_score)));
  }
}

TEST(Exact, ABiasActsLikeAFeatureOnTheAtom) {
  // Odds are multiplied: P'(a) / P'(not a) = e^b P(a) / P(not a), for a bias on the first atom alone.
  int checked = 0;
  for (int number = 0; number < random_models() / 4; ++number) {
    SCOPED_TRACE("network " + std::to_string(number));
    const GroundNetwork network = make_network(number);
    const oracle::Enumeration expected = oracle::enumerate(network);
    if (!expected.possible) continue;
    std::vector<double> bias(network.atom_count(), 0.0);
    bias[0] = 0.7;
    const Setting setting(network);
    const MethodResult result = run_exact(setting.context(network, bias));
    ASSERT_EQ(result.termination, Termination::kCompleted);
    for (std::size_t q = 0; q < network.queries().size(); ++q) {
      if (network.queries()[q].literal != Literal::atom(AtomId(0))) continue;
      const double p = expected.atom_marginals[0];
      EXPECT_NEAR(result.marginals[q].probability, p * std::exp(0.7) / (p * std::exp(0.7) + 1.0 - p), 1e-9);
      EXPECT_NEAR(*result.log_partition + network.constant_score() + network.free_log_count(),
                  expected.log_partition + std::log(p * std::exp(0.7) + 1.0 - p), 1e-8);
      ++checked;
    }
  }
  EXPECT_GT(checked, 0);
}

TEST(Exact, IsTheSameBitsForAnyNumberOfThreads) {
  for (int number = 0; number < 20; ++number) {
    const GroundNetwork network = make_network(number);
    Setting setting(network);
    const MethodResult one = run_exact(setting.context(network));
    setting.options.threads = 4;
    const MethodResult four = run_exact(setting.context(network));
    EXPECT_EQ(one.termination, four.termination);
    EXPECT_EQ(one.log_partition, four.log_partition);
    if (one.termination != Termination::kCompleted) continue;
    for (std::size_t q = 0; q < one.marginals.size(); ++q) {
      EXPECT_EQ(one.marginals[q].probability, four.marginals[q].probability);
    }
  }
}

TEST(Conflict, SearchAgreesWithEnumerationOnRandomConstraints) {
  for (int number = 0; number < random_models(); ++number) {
    SCOPED_TRACE("network " + std::to_string(number));
    const GroundNetwork network = make_network(number);
    Monitor monitor;
    const StopCondition stop(monitor);
    std::vector<std::uint32_t> all(network.constraints().size());
    std::iota(all.begin(), all.end(), 0u);
    const auto answer = check_constraints(network, all, 100000, stop);
    ASSERT_TRUE(answer.has_value());
    EXPECT_EQ(answer->possible, oracle::enumerate(network).possible);
  }
}

}  // namespace
}  // namespace sherlog
