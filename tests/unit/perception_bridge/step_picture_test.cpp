// Fig. 11: two kitchen scenes through the engine, and the pictures of a step.
#include "perception_bridge/step_picture.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "perception_bridge/four_tables_json.h"
#include "tests/unit/perception_bridge/tracking_scenes.h"

namespace sherlog {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;

constexpr auto kStay = ClusterExplanation::kStay, kMove = ClusterExplanation::kMove,
               kDisappear = ClusterExplanation::kDisappear, kHidden = ClusterExplanation::kHidden;

Scene shipped(const std::string& id) {
  std::ifstream in(SHERLOG_SOURCE_DIR "/examples/scenes/figure11.jsonl");
  std::string line, problem;
  while (std::getline(in, line)) {
    SceneMessages messages;
    const auto document = parse_json(line, problem);
    auto scene = document ? scene_from_json(*document, messages) : std::nullopt;
    if (scene && scene->id == id) return std::move(*scene);
  }
  ADD_FAILURE() << "no scene " << id << " " << problem;
  return {};
}

StepPicture step_between(const std::string& before_id, const std::string& now_id, const std::string& method = "auto") {
  const Scene before = shipped(before_id), now = shipped(now_id);
  Diagnostics diagnostics;
  std::string problem;
  InferenceOptions options;
  options.method = method;
  const auto question = AssociationQuestion::make(*parse_model(paper_identity_model(), "table1.mln", diagnostics),
                                                  *shipped_mapping("identity"), options, problem);
  EXPECT_TRUE(question) << problem;
  Monitor quiet;
  const auto answer = question->ask(before.clusters, now, quiet);
  EXPECT_EQ(answer.termination, Termination::kCompleted) << answer.message;
  return picture_of(before, now, question->mapping(), answer.belief);
}

std::size_t count(const std::string& text, const std::string& part) {
  std::size_t found = 0;
  for (std::size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) ++found;
  return found;
}

// B21: two equal blue plates, one of them moved.
TEST(KitchenFigure, OfTwoEqualPlatesTheOneThatMovedIsFound) {
  for (const char* method : {"auto", "exact", "matching", "map"}) {
    SCOPED_TRACE(method);
    const StepPicture step = step_between("plates-before", "plates-after", method);
    EXPECT_THAT(step.resolution.association, ElementsAre(0u, 1u, 2u));
    EXPECT_THAT(step.resolution.explanation, ElementsAre(kStay, kMove, kStay));
    ASSERT_EQ(step.grades.size(), 2u);
    for (std::size_t pair : {0u, 1u, 3u, 4u})
      EXPECT_GT(step.grades[0].values[pair], 0.99) << "the plates look alike, all of them";
  }
}

// B22: a magazine was replaced by a bottle of ice tea; the rest stayed.
TEST(KitchenFigure, WhatWasReplacedDisappearsAndAppears) {
  for (const char* method : {"auto", "exact", "matching", "map"}) {
    SCOPED_TRACE(method);
    const StepPicture step = step_between("table-before", "table-after", method);
    EXPECT_THAT(step.resolution.association, ElementsAre(std::nullopt, 1u, 2u));
    EXPECT_THAT(step.resolution.explanation, ElementsAre(kDisappear, kStay, kStay));
  }
}

TEST(StepPicture, ShowsEveryGradeAndTheExplanation) {
  const StepPicture step = step_between("table-before", "table-after");
  const std::string svg = step_svg(step);
  // The ground, two grades of 3 x 3, the marginals with their margins, and the frames of the last matrix.
  EXPECT_EQ(count(svg, "<rect"), 1u + 2 * 9 + (9 + 3 + 3) + 9);
  for (const char* words :
       {">similar<", ">proximity<", ">explanation<", "magazine disappeared: ", "c0 appeared: ", "cup, c1 (stay 0.99"}) {
    EXPECT_THAT(svg, HasSubstr(words));
  }
  EXPECT_EQ(count(svg, ">S<"), 2u);
  EXPECT_EQ(count(svg, ">A<"), 1u);
  EXPECT_EQ(count(svg, ">D<"), 1u);
  EXPECT_EQ(count(svg, ">H<") + count(svg, ">M<") + count(svg, ">V<"), 0u);
  EXPECT_EQ(svg, step_svg(step_between("table-before", "table-after"))) << "the same step is the same picture";
  EXPECT_THAT(step_html({&step, 1}), HasSubstr(svg));
}

TEST(StepPicture, FramesWhatTheTruthSaysOtherwise) {
  StepPicture step = step_between("plates-before", "plates-after");
  step.truth = step.resolution;
  EXPECT_THAT(step_svg(step), Not(HasSubstr("stroke=\"#c0392b\"")));
  step.truth->explanation[1] = ClusterExplanation::kNewview;
  EXPECT_EQ(count(step_svg(step), "stroke=\"#c0392b\""), 1u);
  step.truth->association[0] = std::nullopt;
  step.truth->explanation[0] = kHidden;
  EXPECT_EQ(count(step_svg(step), "stroke=\"#c0392b\""), 4u) << "no pair, the old one hidden, the new one appeared";
}

TEST(StepPicture, EscapesNamesAndDrawsEmptySteps) {
  StepPicture step;
  step.title = "<a> & \"b\"";
  EXPECT_THAT(step_svg(step), HasSubstr("&lt;a&gt; &amp; &quot;b&quot;"));
  step.old_names = {"<\xc3\xa4\xc3\xa4\xc3\xa4\xc3\xa4\xc3\xa4\xc3\xa4\xc3\xa4\xc3\xa4>"};
  step.out_of_view = {true};
  step.belief = IdentityBelief(1, 0);
  step.resolution.explanation = {kHidden};
  const std::string svg = step_svg(step);
  EXPECT_THAT(svg, Not(HasSubstr("<\xc3")));
  EXPECT_EQ(count(svg, ">H<"), 1u);
  for (std::size_t i = 0; i + 1 < svg.size(); ++i) {
    const auto byte = static_cast<unsigned char>(svg[i]), next = static_cast<unsigned char>(svg[i + 1]);
    ASSERT_TRUE(byte != 0xc3 || (next & 0xc0U) == 0x80U) << "half a character";
  }
}

// XML has no word for most control characters, not even an escaped one.
TEST(StepPicture, ControlCharactersAreReplaced) {
  StepPicture picture;
  picture.title =
      "a\x01"
      "b";
  EXPECT_THAT(step_svg(picture), testing::AllOf(HasSubstr("a\xEF\xBF\xBD"
                                                          "b"),
                                                Not(HasSubstr("\x01"))));
}

TEST(StepPicture, OfAHundredOldClustersIsAPicture) {
  StepPicture step;
  step.belief = IdentityBelief(100, 30);
  for (int o = 0; o < 100; ++o) step.old_names.push_back("O" + std::to_string(o));
  for (int n = 0; n < 30; ++n) step.new_names.push_back("N" + std::to_string(n));
  step.out_of_view.assign(100, false);
  step.resolution.association.assign(30, std::nullopt);
  step.resolution.explanation.assign(100, kDisappear);
  EXPECT_EQ(count(step_svg(step), ">D<"), 100u);
}

TEST(TrialLine, ReadsBackWhatItWrites) {
  const FourTablesConfig config;
  for (std::uint64_t number = 0; number < 5; ++number) {
    // The second seed is more than a double can tell from its neighbours.
    const FourTablesTrial trial = simulate_four_tables(config, number == 1 ? 9007199254740995u : 3, number);
    MatcherAnswer answer;
    answer.resolution = trial.truth;
    const std::string line = trial_line(trial, answer, false);
    std::string problem;
    const auto again = trial_from_line(line, config, problem);
    ASSERT_TRUE(again) << problem;
    EXPECT_EQ(trial_line(*again, answer, false), line);
    EXPECT_EQ(again->truth, trial.truth);
  }
}

TEST(TrialLine, MistakesAreNamed) {
  FourTablesTrial trial = simulate_four_tables({}, 3, 0);
  MatcherAnswer answer;
  answer.resolution = trial.truth;
  const std::string line = trial_line(trial, answer, false);
  const auto problem_with = [&](const std::string& from, const std::string& to) {
    std::string changed = line, problem;
    const std::size_t at = changed.find(from);
    EXPECT_NE(at, std::string::npos) << from;
    if (at != std::string::npos) changed.replace(at, from.size(), to);
    EXPECT_FALSE(trial_from_line(changed, {}, problem));
    return problem;
  };
  EXPECT_THAT(problem_with("\"seed\":3", "\"seed\":-3"), HasSubstr("'seed' is -3"));
  EXPECT_THAT(problem_with("\"noise\":", "\"noize\":"), HasSubstr("no number 'noise'"));
  EXPECT_THAT(problem_with("\"old\":[", "\"older\":["), HasSubstr("no list 'old'"));
  EXPECT_THAT(problem_with("\"view\":", "\"views\":"), HasSubstr("'table'"));
  EXPECT_THAT(problem_with("\"position\":[", "\"position\":[7,"), HasSubstr("2 numbers 'position'"));
  EXPECT_THAT(problem_with("\"explanation\":{\"O1\":\"", "\"explanation\":{\"O1\":\"x"), HasSubstr("explain 'O1'"));
  EXPECT_THAT(problem_with("\"association\":{\"N1\"", "\"association\":{\"N77\""), HasSubstr("what 'N1' is"));
  EXPECT_THAT(problem_with("{", "["), Not(HasSubstr("trial")));
}

}  // namespace
}  // namespace sherlog
