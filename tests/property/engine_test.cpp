// From text to answers: random models, read, grounded and answered by every method, against the definition of the semantics.
// SHERLOG_RANDOM_MODELS sets how many (default 200), SHERLOG_RANDOM_SEED the first seed.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "grounding/ground.h"
#include "inference/inference.h"
#include "mln/query.h"
#include "tests/oracles/naive_semantics.h"
#include "tests/oracles/random_model.h"

namespace sherlog {
namespace {

std::uint64_t number_from_environment(const char* name, std::uint64_t otherwise) {
  const char* text = std::getenv(name);
  return text == nullptr ? otherwise : std::strtoull(text, nullptr, 10);
}

struct Coverage {
  std::size_t intervals = 0, covered = 0;
};

void compare_exact(const oracle::NaiveAnswer& naive, const InferenceResult& result) {
  ASSERT_EQ(result.termination, Termination::kCompleted) << result.message;
  EXPECT_NEAR(*result.log_partition, naive.log_partition, 1e-9 * std::max(1.0, std::abs(naive.log_partition)));
  ASSERT_EQ(result.marginals.size(), naive.marginals.size());
  for (std::size_t i = 0; i < naive.marginals.size(); ++i) {
    EXPECT_NEAR(result.marginals[i].probability, naive.marginals[i].second, 1e-9) << naive.marginals[i].first;
  }
}

void compare_sampled(const oracle::NaiveAnswer& naive, const InferenceResult& result, Coverage& coverage) {
  ASSERT_EQ(result.termination, Termination::kCompleted) << result.message;
  for (std::size_t i = 0; i < naive.marginals.size(); ++i) {
    const double p = naive.marginals[i].second;
    const Marginal& m = result.marginals[i];
    EXPECT_NEAR(m.probability, p, 0.02) << result.method << ": " << naive.marginals[i].first;
    if (!m.mcse || p < 0.01 || p > 0.99) continue;  // decided formulas; normal intervals mean little near 0 and 1
    ++coverage.intervals;
    if (std::abs(m.probability - p) <= 1.96 * *m.mcse) ++coverage.covered;
  }
}

void compare_all(const oracle::NaiveAnswer& naive, const GroundNetwork& network, std::uint64_t seed,
                 Coverage& coverage) {
  Monitor monitor;
  for (const char* method : {"exact", "auto", "matching", "mcsat", "gibbs", "map"}) {
    SCOPED_TRACE(method);
    InferenceOptions options;
    options.method = method;
    options.seed = seed;
    const InferenceResult result = infer(network, options, monitor);
    if (result.termination == Termination::kRefused && (options.method == "gibbs" || options.method == "matching")) {
      continue;
    }
    if (!naive.possible) {
      EXPECT_EQ(result.termination, Termination::kNoPossibleWorld) << result.message;
    } else if (options.method == "map") {
      ASSERT_TRUE(result.map.has_value()) << result.message;
      EXPECT_TRUE(result.map->optimal) << "gap " << result.map->gap;
      EXPECT_NEAR(result.map->log_score, naive.best_score, 1e-7 * std::max(1.0, std::abs(naive.best_score)));
    } else if (options.method == "exact" || options.method == "auto" || options.method == "matching") {
      compare_exact(naive, result);
    } else {
      compare_sampled(naive, result, coverage);
    }
  }
}

TEST(Engine, EveryMethodAnswersRandomModelsAsTheSemanticsSays) {
  const std::uint64_t count = number_from_environment("SHERLOG_RANDOM_MODELS", 200);
  const std::uint64_t first = number_from_environment("SHERLOG_RANDOM_SEED", 5000);
  Coverage coverage;
  std::size_t compared = 0;
  for (std::uint64_t seed = first; seed < first + count; ++seed) {
    std::mt19937_64 random(seed);
    const oracle::RandomModel text = oracle::random_model(random);
    SCOPED_TRACE("seed " + std::to_string(seed) + "\n" + text.model + "--- evidence\n" + text.evidence);
    Diagnostics diagnostics;
    const auto model = parse_model(text.model, "random.mln", diagnostics);
    if (!model) continue;  // a hard contradiction
    const auto databases = parse_evidence(*model, text.evidence, "random.db", diagnostics);
    ASSERT_TRUE(databases) << diagnostics.render();
    const auto query = parse_query(*model, databases->front(), text.queries, diagnostics);
    ASSERT_TRUE(query) << diagnostics.render();
    GroundingOptions options;
    options.open_world_all = text.open_world_all;
    for (const std::string& name : text.open_world) options.open_world.push_back(*model->find_predicate(name));
    Monitor monitor;
    const GroundingResult grounding = ground(*model, databases->front(), *query, options, monitor);
    if (!grounding.network) continue;  // a conflict: the grounder's own test
    const auto naive = oracle::naive_semantics(*model, databases->front(), *query, options);
    if (!naive) continue;  // too large to enumerate
    compare_all(*naive, *grounding.network, seed, coverage);
    ++compared;
  }
  EXPECT_GT(compared, count / 3);
  if (coverage.intervals > 500) {
    const double share = static_cast<double>(coverage.covered) / static_cast<double>(coverage.intervals);
    EXPECT_GE(share, 0.90);
    EXPECT_LE(share, 0.98);
  }
}

}  // namespace
}  // namespace sherlog
