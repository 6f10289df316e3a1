// Small models on which other engines are known to answer wrongly, each put to every method of the registry.
//
// Two of them divide a formula's weight over the clauses of its normal form, count a hard formula as a large weight, or
// sample the satisfying worlds far from uniformly. The right answers follow by counting worlds.
#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <string>
#include <vector>

#include "sherlog.h"

namespace sherlog {
namespace {

// Marginals by name under one method; empty (and reported) where the method refuses the model.
struct Answer {
  InferenceResult result;
  std::map<std::string, double> marginals;
};

Answer ask(const std::string& text, const std::string& database, const std::string& query_text,
           const std::string& method) {
  Diagnostics diagnostics;
  const auto model = parse_model(text, "model.mln", diagnostics);
  EXPECT_TRUE(model) << diagnostics.render();
  if (!model) return {};
  const auto evidence = parse_evidence(*model, database, "evidence.db", diagnostics);
  EXPECT_TRUE(evidence) << diagnostics.render();
  if (!evidence) return {};
  const auto query = parse_query(*model, evidence->front(), {query_text}, diagnostics);
  EXPECT_TRUE(query) << diagnostics.render();
  if (!query) return {};
  Monitor monitor;
  const auto grounding = ground(*model, evidence->front(), *query, {}, monitor);
  EXPECT_TRUE(grounding.network) << grounding.message;
  if (!grounding.network) return {};
  InferenceOptions options;
  options.method = method;
  options.threads = 2;
  Answer answer;
  answer.result = infer(*grounding.network, options, monitor);
  for (std::size_t i = 0; i < answer.result.marginals.size(); ++i)
    answer.marginals[grounding.network->atom_text(grounding.network->queries()[i].literal.atom())] =
        answer.result.marginals[i].probability;
  return answer;
}

std::vector<std::string> marginal_methods() {
  std::vector<std::string> names;
  for (const Method& method : methods())
    if (!method.finds_map) names.emplace_back(method.name);
  return names;
}

class KnownWrongAnswers : public testing::TestWithParam<std::string> {
 protected:
  void expect(const std::string& model, const std::map<std::string, double>& expected, const std::string& query = "H,S",
              const std::string& database = "thing = {I}\nobject = {O}\n") const {
    const Answer answer = ask(model, database, query, GetParam());
    // A method may refuse what it cannot do, with a sentence, and never answer wrongly.
    if (answer.result.termination == Termination::kRefused) {
      EXPECT_FALSE(answer.result.message.empty());
      GTEST_SKIP() << GetParam() << ": " << answer.result.message;
    }
    ASSERT_EQ(answer.result.termination, Termination::kCompleted) << answer.result.message;
    const double tolerance = GetParam() == "exact" ? 1e-12 : 0.01;
    for (const auto& [atom, probability] : expected) {
      ASSERT_TRUE(answer.marginals.contains(atom)) << atom;
      EXPECT_NEAR(answer.marginals.at(atom), probability, tolerance) << atom;
    }
  }
};

const char* const kDeclarations = "H(thing)\nS(object)\n";

// Three worlds of four are left: each atom is true in two of them. (A known sampler says 0.6225.)
TEST_P(KnownWrongAnswers, HardDisjunctionLeavesThreeEqualWorlds) {
  expect(std::string(kDeclarations) + "H(i) v S(o).\n", {{"H(I)", 2.0 / 3}, {"S(O)", 2.0 / 3}});
}

// {}, {S}, {H, S}: H in one of three, S in two.
TEST_P(KnownWrongAnswers, HardImplicationLeavesThreeEqualWorlds) {
  expect(std::string(kDeclarations) + "H(i) => S(o).\n", {{"H(I)", 1.0 / 3}, {"S(O)", 2.0 / 3}});
}

// One world is left. (A known sampler says 0.33.)
TEST_P(KnownWrongAnswers, HardConjunctionIsCertain) {
  const std::string model = std::string(kDeclarations) + "H(i) ^ S(o).\n";
  const Answer answer = ask(model, "thing = {I}\nobject = {O}\n", "H,S", GetParam());
  if (answer.result.termination == Termination::kRefused) GTEST_SKIP() << answer.result.message;
  ASSERT_EQ(answer.result.termination, Termination::kCompleted) << answer.result.message;
  ASSERT_EQ(answer.marginals.size(), 2u);
  EXPECT_DOUBLE_EQ(answer.marginals.at("H(I)"), 1.0);
  EXPECT_DOUBLE_EQ(answer.marginals.at("S(O)"), 1.0);
}

// e / (1 + e). (A known engine ignores the weight of a single positive atom.)
TEST_P(KnownWrongAnswers, WeightOfASingleAtomCounts) {
  expect("Heads(coin)\n1 Heads(x)\n", {{"Heads(A)", std::exp(1.0) / (1 + std::exp(1.0))}}, "Heads", "coin = {A}\n");
}

// Weight 2 on H ^ S as one feature: worlds 1, 1, 1, e^2. Divided over its two clauses it would be 1, e, e, e^2.
TEST_P(KnownWrongAnswers, WeightOfAConjunctionIsNotDividedOverItsClauses) {
  const double e2 = std::exp(2.0);
  expect(std::string(kDeclarations) + "2 H(i) ^ S(o)\n",
         {{"H(I)", (1 + e2) / (3 + e2)}, {"S(O)", (1 + e2) / (3 + e2)}});
}

// Weight 2 on an equivalence: worlds e^2, 1, 1, e^2; with S known the odds of H are e^2 : 1.
TEST_P(KnownWrongAnswers, WeightOfAnEquivalenceIsNotDividedOverItsClauses) {
  const double e2 = std::exp(2.0);
  expect(std::string(kDeclarations) + "2 H(i) <=> S(o)\n", {{"H(I)", e2 / (1 + e2)}}, "H", "thing = {I}\nS(O)\n");
}

// A weight of 800 overflows exp(): the probability is 1 and not a number all the same.
TEST_P(KnownWrongAnswers, LargeWeightIsNotNotANumber) {
  expect("Heads(coin)\n800 Heads(x)\n", {{"Heads(A)", 1.0}}, "Heads", "coin = {A}\n");
}

INSTANTIATE_TEST_SUITE_P(Methods, KnownWrongAnswers, testing::ValuesIn(marginal_methods()),
                         [](const auto& parameter) { return parameter.param; });

// Two hard formulas that contradict each other: no answer is made up.
TEST(KnownWrongAnswersOfContradictions, HardContradictionHasNoAnswer) {
  Diagnostics diagnostics;
  const auto model = parse_model("H(thing)\nH(x).\n!H(x).\n", "model.mln", diagnostics);
  ASSERT_TRUE(model) << diagnostics.render();
  const auto evidence = parse_evidence(*model, "thing = {I}\n", "evidence.db", diagnostics);
  ASSERT_TRUE(evidence) << diagnostics.render();
  const auto query = parse_query(*model, evidence->front(), {"H"}, diagnostics);
  ASSERT_TRUE(query) << diagnostics.render();
  Monitor monitor;
  const auto grounding = ground(*model, evidence->front(), *query, {}, monitor);
  if (!grounding.network) {
    EXPECT_EQ(grounding.termination, Termination::kNoPossibleWorld);
    return;
  }
  for (const Method& method : methods()) {
    InferenceOptions options;
    options.method = method.name;
    const auto result = infer(*grounding.network, options, monitor);
    EXPECT_TRUE(result.termination == Termination::kNoPossibleWorld || result.termination == Termination::kRefused)
        << method.name;
  }
}

}  // namespace
}  // namespace sherlog
