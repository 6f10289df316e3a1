// Advice against its definition: entropy now, minus the mean entropy once each possible report is in the evidence.
#include "inference/advice.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

namespace sherlog {
namespace {

constexpr const char* kModel = R"(
object = {Milk, Cereal, Ketchup}
object(cluster, object!)
logo(cluster, company)
color(cluster, color)
place(room)
1.5 logo(c, Oetker) ^ object(c, Cereal)
2.0 logo(c, Heinz) ^ object(c, Ketchup)
-1.0 logo(c, l)
2.0 color(c, Red) ^ object(c, Ketchup)
1.0 color(c, White) ^ object(c, Milk)
-0.5 color(c, k)
1.0 object(a, Milk) ^ object(b, Cereal) ^ a != b
0.7 place(Kitchen) ^ object(c, Cereal)
)";

struct Scene {
  Diagnostics diagnostics;
  std::optional<Model> model;
  std::optional<std::vector<Evidence>> evidence;
  std::optional<Query> query;

  Scene(const std::string& model_text, const std::string& evidence_text, const std::string& query_text) {
    model = parse_model(model_text, "model", diagnostics);
    if (model) evidence = parse_evidence(*model, evidence_text, "evidence", diagnostics);
    if (evidence) query = parse_query(*model, evidence->front(), {query_text}, diagnostics);
    EXPECT_TRUE(query) << diagnostics.render();
  }
  AnnotatorCost annotator(const std::string& predicate, double seconds = 1.0) const {
    return {predicate, seconds, {*model->find_predicate(predicate)}};
  }
  AdviceResult advise(const std::vector<AnnotatorCost>& annotators, AdviceOptions options = {}) const {
    options.information.inference.method = "exact";
    Monitor monitor;
    return sherlog::advise(*model, evidence->front(), *query, annotators, options, monitor);
  }
};

// Probability that a formula holds given the evidence, where the predicates in `open` are open.
double probability(const std::string& evidence, const std::string& formula) {
  const Scene scene(kModel, evidence, formula);
  Monitor monitor;
  const GroundingResult grounded = ground(*scene.model, scene.evidence->front(), *scene.query, {}, monitor);
  InferenceOptions options;
  options.method = "exact";
  if (!grounded.network || grounded.network->queries().empty()) return 0.0;
  return infer(*grounded.network, options, monitor).marginals.front().probability;
}

// Joint entropy of the two objects.
double entropy(const std::string& evidence) {
  double sum = 0;
  for (const char* a : {"Milk", "Cereal", "Ketchup"}) {
    for (const char* b : {"Milk", "Cereal", "Ketchup"}) {
      const double p = probability(evidence, fmt::format("object(c1,{}) ^ object(c2,{})", a, b));
      sum -= p > 0 ? p * std::log(p) : 0;
    }
  }
  return sum;
}

constexpr const char* kEvidence = "color(c1,Red)\ncolor(c2,White)\nplace(Kitchen)\n";

TEST(Advice, IsTheMeanDropOverAllReports) {
  const Scene scene(kModel, kEvidence, "object");
  const AdviceResult result = scene.advise({scene.annotator("logo", 2.0)});
  ASSERT_EQ(result.termination, Termination::kCompleted) << result.message;
  ASSERT_TRUE(result.entropy.joint);
  EXPECT_NEAR(*result.entropy.joint, entropy(kEvidence), 1e-8);
  ASSERT_EQ(result.advice.size(), 2u);
  for (const Advice& advice : result.advice) {
    ASSERT_EQ(advice.cluster.size(), 1u);
    const std::string c = advice.cluster[0];
    const std::string open = fmt::format("{}?logo({},Oetker)\n?logo({},Heinz)\n", kEvidence, c, c);
    double drop = entropy(open);
    for (const char* oetker : {"", "!"}) {
      for (const char* heinz : {"", "!"}) {
        const std::string report = fmt::format("{}logo({},Oetker) ^ {}logo({},Heinz)", oetker, c, heinz, c);
        const std::string seen = fmt::format("{}{}logo({},Oetker)\n{}logo({},Heinz)\n", kEvidence, oetker, c, heinz, c);
        // Asking for a report opens the predicate: the other cluster's atoms are closed by hand.
        Monitor monitor;
        const std::string other = c == "c1" ? "c2" : "c1";
        const Scene closed(kModel, fmt::format("{}!logo({},Oetker)\n!logo({},Heinz)\n", open, other, other), report);
        const GroundingResult grounded = ground(*closed.model, closed.evidence->front(), *closed.query, {}, monitor);
        InferenceOptions options;
        options.method = "exact";
        drop -= infer(*grounded.network, options, monitor).marginals.front().probability * entropy(seen);
      }
    }
    EXPECT_NEAR(advice.expected_entropy_drop, drop, 1e-8) << c;
    EXPECT_DOUBLE_EQ(advice.drop_per_second, advice.expected_entropy_drop / 2.0);
    EXPECT_GT(advice.expected_entropy_drop, 0.0);
  }
}

TEST(Advice, OnlyWhatHasNotReportedIsACandidate) {
  const Scene scene(kModel, "color(c1,Red)\n!logo(c2,Heinz)\n?logo(c1,Heinz)\nplace(Kitchen)\ncolor(c3,Red)", "object");
  const AdviceResult result =
      scene.advise({scene.annotator("logo"), scene.annotator("color"), scene.annotator("place")});
  ASSERT_EQ(result.termination, Termination::kCompleted) << result.message;
  std::vector<std::string> candidates;
  for (const Advice& advice : result.advice)
    candidates.push_back(fmt::format("{} {}", advice.annotator, fmt::join(advice.cluster, ",")));
  EXPECT_THAT(candidates, testing::UnorderedElementsAre("0 c1", "0 c3", "1 c2"));
}

TEST(Advice, AnnotatorOfTheWholeSceneHasNoCluster) {
  const Scene scene(kModel, "color(c1,Red)", "object");
  const AdviceResult result = scene.advise({scene.annotator("place")});
  ASSERT_EQ(result.advice.size(), 1u);
  EXPECT_TRUE(result.advice[0].cluster.empty());
  EXPECT_GT(result.advice[0].expected_entropy_drop, 0.0);
}

TEST(Advice, RanksByDropForEachSecond) {
  const Scene scene(kModel, "logo(c1,Oetker)\nlogo(c2,Heinz)", "object");
  const AdviceResult fast = scene.advise({scene.annotator("color", 0.5), scene.annotator("place", 100.0)});
  const AdviceResult slow = scene.advise({scene.annotator("color", 1000.0), scene.annotator("place", 0.01)});
  ASSERT_EQ(fast.advice.size(), 3u);
  EXPECT_EQ(fast.advice.front().annotator, 0u);
  EXPECT_EQ(slow.advice.front().annotator, 1u);
  for (const AdviceResult* result : {&fast, &slow}) {
    for (std::size_t i = 1; i < result->advice.size(); ++i) {
      EXPECT_GE(result->advice[i - 1].drop_per_second, result->advice[i].drop_per_second);
    }
  }
}

TEST(Advice, OneAnnotatorOfTwoPredicatesTellsAtLeastAsMuchAsEach) {
  const Scene scene(kModel, "place(Kitchen)\nobject(c2,Milk)\n?object(c1,Milk)", "object");
  const PredicateId logo = *scene.model->find_predicate("logo"), color = *scene.model->find_predicate("color");
  const AdviceResult result =
      scene.advise({{"both", 1.0, {logo, color}}, {"logo", 1.0, {logo}}, {"color", 1.0, {color}}});
  double both = 0, best = 0;
  for (const Advice& advice : result.advice) {
    if (advice.cluster[0] != "c1") continue;
    (advice.annotator == 0 ? both : best) = std::max(advice.annotator == 0 ? both : best, advice.expected_entropy_drop);
  }
  EXPECT_GT(best, 0.0);
  EXPECT_GT(both, best);
}

TEST(Advice, OpenPredicatesAreUnknownInsteadOfFalse) {
  const Scene scene(kModel, kEvidence, "object");
  AdviceOptions options;
  options.grounding.open_world = {*scene.model->find_predicate("logo")};
  const AdviceResult open = scene.advise({scene.annotator("logo")}, options);
  const AdviceResult closed = scene.advise({scene.annotator("logo")});
  ASSERT_EQ(open.termination, Termination::kCompleted) << open.message;
  ASSERT_EQ(open.advice.size(), 2u);
  EXPECT_GT(std::abs(open.entropy.marginal - closed.entropy.marginal), 1e-3);
  EXPECT_GT(open.advice[0].expected_entropy_drop, 0.0);
}

TEST(Advice, EvidenceStaysAsItIsWithNewConstantsAndDegrees) {
  // c9, Blue and Pfanner come from the evidence; the soft atom is a hidden variable beside the frontier.
  const Scene scene(kModel, "0.8 color(c9,Red)\ncolor(c9,Blue)\nlogo(c7,Pfanner)\nplace(Kitchen)", "object");
  const AdviceResult result = scene.advise({scene.annotator("logo"), scene.annotator("color")});
  ASSERT_EQ(result.termination, Termination::kCompleted) << result.message;
  std::vector<std::string> candidates;
  for (const Advice& advice : result.advice)
    candidates.push_back(fmt::format("{} {}", advice.annotator, advice.cluster[0]));
  EXPECT_THAT(candidates, testing::UnorderedElementsAre("0 c9", "1 c7"));
}

TEST(Advice, SceneWithoutAWorldIsSaidSo) {
  const Scene scene(
      std::string(kModel) + "color(c, Red) => object(c, Ketchup).\nlogo(c, Oetker) => object(c, Cereal).\n",
      "color(c1,Red)\nlogo(c1,Oetker)", "object");
  const AdviceResult result = scene.advise({scene.annotator("place")});
  EXPECT_EQ(result.termination, Termination::kNoPossibleWorld);
  EXPECT_TRUE(result.advice.empty());
}

TEST(Advice, WrongQuestionsAreRefused) {
  const Scene scene(kModel, kEvidence, "object");
  EXPECT_EQ(scene.advise({scene.annotator("object")}).termination, Termination::kRefused);
  EXPECT_EQ(scene.advise({scene.annotator("logo", 0.0)}).termination, Termination::kRefused);
  EXPECT_EQ(scene.advise({{"none", 1.0, {}}}).termination, Termination::kRefused);
  const PredicateId logo = *scene.model->find_predicate("logo"), place = *scene.model->find_predicate("place");
  EXPECT_EQ(scene.advise({{"mixed", 1.0, {logo, place}}}).termination, Termination::kRefused);
  const Scene formula(kModel, kEvidence, "object(c1,Milk) ^ object(c2,Milk)");
  EXPECT_EQ(formula.advise({formula.annotator("logo")}).termination, Termination::kRefused);
}

TEST(Advice, TimeLimitIsHeeded) {
  const Scene scene(kModel, kEvidence, "object");
  AdviceOptions options;
  options.information.inference.max_seconds = 0.0;
  EXPECT_NE(scene.advise({scene.annotator("logo")}, options).termination, Termination::kCompleted);
}

}  // namespace
}  // namespace sherlog
