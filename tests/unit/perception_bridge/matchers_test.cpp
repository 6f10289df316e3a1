// The baselines on scenes where everybody can see what is right, and where they differ.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "perception_bridge/baseline_matchers.h"

namespace sherlog {
namespace {

using testing::ElementsAre;

constexpr auto kStay = ClusterExplanation::kStay, kMove = ClusterExplanation::kMove,
               kDisappear = ClusterExplanation::kDisappear, kHidden = ClusterExplanation::kHidden;

Observation seen(double x, double y, Color color, std::uint32_t table = 1) {
  Observation observation;
  observation.table = table;
  observation.position = {x, y};
  observation.color = color;
  return observation;
}

FourTablesTrial trial_of(std::vector<Observation> olds, std::vector<Observation> news) {
  FourTablesTrial trial;
  trial.view = {1, {0, 0}, {1, 1}};
  for (Observation& old : olds) old.out_of_view = !trial.view.contains(old.table, old.position);
  trial.old_clusters = std::move(olds);
  trial.new_clusters = std::move(news);
  return trial;
}

const Color kRed = {0.9, 0.1, 0.1}, kBlue = {0.1, 0.1, 0.9}, kGreen = {0.1, 0.9, 0.1};

std::vector<std::unique_ptr<Matcher>> all() {
  std::vector<std::unique_ptr<Matcher>> matchers;
  matchers.push_back(nearest_neighbour_matcher());
  matchers.push_back(hungarian_matcher());
  matchers.push_back(generative_matcher({}));
  return matchers;
}

TEST(Baselines, FindWhatStayedWhatWentAndWhatCannotBeSeen) {
  const FourTablesTrial trial = trial_of(
      {seen(0.2, 0.2, kRed), seen(0.8, 0.8, kBlue), seen(0.5, 0.5, kGreen), seen(0.5, 0.5, {0.5, 0.5, 0.5}, 3)},
      {seen(0.81, 0.8, kBlue), seen(0.2, 0.21, kRed)});
  for (const auto& matcher : all()) {
    SCOPED_TRACE(matcher->name());
    const MatcherAnswer answer = matcher->resolve(trial);
    ASSERT_EQ(answer.termination, Termination::kCompleted) << answer.message;
    EXPECT_THAT(answer.resolution.association, ElementsAre(1u, 0u));
    EXPECT_THAT(answer.resolution.explanation, ElementsAre(kStay, kStay, kDisappear, kHidden));
  }
}

TEST(Baselines, OfNothingNothingIsKnown) {
  for (const auto& matcher : all()) {
    SCOPED_TRACE(matcher->name());
    const auto resolve = [&](std::vector<Observation> olds, std::vector<Observation> news) {
      const MatcherAnswer answer = matcher->resolve(trial_of(std::move(olds), std::move(news)));
      EXPECT_EQ(answer.termination, Termination::kCompleted) << answer.message;
      return answer.resolution;
    };
    EXPECT_EQ(resolve({}, {}), Resolution{});
    EXPECT_THAT(resolve({}, {seen(0, 0, kRed)}).association, ElementsAre(std::nullopt));
    EXPECT_THAT(resolve({seen(0.5, 0.5, kRed)}, {}).explanation, ElementsAre(kDisappear));
  }
}

TEST(Baselines, AMatchingIsBetterThanTakingTheNearestOneByOne) {
  // The left old one is the best for both new ones; only one can have it, and the other has a good second choice.
  const FourTablesTrial trial =
      trial_of({seen(0.30, 0.5, kRed), seen(0.10, 0.5, kRed)}, {seen(0.25, 0.5, kRed), seen(0.32, 0.5, kRed)});
  EXPECT_THAT(hungarian_matcher()->resolve(trial).resolution.association, ElementsAre(1u, 0u));
  const auto greedy = nearest_neighbour_matcher()->resolve(trial).resolution.association;
  EXPECT_THAT(greedy, ElementsAre(std::nullopt, 0u));
}

TEST(Baselines, TheGenerativeOneKnowsThatThingsAreMoved) {
  const FourTablesTrial trial = trial_of({seen(0.1, 0.1, kRed)}, {seen(0.9, 0.9, kRed)});
  const Resolution resolution = generative_matcher({})->resolve(trial).resolution;
  EXPECT_THAT(resolution.association, ElementsAre(0u));
  EXPECT_THAT(resolution.explanation, ElementsAre(kMove));
}

}  // namespace
}  // namespace sherlog
