// Who is who: the matchers and the models on hand-made and simulated scenes.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "perception_bridge/baseline_matchers.h"
#include "perception_bridge/grades.h"
#include "perception_bridge/identity_learning.h"
#include "perception_bridge/shipped_models.h"
#include "perception_bridge/track_report.h"
#include "perception_bridge/track_run.h"

namespace sherlog {
namespace {

using testing::HasSubstr;

std::unique_ptr<IdentityResolver> paper(const std::string& method = "auto") {
  Diagnostics diagnostics;
  InferenceOptions options;
  options.method = method;
  std::string problem;
  auto resolver =
      IdentityResolver::make("paper", *parse_model(paper_identity_model(), "paper", diagnostics), {}, options, problem);
  EXPECT_EQ(problem, "");
  return resolver;
}

// Twelve equal cups on one table, in a grid; one of them goes somewhere else. All are in view.
FourTablesTrial cups() {
  FourTablesTrial trial;
  trial.view = {1, {0, 0}, {1, 1}};
  for (std::uint32_t i = 0; i < 12; ++i) {
    Observation cup;
    cup.object = i;
    cup.table = 1;
    cup.position = {0.05 + 0.2 * (i % 3), 0.05 + 0.2 * (i / 3)};
    cup.color = {0.9, 0.9, 0.8};
    trial.old_clusters.push_back(cup);
    if (i == 4) cup.position = {0.98, 0.98};
    trial.new_clusters.push_back(cup);
  }
  return trial;
}

TEST(IdentityResolver, OfTwelveEqualCupsElevenStayAndOneMoves) {
  for (const char* method : {"map", "auto", "matching"}) {
    SCOPED_TRACE(method);
    const FourTablesTrial trial = cups();
    const IdentityResolver::Belief belief = paper(method)->believe(trial);
    ASSERT_EQ(belief.termination, Termination::kCompleted) << belief.message;
    for (std::size_t o = 0; o < 12; ++o) {
      double row = 0, column = 0;
      for (std::size_t n = 0; n < 12; ++n) {
        row += belief.belief.same(o, n);
        column += belief.belief.same(n, o);
      }
      EXPECT_LE(row, 1 + 1e-9);
      EXPECT_LE(column, 1 + 1e-9);
    }
    const Resolution decided = decide(belief.belief, trial);
    EXPECT_EQ(std::ranges::count(decided.explanation, ClusterExplanation::kStay), 11);
    EXPECT_EQ(std::ranges::count(decided.explanation, ClusterExplanation::kMove), 1);
    EXPECT_EQ(decided.explanation[4], ClusterExplanation::kMove);
    for (std::size_t n = 0; n < 12; ++n) EXPECT_EQ(decided.association[n], n);
  }
}

TEST(IdentityResolver, AnswersScenesWithNothingInThem) {
  FourTablesTrial trial = cups();
  trial.new_clusters.clear();
  const MatcherAnswer gone = paper()->resolve(trial);
  ASSERT_EQ(gone.termination, Termination::kCompleted) << gone.message;
  EXPECT_EQ(std::ranges::count(gone.resolution.explanation, ClusterExplanation::kDisappear), 12);
  trial = cups();
  trial.old_clusters.clear();
  const MatcherAnswer fresh = paper()->resolve(trial);
  ASSERT_EQ(fresh.termination, Termination::kCompleted) << fresh.message;
  EXPECT_EQ(fresh.resolution.association, std::vector<std::optional<std::uint32_t>>(12));
}

TEST(IdentityResolver, SaysWhatAModelLacks) {
  Diagnostics diagnostics;
  std::string problem;
  const auto model = parse_model("similar(a, b)\n", "small", diagnostics);
  EXPECT_EQ(IdentityResolver::make("small", *model, {}, {}, problem), nullptr);
  EXPECT_THAT(problem, HasSubstr("does not declare 'is'"));
  Grading grading;
  grading.sigma_color = std::nan("");
  EXPECT_EQ(
      IdentityResolver::make("paper", *parse_model(paper_identity_model(), "p", diagnostics), grading, {}, problem),
      nullptr);
  EXPECT_THAT(problem, HasSubstr("sigma"));
}

TEST(Grades, AreThoseOfThePaper) {
  EXPECT_DOUBLE_EQ(printed_g(0, 0.25), 1);
  EXPECT_NEAR(printed_g(0.25, 0.25), 0.7788, 5e-5);
  EXPECT_NEAR(gaussian_g(0.25, 0.25), 0.6065, 5e-5);
}

TEST(Grades, OddsAreLikelihoodRatios) {
  FourTablesTrial trial;
  trial.view = {1, {0, 0}, {1, 1}};
  Observation a, b;
  a.table = b.table = 1;
  b.color = {0.1, 0, 0};
  const Grading grading{Grading::Kind::kOdds, 0.1, 0.1};
  const PairGrade grade = grade_pair(a, b, trial, grading);
  // Variance 0.02 in each channel: (1 / sqrt(2 pi 0.02))^3 exp(-0.1^2 / 0.04), and without the exponent for two axes.
  const double peak = 1 / std::sqrt(2 * 3.14159265358979 * 0.02);
  EXPECT_NEAR(grade.similar / (1 - grade.similar), peak * peak * peak * std::exp(-0.25), 1e-6);
  EXPECT_NEAR(grade.proximity / (1 - grade.proximity), peak * peak, 1e-6);
  b.table = 2;
  EXPECT_LT(grade_pair(a, b, trial, grading).proximity, 1e-8);
  a.position = {0.5, 0.5};
  EXPECT_NEAR(sees_place(a, {1, {0.5, 0}, {1, 1}}, trial.config, 0.01), 0.5, 1e-9);
  EXPECT_EQ(sees_place(a, {2, {0, 0}, {1, 1}}, trial.config, 0.01), 0);
}

TEST(IdentityLearning, FindsTheSensorsSigmas) {
  IdentityTraining training;
  training.config.noise = 0.05;
  training.trials = 300;
  Monitor monitor;
  const LearnedIdentity learned = learn_identity(training, monitor);
  ASSERT_EQ(learned.termination, Termination::kCompleted) << learned.message;
  EXPECT_NEAR(learned.grading.sigma_color, 0.05, 0.004);  // some 600 pairs, three channels
  EXPECT_NEAR(learned.grading.sigma_position, 0.05, 0.004);
  EXPECT_GT(learned.weights[0], learned.weights[1]);  // staying is more usual than moving
  EXPECT_THAT(learned.model, HasSubstr("seesPlace"));
  Diagnostics diagnostics;
  EXPECT_TRUE(parse_model(learned.model, "learned", diagnostics)) << diagnostics.render();
}

// Where every new cluster is an old one, nothing says how probable newcomers are; who is rather left alone is known all the same.
TEST(IdentityLearning, WorldsWithoutNewcomersAreLearnedToo) {
  IdentityTraining training;
  training.config.noise = 0.05;
  training.config.objects = 30;
  training.config.start_fill = 1;
  training.trials = 100;
  Monitor monitor;
  const LearnedIdentity learned = learn_identity(training, monitor);
  ASSERT_EQ(learned.termination, Termination::kCompleted) << learned.message;
  Diagnostics diagnostics;
  std::string problem;
  const auto mln = IdentityResolver::make("learned", *parse_model(learned.model, "learned", diagnostics),
                                          learned.grading, {}, problem);
  ASSERT_TRUE(mln) << problem;
  const auto nearest = hungarian_matcher();
  const Matcher* const matchers[] = {mln.get(), nearest.get()};
  TrackScore scores[2];
  TrackRun run;
  run.config = training.config;
  run.trials = 60;
  run.threads = 2;
  run_trials(run, matchers, StopCondition(monitor),
             [&](const FourTablesTrial& trial, std::span<const MatcherAnswer> answers) {
               for (std::size_t m = 0; m < answers.size(); ++m) scores[m].add(trial, answers[m].resolution);
             });
  EXPECT_GE(scores[0].association.rate(), 0.96);
  EXPECT_GT(scores[0].association.rate(), scores[1].association.rate());
}

TEST(IdentityLearning, WritesTheWeightsAtTheirFormulas) {
  const std::string text = with_identity_weights(learned_identity_model(), {1, 2, 3, 4, 5, -6.5});
  EXPECT_THAT(text, HasSubstr("\n1 is(o, n, stay)\n2 is(o, n, move)\n3 is(o, n, newview)\n4 appear(n)\n5 (disappear"));
  EXPECT_THAT(text, HasSubstr("\n-6.5 (disappear(o) v hidden(o)) ^ !seesPlace(o)\n"));
}

// All matchers on the same trials: the order in which they have to come out, and what none of them may say.
TEST(Matchers, ComeOutInTheirOrderAndNothingOutOfViewDisappears) {
  TrackRun run;
  run.config.noise = 0.075;
  run.trials = 300;
  run.threads = 2;
  IdentityTraining training;
  training.config = run.config;
  Monitor monitor;
  const LearnedIdentity learned = learn_identity(training, monitor);
  ASSERT_EQ(learned.termination, Termination::kCompleted) << learned.message;
  Diagnostics diagnostics;
  std::string problem;
  const auto mln = IdentityResolver::make("learned", *parse_model(learned.model, "learned", diagnostics),
                                          learned.grading, {}, problem);
  const auto table1 = paper();
  const auto reference = generative_matcher(run.config), hungarian = hungarian_matcher(),
             nearest = nearest_neighbour_matcher();
  const Matcher* const matchers[] = {mln.get(), table1.get(), reference.get(), hungarian.get(), nearest.get()};
  std::vector<TrackScore> scores(5);
  const TrackRunResult result = run_trials(run, matchers, StopCondition(monitor),
                                           [&](const FourTablesTrial& trial, std::span<const MatcherAnswer> answers) {
                                             for (std::size_t m = 0; m < answers.size(); ++m)
                                               scores[m].add(trial, answers[m].resolution);
                                           });
  EXPECT_EQ(result.trials, 300u) << result.message;
  for (const TrackScore& score : scores) EXPECT_EQ(score.disappeared_out_of_view, 0u);
  const auto rate = [&](std::size_t m) { return scores[m].association.rate(); };
  EXPECT_GE(rate(2), 0.935);  // 0.958 in 2,000 trials; one standard error of 300 is 0.008
  EXPECT_GE(rate(0), rate(2) - 0.01);
  EXPECT_GT(rate(0), rate(3));
  EXPECT_GT(rate(3), rate(4));
}

TEST(TrackRun, TheSameForAnyNumberOfThreads) {
  const auto table1 = paper();
  const Matcher* const matchers[] = {table1.get()};
  Monitor monitor;
  const auto all = [&](std::uint32_t threads) {
    TrackRun run;
    run.trials = 70;
    run.threads = threads;
    std::vector<Resolution> answers;
    run_trials(run, matchers, StopCondition(monitor),
               [&](const FourTablesTrial&, std::span<const MatcherAnswer> a) { answers.push_back(a[0].resolution); });
    return answers;
  };
  EXPECT_EQ(all(1), all(4));
}

TEST(TrackRun, StopsWhenTold) {
  class Impatient : public Monitor {
    bool interrupted() const override { return true; }
  } monitor;
  const auto nearest = nearest_neighbour_matcher();
  const Matcher* const matchers[] = {nearest.get()};
  const TrackRunResult result = run_trials({}, matchers, StopCondition(monitor), [](const auto&, auto) {});
  EXPECT_EQ(result.termination, Termination::kInterrupted);
  EXPECT_EQ(result.trials, 0u);
}

TEST(TrackReport, HasARowForEachShareAndALineForEachNoise) {
  TrackEvaluation e;
  e.matchers = {"a & b"};
  e.config = "{}";
  for (const double noise : {0.05, 0.1}) {
    e.cells.push_back({noise, 3, 0, std::vector<TrackScore>(1), {0.0}});
    FourTablesConfig config;
    config.noise = noise;
    for (std::uint64_t number = 0; number < 30; ++number) {
      const FourTablesTrial trial = simulate_four_tables(config, 1, number);
      e.add(trial, 0, trial.truth);
    }
  }
  EXPECT_EQ(e.cells[1].trials, 30u);
  const std::string csv = track_csv(e);
  EXPECT_THAT(csv, HasSubstr("actions,a & b,association,0.05,3,30,"));
  EXPECT_THAT(csv, HasSubstr("problem_size,a & b,explanation,0.1,"));
  EXPECT_TRUE(std::ranges::is_sorted(e.sizes, {}, [](const TrackSize& s) { return std::pair(s.noise, s.size); }));
  EXPECT_THAT(track_html(e), HasSubstr("<th>a &amp; b</th>"));
  EXPECT_THAT(track_svg(e), HasSubstr("noise 0.1"));
}

}  // namespace
}  // namespace sherlog
