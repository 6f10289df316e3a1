// Fuzzes the whole engine: any model, database and query that the language accepts is grounded and answered, or refused with
// a sentence; and where its worlds can be counted one by one, `exact` and `map` say what the definition says.
//
// The input is up to three texts with a 0x1f byte between them, as in language_fuzz.
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <string_view>

#include "grounding/ground.h"
#include "inference/inference.h"
#include "mln/evidence.h"
#include "mln/model.h"
#include "mln/query.h"
#include "tests/fuzz/texts.h"
#include "tests/oracles/naive_semantics.h"

namespace {

using namespace sherlog;
using fuzz::demand;

// What one input may cost: enough for every mistake, and many inputs a second.
constexpr std::size_t kMemory = std::size_t{64} << 20;
constexpr double kSeconds = 2.0;
constexpr oracle::NaiveLimits kLimits{1 << 10, 2e5};
constexpr double kLargestScore = 1e6;  // beyond, sums in another order differ by more than the tolerance

bool close(double a, double b) { return std::abs(a - b) <= 1e-6 * (1.0 + std::abs(b)); }

void check_against(const oracle::NaiveAnswer& naive, const InferenceResult& result, const std::string& method) {
  if (!naive.possible) {
    demand(result.termination == Termination::kNoPossibleWorld, "no world is possible", method + ": " + result.message);
    return;
  }
  demand(result.termination != Termination::kNoPossibleWorld, "some world is possible", method + ": " + result.message);
  if (result.termination != Termination::kCompleted || std::abs(naive.best_score) > kLargestScore) return;
  if (result.map) {
    demand(result.map->log_score <= naive.best_score + 1e-6 * (1 + std::abs(naive.best_score)),
           "no world is better than the best", method);
    demand(!result.map->optimal || close(result.map->log_score, naive.best_score), "what is proved is best", method);
    return;
  }
  demand(result.marginals.size() == naive.marginals.size(), "each query is answered", method);
  if (method != "exact") return;
  demand(result.log_partition && close(*result.log_partition, naive.log_partition), "the partition sum", method);
  for (std::size_t i = 0; i < naive.marginals.size(); ++i) {
    demand(std::abs(result.marginals[i].probability - naive.marginals[i].second) < 1e-6, "a marginal",
           naive.marginals[i].first);
  }
}

void answer(const Model& model, const Evidence& evidence, const Query& query) {
  GroundingOptions grounding;
  grounding.max_memory = kMemory;
  grounding.max_seconds = kSeconds;
  Monitor monitor;
  const GroundingResult grounded = ground(model, evidence, query, grounding, monitor);
  const auto naive = oracle::naive_semantics(model, evidence, query, grounding, kLimits);
  if (!grounded.network) {
    const bool refuted = grounded.termination == Termination::kNoPossibleWorld;
    demand(!refuted || !naive || !naive->possible, "what the grounder refutes is impossible", grounded.message);
    return;
  }
  for (const char* method : {"exact", "map", "mcsat", "gibbs", "auto"}) {
    InferenceOptions options;
    options.method = method;
    options.samples = 40;
    options.burn_in = 5;
    options.chains = 2;
    options.threads = 1;
    options.flips = 2000;
    options.restarts = 1;
    options.max_table_log2 = 16;
    options.max_seconds = kSeconds;
    options.max_memory = kMemory;
    const InferenceResult result = infer(*grounded.network, options, monitor);
    demand(result.termination != Termination::kRefused || !result.message.empty(), "a refusal has a reason", method);
    for (const Marginal& m : result.marginals) {
      demand(std::isnan(m.probability) || (m.probability >= 0 && m.probability <= 1), "a probability", method);
    }
    if (naive) check_against(*naive, result, method);
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto texts = sherlog::fuzz::texts_of(data, size);
  if (!texts) return 0;
  Diagnostics diagnostics;
  const auto model = parse_model(texts->model, "model.mln", diagnostics);
  if (!model) return 0;
  const auto databases = parse_evidence(*model, texts->evidence, "evidence.db", diagnostics);
  if (!databases) return 0;
  for (const Evidence& evidence : *databases) {
    const auto query = parse_query(*model, evidence, {texts->query}, diagnostics);
    if (query) answer(*model, evidence, *query);
  }
  return 0;
}
