// The question of identity through the engine, and what is decided from a belief.
#include "perception_bridge/association_question.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <iterator>

#include "tests/unit/perception_bridge/tracking_scenes.h"

namespace sherlog {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

constexpr auto kStay = ClusterExplanation::kStay, kMove = ClusterExplanation::kMove,
               kNewview = ClusterExplanation::kNewview, kDisappear = ClusterExplanation::kDisappear,
               kHidden = ClusterExplanation::kHidden;

AssociationQuestion question_with(const std::string& method) {
  Diagnostics diagnostics;
  std::string problem;
  InferenceOptions options;
  options.method = method;
  auto question = AssociationQuestion::make(*parse_model(paper_identity_model(), "table1.mln", diagnostics),
                                            *shipped_mapping("identity"), options, problem);
  EXPECT_TRUE(question) << problem;
  return std::move(*question);
}

const std::string kTwoPairs =
    "oldCluster = {O0, O1}\nnewCluster = {N0, N1}\n"
    "0.9 similar(O0,N0)\n0.1 similar(O0,N1)\n0.2 similar(O1,N0)\n0.8 similar(O1,N1)\n"
    "0.7 proximity(O0,N0)\n0.1 proximity(O0,N1)\n0.1 proximity(O1,N0)\n0.6 proximity(O1,N1)\n";

// The sums over all matchings of two by two, by hand: 0.58420032 in all.
TEST(AssociationQuestion, TwoPairsHaveTheProbabilitiesOfTheirMatchings) {
  Monitor quiet;
  for (const char* method : {"exact", "matching", "auto"}) {
    SCOPED_TRACE(method);
    const auto answer = question_with(method).ask(kTwoPairs, 2, 2, quiet);
    ASSERT_EQ(answer.termination, Termination::kCompleted) << answer.message;
    const IdentityBelief& belief = answer.belief;
    EXPECT_NEAR(belief.pair(0, 0)[0], 0.628921, 1e-6);
    EXPECT_NEAR(belief.pair(0, 0)[1], 0.269538, 1e-6);
    EXPECT_NEAR(belief.pair(0, 0)[2], 0.069880, 1e-6);
    EXPECT_NEAR(belief.pair(1, 1)[0], 0.479178, 1e-6);
    EXPECT_NEAR(belief.appeared(0), 0.030511, 1e-6);
    EXPECT_NEAR(belief.appeared(1), 0.080795, 1e-6);
  }
}

TEST(AssociationQuestion, WhatIsOutOfViewHasMovedOrIsHidden) {
  Monitor quiet;
  const auto answer = question_with("exact").ask(kTwoPairs + "outOfView(O1)\n", 2, 2, quiet);
  EXPECT_NEAR(answer.belief.pair(1, 1)[1], 0.797401, 1e-6);
  EXPECT_EQ(answer.belief.pair(1, 1)[0] + answer.belief.pair(1, 1)[2], 0);
  EXPECT_NEAR(1 - answer.belief.same(1, 0) - answer.belief.same(1, 1), 0.200753, 1e-6);
}

TEST(AssociationQuestion, WhatCannotBeAnsweredHasATermination) {
  Monitor quiet;
  const auto refused = question_with("auto").ask("similar(O0,N0,N1)\n", 1, 1, quiet);
  EXPECT_NE(refused.termination, Termination::kCompleted);
  EXPECT_NE(refused.message, "");
  // Certainties that cannot all be right.
  const auto impossible =
      question_with("auto").ask("similar(O0,N0)\nsimilar(O0,N1)\nproximity(O0,N0)\nproximity(O0,N1)\n", 1, 2, quiet);
  EXPECT_NE(impossible.termination, Termination::kCompleted);
}

TEST(AssociationQuestion, ClustersWithoutAPositionAreInView) {
  const Scene scene = looking_at(scene_of(0, {}), {0, 0}, {1, 1});
  std::vector<Cluster> olds = {cluster_of("in", {0.5, 0.5}), cluster_of("out", {1.5, 0.5}), cluster_of("bare", {5, 5})};
  olds[2].annotations.clear();
  EXPECT_THAT(out_of_view_of(olds, scene), ElementsAre(false, true, false));
  EXPECT_THAT(out_of_view_of(olds, scene_of(1, {})), ElementsAre(false, false, false));
}

// --- from a belief to one explanation ---

TEST(IdentityBelief, WhatIsMissingToOneHasAppeared) {
  IdentityBelief belief(2, 1);
  EXPECT_EQ(belief.appeared(0), 1);
  belief.pair(0, 0) = {0.2, 0.1, 0.05};
  belief.pair(1, 0) = {0.3, 0, 0};
  EXPECT_DOUBLE_EQ(belief.same(0, 0), 0.35);
  EXPECT_DOUBLE_EQ(belief.appeared(0), 0.35);
  belief.pair(1, 0) = {0.7, 0, 0};
  EXPECT_EQ(belief.appeared(0), 0) << "rounding does not make it negative";
}

std::string with(std::string model, const std::string& what, const std::string& instead) {
  for (std::size_t at = model.find(what); at != std::string::npos; at = model.find(what, at + instead.size()))
    model.replace(at, what.size(), instead);
  return model;
}

std::optional<AssociationQuestion> question_of(const std::string& model, std::string& problem) {
  Diagnostics diagnostics;
  auto parsed = parse_model(model, "model", diagnostics);
  EXPECT_TRUE(parsed) << diagnostics.render();
  return AssociationQuestion::make(std::move(*parsed), *shipped_mapping("identity"), {}, problem);
}

TEST(AssociationQuestion, ModelsMayShoutTheirExplanations) {
  std::string model(paper_identity_model()), problem;
  for (const auto& [word, loud] : {std::pair{"{move, stay, newview, not}", "{MOVE, STAY, NEWVIEW, NOT}"},
                                   {", move)", ", MOVE)"},
                                   {", stay)", ", STAY)"},
                                   {", newview)", ", NEWVIEW)"},
                                   {", not)", ", NOT)"},
                                   {"= not)", "= NOT)"}}) {
    model = with(model, word, loud);
  }
  const auto question = question_of(model, problem);
  ASSERT_TRUE(question) << problem;
  Monitor quiet;
  const auto answer = question->ask(kTwoPairs, 2, 2, quiet);
  ASSERT_EQ(answer.termination, Termination::kCompleted) << answer.message;
  EXPECT_NEAR(answer.belief.pair(0, 0)[0], 0.628921, 1e-6);
}

TEST(AssociationQuestion, AnExplanationThatNobodyKnowsIsRefused) {
  std::string problem;
  const std::string model(paper_identity_model());
  EXPECT_FALSE(question_of(with(model, "newview, not}", "newview, replaced, not}"), problem));
  EXPECT_THAT(problem, HasSubstr("'replaced'"));
}

// What the model says of a cluster that is alone counts, not what the view would say.
TEST(AssociationQuestion, WhatHasDisappearedIsTheModelsWord) {
  std::string problem;
  std::string model = with(std::string(paper_identity_model()), "^ !outOfView(o).", "^ outOfView(o).");
  model =
      with(model, "hidden(o)    <=> !(EXIST n (is(o, n, stay) v is(o, n, move) v is(o, n, newview))) ^ outOfView(o).",
           "hidden(o)    <=> !(EXIST n (is(o, n, stay) v is(o, n, move) v is(o, n, newview))) ^ !outOfView(o).");
  const auto question = question_of(model, problem);
  ASSERT_TRUE(question) << problem;
  Monitor quiet;
  const std::string alone =
      "oldCluster = {O0, O1}\nnewCluster = {N0}\n0.01 similar(O0,N0)\n0.01 proximity(O0,N0)\n"
      "0.01 similar(O1,N0)\n0.01 proximity(O1,N0)\noutOfView(O1)\n";
  const auto answer = question->ask(alone, 2, 1, quiet);
  ASSERT_EQ(answer.termination, Termination::kCompleted) << answer.message;
  EXPECT_THAT(decide(answer.belief, std::vector<bool>{false, true}).explanation, ElementsAre(kHidden, kDisappear));
  EXPECT_THAT(decide(question_with("exact").ask(alone, 2, 1, quiet).belief, std::vector<bool>{false, true}).explanation,
              ElementsAre(kDisappear, kHidden));
}

// Two new clusters and very many old ones: Z = (1 + S0) (1 + S1) - sum of w0 w1, where w are a pair's odds.
TEST(AssociationQuestion, ThousandsOfOldClustersAreAnsweredExactly) {
  constexpr std::size_t kOlds = 2100;
  std::string text = "newCluster = {N0, N1}\n";
  double sum[2] = {0, 0}, both = 0;
  for (std::size_t o = 0; o < kOlds; ++o) {
    double odds[2];
    for (std::size_t n = 0; n < 2; ++n) {
      const double similar = 0.01 + 0.02 * static_cast<double>((7 * o + 3 * n) % 11),
                   close = 0.01 + 0.01 * static_cast<double>((5 * o + n) % 13);
      text += fmt::format("{} similar(O{},N{})\n{} proximity(O{},N{})\n", similar, o, n, close, o, n);
      odds[n] = (similar * close + similar * (1 - close) + (1 - similar) * close) / ((1 - similar) * (1 - close));
      sum[n] += odds[n];
    }
    both += odds[0] * odds[1];
  }
  Monitor quiet;
  const auto answer = question_with("auto").ask(text, kOlds, 2, quiet);
  ASSERT_EQ(answer.termination, Termination::kCompleted) << answer.message;
  EXPECT_EQ(answer.method, "matching");
  const double all = (1 + sum[0]) * (1 + sum[1]) - both;
  EXPECT_NEAR(answer.belief.appeared(0), (1 + sum[1]) / all, 1e-9);
  EXPECT_NEAR(answer.belief.appeared(1), (1 + sum[0]) / all, 1e-9);
}

TEST(IdentityBelief, TheDecisionIsTheBestMatchingAndItsBestExplanations) {
  IdentityBelief belief(3, 2);
  // N0 would rather be O0, but so would N1, which has no other.
  belief.pair(0, 0) = {0.5, 0, 0};
  belief.pair(1, 0) = {0, 0, 0.4};
  belief.pair(0, 1) = {0.1, 0.5, 0.1};
  const Resolution resolution = decide(belief, std::vector<bool>{false, false, true});
  EXPECT_THAT(resolution.association, ElementsAre(1u, 0u));
  EXPECT_THAT(resolution.explanation, ElementsAre(kMove, kNewview, kHidden));
}

TEST(IdentityBelief, WhoIsMoreProbablyAloneStaysAlone) {
  IdentityBelief belief(2, 1);
  belief.pair(0, 0) = {0.3, 0, 0};
  belief.pair(1, 0) = {0.2, 0, 0};
  const Resolution resolution = decide(belief, std::vector<bool>{false, false});
  EXPECT_THAT(resolution.association, ElementsAre(std::nullopt));
  EXPECT_THAT(resolution.explanation, ElementsAre(kDisappear, kDisappear));
  EXPECT_THAT(decide(IdentityBelief(0, 2), std::vector<bool>{}).association, ElementsAre(std::nullopt, std::nullopt));
  EXPECT_THAT(decide(IdentityBelief(1, 0), std::vector<bool>{true}).explanation, ElementsAre(kHidden));
  belief.pair(0, 0) = {0.9, 0, 0};
  EXPECT_THAT(decide(belief, std::vector<bool>{false, false}).explanation, ElementsAre(kStay, kDisappear));
}

TEST(ShippedModels, AreTheFilesOfTheModelsFolder) {
  const auto file = [](const char* name) {
    std::ifstream in(std::string(SHERLOG_SOURCE_DIR "/models/identity_resolution/") + name, std::ios::binary);
    return std::string(std::istreambuf_iterator<char>(in), {});
  };
  EXPECT_EQ(paper_identity_model(), file("table1.mln"));
  EXPECT_EQ(scenes_identity_model(), file("scenes.mln"));
  EXPECT_EQ(learned_identity_model(), file("learned.mln"));
  EXPECT_EQ(identity_learning_model(), file("learning.mln"));
}

}  // namespace
}  // namespace sherlog
