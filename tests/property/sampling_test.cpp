// The sampling methods against enumeration on random networks, and against dynamic programming on models that no enumeration
// reaches.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>

#include "inference/exact.h"
#include "inference/inference.h"
#include "tests/oracles/enumeration.h"

namespace sherlog {
namespace {

int random_models() {
  const char* text = std::getenv("SHERLOG_RANDOM_MODELS");
  return text == nullptr ? 200 : std::atoi(text);
}

InferenceOptions options_for(const char* method) {
  InferenceOptions options;
  options.method = method;
  options.samples = 20000;
  return options;
}

// Errors within 0.02, and 95 % intervals that cover the truth in 90-98 % of the cases (all models together).
void compare_with_enumeration(const char* method) {
  std::mt19937_64 random(2024);
  Monitor monitor;
  std::size_t intervals = 0, covered = 0, answered = 0;
  for (int round = 0; round < random_models(); ++round) {
    oracle::RandomNetworkOptions shape;
    shape.variables = 4 + static_cast<std::uint32_t>(round % 7);
    shape.constraints = static_cast<std::uint32_t>(round % 5);
    shape.weight = round % 3 == 0 ? 4.0 : 2.0;
    const GroundNetwork network = oracle::random_network(random, shape);
    const oracle::Enumeration truth = oracle::enumerate(network);
    const InferenceResult result = infer(network, options_for(method), monitor);
    if (result.termination == Termination::kRefused) {
      EXPECT_STREQ(method, "gibbs");
      EXPECT_FALSE(result.message.empty());
      continue;
    }
    if (!truth.possible) {
      EXPECT_EQ(result.termination, Termination::kNoPossibleWorld) << "round " << round;
      continue;
    }
    ASSERT_EQ(result.termination, Termination::kCompleted) << "round " << round << ": " << result.message;
    ++answered;
    for (std::size_t q = 0; q < network.queries().size(); ++q) {
      const Marginal& m = result.marginals[q];
      if (network.queries()[q].literal.is_constant()) continue;
      EXPECT_NEAR(m.probability, truth.marginals[q], 0.02) << method << ", round " << round << ", query " << q;
      const double p = truth.marginals[q];
      if (p < 0.01 || p > 0.99) continue;  // normal intervals mean little there
      ++intervals;
      if (std::abs(m.probability - p) <= 1.96 * *m.mcse) ++covered;
    }
  }
  EXPECT_GT(answered, 0u);
  // Below some hundred intervals the share itself is too uncertain to be judged.
  if (intervals > 500) {
    const double share = static_cast<double>(covered) / static_cast<double>(intervals);
    EXPECT_GE(share, 0.90) << method;
    EXPECT_LE(share, 0.98) << method;
  }
}

TEST(McSat, IsNearEnumerationWithHonestErrorsOnRandomNetworks) { compare_with_enumeration("mcsat"); }
TEST(Gibbs, IsNearEnumerationWithHonestErrorsOnRandomNetworksOrRefuses) { compare_with_enumeration("gibbs"); }

// An attractive or mixed pair network on a graph, with fields; queried everywhere.
GroundNetwork pairs(std::uint32_t variables, const std::vector<std::pair<std::uint32_t, std::uint32_t>>& edges,
                    double coupling, std::uint64_t seed) {
  NetworkBuilder builder;
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  for (std::uint32_t v = 0; v < variables; ++v) builder.add_boolean();
  const WeightId weight = builder.add_weight({FormulaId(0), {}, 1.0});
  for (std::uint32_t v = 0; v < variables; ++v) {
    builder.add_feature(Literal::atom(AtomId(v)), uniform(random), weight);
    builder.add_query({Literal::atom(AtomId(v)), false, ""});
  }
  for (const auto& [a, b] : edges) {
    builder.add_feature(builder.make_iff(Literal::atom(AtomId(a)), Literal::atom(AtomId(b))),
                        coupling * uniform(random), weight);
  }
  return builder.build();
}

double largest_error(const GroundNetwork& network, const InferenceResult& a, const InferenceResult& b) {
  double error = 0.0;
  for (std::size_t q = 0; q < network.queries().size(); ++q) {
    error = std::max(error, std::abs(a.marginals[q].probability - b.marginals[q].probability));
  }
  return error;
}

// A torus of 16 x 16: its induced width of 32 is beyond the joint blocks, not beyond `exact` on a machine with patience; here the
// reference is a grid of 10 x 60, which exact still does and one block does not.
TEST(McSat, IsNearExactOnAGridTooWideForOneBlock) {
  std::vector<std::pair<std::uint32_t, std::uint32_t>> edges;
  const std::uint32_t rows = 14, columns = 30;
  for (std::uint32_t r = 0; r < rows; ++r) {
    for (std::uint32_t c = 0; c < columns; ++c) {
      if (c + 1 < columns) edges.emplace_back(r * columns + c, r * columns + c + 1);
      if (r + 1 < rows) edges.emplace_back(r * columns + c, (r + 1) * columns + c);
    }
  }
  const GroundNetwork network = pairs(rows * columns, edges, 2.0, 5);
  Monitor monitor;
  const InferenceResult exact = infer(network, options_for("exact"), monitor);
  ASSERT_EQ(exact.termination, Termination::kCompleted) << exact.message;
  for (const char* method : {"mcsat", "gibbs"}) {
    const InferenceResult sampled = infer(network, options_for(method), monitor);
    ASSERT_EQ(sampled.termination, Termination::kCompleted) << sampled.message;
    EXPECT_LT(largest_error(network, exact, sampled), 0.05) << method;
  }
}

TEST(Samplers, GiveTheSameBitsForAnyNumberOfThreads) {
  std::mt19937_64 random(9);
  Monitor monitor;
  for (int round = 0; round < 5; ++round) {
    const GroundNetwork network = oracle::random_network(random, {.variables = 10, .constraints = 2});
    for (const char* method : {"mcsat", "gibbs"}) {
      InferenceOptions options = options_for(method);
      options.samples = 500;
      options.threads = 1;
      const InferenceResult one = infer(network, options, monitor);
      options.threads = 3;
      const InferenceResult three = infer(network, options, monitor);
      ASSERT_EQ(one.termination, three.termination);
      for (std::size_t q = 0; q < one.marginals.size(); ++q) {
        EXPECT_EQ(one.marginals[q].probability, three.marginals[q].probability);
        EXPECT_EQ(one.marginals[q].mcse, three.marginals[q].mcse);
      }
    }
  }
}

}  // namespace
}  // namespace sherlog
