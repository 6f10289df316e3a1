// Grounding against the definition: the network of a random model, enumerated, gives the same log Z, marginals and best
// score as the naive semantics of the text. SHERLOG_RANDOM_MODELS sets how many (default 200), SHERLOG_RANDOM_SEED the
// first seed.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "grounding/ground.h"
#include "mln/query.h"
#include "tests/oracles/enumeration.h"
#include "tests/oracles/naive_semantics.h"
#include "tests/oracles/random_model.h"

namespace sherlog {
namespace {

std::uint64_t number_from_environment(const char* name, std::uint64_t otherwise) {
  const char* text = std::getenv(name);
  return text == nullptr ? otherwise : std::strtoull(text, nullptr, 10);
}

std::string everything(const oracle::RandomModel& random) {
  std::string text = "--- model\n" + random.model + "--- evidence\n" + random.evidence + "--- query";
  for (const std::string& query : random.queries) text += "\n" + query;
  for (const std::string& name : random.open_world) text += "\nopen: " + name;
  return text + (random.open_world_all ? "\nopen: all" : "");
}

void expect_near(double expected, double found, const std::string& what) {
  EXPECT_NEAR(expected, found, 1e-9 * std::max(1.0, std::abs(expected))) << what;
}

void compare(const oracle::NaiveAnswer& naive, const GroundingResult& grounding) {
  if (!naive.possible) {
    if (grounding.network) {
      EXPECT_FALSE(oracle::enumerate(*grounding.network).possible);
    } else {
      ASSERT_EQ(grounding.termination, Termination::kNoPossibleWorld) << grounding.message;
      EXPECT_TRUE(grounding.conflict && !grounding.conflict->items.empty());
    }
    return;
  }
  ASSERT_EQ(grounding.termination, Termination::kCompleted) << grounding.message;
  const GroundNetwork& network = *grounding.network;
  const oracle::Enumeration found = oracle::enumerate(network);
  ASSERT_TRUE(found.possible);
  expect_near(naive.log_partition, found.log_partition, "log Z");
  expect_near(naive.best_score, found.best_score, "best score");
  ASSERT_EQ(network.queries().size(), naive.marginals.size());
  for (std::size_t i = 0; i < naive.marginals.size(); ++i) {
    const QueryTarget& target = network.queries()[i];
    const std::string text = target.is_formula ? target.formula_text : network.atom_text(target.literal.atom());
    EXPECT_EQ(naive.marginals[i].first, text);
    EXPECT_NEAR(naive.marginals[i].second, found.marginals[i], 1e-9) << text;
  }
}

// A hard formula that propositional logic refutes does not get past the parser.
bool only_contradictions(const Diagnostics& diagnostics) {
  return std::ranges::all_of(diagnostics.all(), [](const Diagnostic& message) {
    return message.severity == Severity::kWarning || message.code == "contradiction";
  });
}

// Returns whether the model was small enough to be compared.
bool check(std::uint64_t seed) {
  std::mt19937_64 random(seed);
  const oracle::RandomModel text = oracle::random_model(random);
  SCOPED_TRACE("seed " + std::to_string(seed) + "\n" + everything(text));
  Diagnostics diagnostics;
  const auto model = parse_model(text.model, "random.mln", diagnostics);
  EXPECT_TRUE(model || only_contradictions(diagnostics)) << diagnostics.render();
  if (!model) return false;
  const auto databases = parse_evidence(*model, text.evidence, "random.db", diagnostics);
  EXPECT_TRUE(databases) << diagnostics.render();
  if (!databases) return false;
  const Evidence& evidence = databases->front();
  const auto query = parse_query(*model, evidence, text.queries, diagnostics);
  EXPECT_TRUE(query) << diagnostics.render();
  if (!query) return false;
  GroundingOptions options;
  if (seed % 2 == 0) options.dense_atoms = 0;  // hash tables are to mean the same as arrays
  options.open_world_all = text.open_world_all;
  for (const std::string& name : text.open_world) options.open_world.push_back(*model->find_predicate(name));
  const auto naive = oracle::naive_semantics(*model, evidence, *query, options);
  if (!naive) return false;
  Monitor monitor;
  compare(*naive, ground(*model, evidence, *query, options, monitor));
  return true;
}

TEST(Grounding, MeansWhatTheDefinitionSays) {
  const std::uint64_t count = number_from_environment("SHERLOG_RANDOM_MODELS", 200);
  const std::uint64_t first = number_from_environment("SHERLOG_RANDOM_SEED", 1);
  std::uint64_t compared = 0, seed = first;
  for (; compared < count && seed < first + 4 * count + 10 && !HasFailure(); ++seed) compared += check(seed) ? 1u : 0u;
  EXPECT_EQ(compared, count) << "too many models were too large to enumerate, or one failed";
}

}  // namespace
}  // namespace sherlog
