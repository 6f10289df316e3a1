#include "learning/weight_table.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "grounding/ground.h"
#include "learning/learned_model.h"
#include "mln/evidence.h"
#include "mln/model.h"
#include "mln/query.h"

namespace sherlog {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

Model model_of(const std::string& text) {
  Diagnostics diagnostics;
  auto model = parse_model(text, "m.mln", diagnostics);
  EXPECT_TRUE(model) << diagnostics.render();
  return std::move(*model);
}

std::vector<std::string> texts(const Model& model) {
  const WeightTable table(model);
  std::vector<std::string> result;
  for (std::size_t w = 0; w < table.size(); ++w) result.push_back(weight_text(model, table, w));
  return result;
}

constexpr const char* kThings = "kind = {A, B, C}\nk(thing, kind!)\nP(thing)\n";

TEST(WeightTable, HasOneWeightForEachInstanceOfATemplateInModelOrder) {
  EXPECT_THAT(texts(model_of(std::string(kThings) + "0 P(x)\n0 k(x, +y) ^ P(x)\n0 k(x, A)\n")),
              ElementsAre("P(x)", "k(x, A) ^ P(x)", "k(x, B) ^ P(x)", "k(x, C) ^ P(x)", "k(x, A)"));
}

TEST(WeightTable, LeavesHardFormulasOut) {
  EXPECT_THAT(texts(model_of(std::string(kThings) + "P(x) => k(x, A).\n0 P(x)\n")), ElementsAre("P(x)"));
}

TEST(WeightTable, CountsUnorderedCombinationsOnce) {
  EXPECT_THAT(texts(model_of(std::string(kThings) + "#unique{+a, +b}\n0 k(x, +a) ^ k(y, +b) ^ x != y\n")),
              ElementsAre("k(x, A) ^ k(y, B) ^ x != y", "k(x, A) ^ k(y, C) ^ x != y", "k(x, B) ^ k(y, C) ^ x != y"));
}

TEST(WeightTable, RefusesMoreWeightsThanItsLimitAndNamesTheTemplate) {
  const Model model = model_of(std::string(kThings) + "0 P(x)\n0 k(x, +a) ^ k(y, +b)\n");
  EXPECT_EQ(WeightTable(model, 10).size(), 10u);
  const WeightTable table(model, 9);
  EXPECT_EQ(table.size(), 0u);
  EXPECT_THAT(table.problem(), HasSubstr("k(x, +a) ^ k(y, +b)"));
}

TEST(WeightTable, KnowsTheWeightsOfANetwork) {
  const Model model = model_of(std::string(kThings) + "1 P(x)\n2 k(x, +y) ^ P(x)\n");
  const WeightTable table(model);
  Diagnostics diagnostics;
  const auto databases = parse_evidence(model, "thing = {T}\n", "t.db", diagnostics);
  ASSERT_TRUE(databases) << diagnostics.render();
  const auto query = parse_query(model, databases->front(), {"k", "P"}, diagnostics);
  ASSERT_TRUE(query) << diagnostics.render();
  Monitor monitor;
  const GroundingResult grounded = ground(model, databases->front(), *query, {}, monitor);
  ASSERT_TRUE(grounded.network) << grounded.message;
  std::vector<bool> seen(table.size(), false);
  for (const WeightedInstance& instance : grounded.network->weights()) {
    const std::size_t w = table.find(instance);
    ASSERT_LT(w, table.size());
    EXPECT_FALSE(seen[w]) << "two instances of one weight";
    seen[w] = true;
    EXPECT_EQ(table.formula(w), instance.formula);
  }
  EXPECT_THAT(seen, testing::Each(true));
}

}  // namespace
}  // namespace sherlog
