// Trackers of one measurement each, the arbiter over them, and when the model is asked.
#include "perception_bridge/tracking_arbiter.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>

#include "tests/unit/perception_bridge/tracking_scenes.h"

namespace sherlog {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

const std::array<double, 3> kRed = {0.9, 0.1, 0.1}, kBlue = {0.1, 0.1, 0.9}, kDarkBlue = {0.1, 0.1, 0.6};

TEST(FeatureTracker, FollowsUnderItsOwnNumbers) {
  const auto tracker = position_tracker();
  const Scene first = scene_of(0, {{0, 0}, {1, 0}});
  for (const auto& ballot : tracker->vote(first)) {
    EXPECT_TRUE(ballot.votes);
    EXPECT_THAT(ballot.fits, IsEmpty());
    EXPECT_FALSE(ballot.choice);
  }
  const auto a = tracker->follow(first.clusters[0], {}), b = tracker->follow(first.clusters[1], {});
  EXPECT_NE(a, b);
  const auto ballots = tracker->vote(scene_of(1, {{1.02, 0}, {0, 0.01}, {5, 5}}));
  EXPECT_EQ(ballots[0].choice, b);
  EXPECT_EQ(ballots[1].choice, a);
  EXPECT_FALSE(ballots[2].choice);
  ASSERT_EQ(ballots[1].fits.size(), 2u);
  EXPECT_GT(ballots[1].fits[0].second, 0.99);
  EXPECT_LT(ballots[1].fits[1].second, tracker->gate());
  tracker->drop(a);
  EXPECT_FALSE(tracker->vote(scene_of(2, {{0, 0}}))[0].choice);
  EXPECT_NE(tracker->follow(first.clusters[0], {}), a) << "a number is used once";
}

TEST(FeatureTracker, WhatItCannotCompareIsNoVoteAndNotForgotten) {
  const auto tracker = shape_tracker();
  const Scene seen = scene_of(0, {{0, 0, kRed, {1, 2, 3}}}), blurred = scene_of(1, {{0, 0, kRed}});
  const auto track = tracker->follow(seen.clusters[0], {});
  EXPECT_FALSE(tracker->vote(blurred)[0].votes);
  EXPECT_EQ(tracker->follow(blurred.clusters[0], track), track);
  EXPECT_EQ(tracker->vote(seen)[0].choice, track);
}

TEST(TrackingArbiter, AsksNobodyWhereTheTrackersAgree) {
  SceneTracker tracker = arbitrated_tracker();
  const std::vector<std::string> names = names_in(fed(tracker, scene_of(0, {{0, 0, kRed}, {1, 0, kBlue}})));
  const TrackingStep step = fed(tracker, scene_of(1, {{1.01, 0, kBlue}, {0, 0.02, kRed}, {0.5, 0.9, {0.1, 0.9, 0.1}}}));
  EXPECT_EQ(step.verdict, Verdict::kAgreed) << step.reason;
  EXPECT_EQ(step.method, "arbiter");
  EXPECT_EQ(step.evidence, "");
  EXPECT_EQ(step.clusters[0].object, names[1]);
  EXPECT_EQ(step.clusters[1].object, names[0]);
  EXPECT_EQ(step.clusters[0].explanation, "stay");
  EXPECT_EQ(step.clusters[2].explanation, "appear");
  for (const auto& entry : step.clusters) EXPECT_GE(entry.probability, ArbiterOptions{}.sure);
  ASSERT_EQ(step.clusters[0].votes.size(), 2u) << "nothing was said about shapes";
  EXPECT_EQ(step.clusters[0].votes[0].first, "position");
  EXPECT_TRUE(step.clusters[0].votes[0].second);
  const TrackingStep gone = fed(tracker, scene_of(2, {{1, 0, kBlue}}));
  EXPECT_EQ(gone.verdict, Verdict::kAgreed);
  EXPECT_EQ(gone.disappeared.size(), 2u);
  ASSERT_TRUE(tracker.arbiter_counts());
  EXPECT_EQ(tracker.arbiter_counts()->scenes, 3u);
  EXPECT_EQ(tracker.arbiter_counts()->calls(), 0u);
  EXPECT_EQ(tracker.arbiter_counts()->share_of_calls(), 0);
}

TEST(TrackingArbiter, AsksTheModelWhenLookAlikesChangedPlaces) {
  SceneTracker tracker = arbitrated_tracker();
  const auto names = names_in(fed(tracker, scene_of(0, {{0, 0, kBlue}, {1, 0, kDarkBlue}})));
  const TrackingStep step = fed(tracker, scene_of(1, {{0, 0, kDarkBlue}, {1, 0, kBlue}}));
  EXPECT_EQ(step.verdict, Verdict::kContradicted);
  EXPECT_THAT(step.reason, HasSubstr("others do not"));
  EXPECT_NE(step.method, "arbiter");
  EXPECT_NE(step.evidence, "");
  EXPECT_EQ(tracker.arbiter_counts()->contradicted, 1u);
  EXPECT_EQ(tracker.arbiter_counts()->share_of_calls(), 0.5);
  // The trackers learned what the model said: they agree again.
  EXPECT_EQ(fed(tracker, scene_of(2, {{0, 0, kDarkBlue}, {1, 0, kBlue}})).verdict, Verdict::kAgreed);
}

TEST(TrackingArbiter, AMoveIsForTheModelToSay) {
  SceneTracker tracker = arbitrated_tracker();
  const auto names = names_in(fed(tracker, scene_of(0, {{0, 0, kRed}, {1, 0, kBlue}})));
  const TrackingStep step = fed(tracker, scene_of(1, {{0.5, 0.9, kRed}, {1, 0, kBlue}}));
  EXPECT_EQ(step.verdict, Verdict::kContradicted);
  EXPECT_EQ(names_in(step), names);
  EXPECT_EQ(step.clusters[0].explanation, "move");
}

TEST(TrackingArbiter, IsUnsureWhereTwinsAreClose) {
  SceneTracker tracker = arbitrated_tracker();
  fed(tracker, scene_of(0, {{0, 0, kRed}, {0.08, 0, kRed}}));
  const TrackingStep step = fed(tracker, scene_of(1, {{0.02, 0, kRed}, {0.07, 0, kRed}}));
  EXPECT_EQ(step.verdict, Verdict::kUnsure);
  EXPECT_THAT(step.reason, HasSubstr("probability"));
  EXPECT_EQ(tracker.arbiter_counts()->unsure, 1u);
}

TEST(TrackingArbiter, IsUnsureWhereOneTrackerAloneSpeaks) {
  TrackingArbiter arbiter;
  Scene first = scene_of(0, {{0, 0}});
  std::erase_if(first.clusters[0].annotations,
                [](const Annotation& annotation) { return annotation.type == "sherlog.annotation.MeanColor"; });
  const std::vector<std::string> objects = {"cup"};
  EXPECT_EQ(arbiter.judge(first, {}, {}).verdict, Verdict::kAgreed) << "there is nothing that it could be";
  arbiter.resume("cup", first.clusters[0]);
  const Judgement judgement = arbiter.judge(first, objects, {false});
  EXPECT_EQ(judgement.verdict, Verdict::kUnsure);
  EXPECT_THAT(judgement.reason, HasSubstr("1, but 2 are needed"));
  EXPECT_EQ(judgement.association[0], 0u);
}

TEST(TrackingArbiter, DoesNotBelieveInThingsSeenWhereNobodyLooked) {
  SceneTracker tracker = arbitrated_tracker();
  fed(tracker, scene_of(0, {{0, 0, kRed}}));
  const TrackingStep step = fed(tracker, looking_at(scene_of(1, {{0.1, 0, kRed}}), {0.05, -1}, {1, 1}));
  EXPECT_EQ(step.verdict, Verdict::kContradicted);
  EXPECT_THAT(step.reason, HasSubstr("out of view"));
}

TEST(TrackingArbiter, NamesStayOverAnOcclusion) {
  SceneTracker tracker = arbitrated_tracker();
  const Thing cup{0, 0, kRed}, plate{1, 0, kBlue};
  const auto names = names_in(fed(tracker, scene_of(0, {cup, plate})));
  for (int t = 1; t <= 10; ++t) {
    const TrackingStep step = fed(tracker, scene_of(t, {plate}));
    EXPECT_THAT(names_in(step), ElementsAre(names[1]));
  }
  const TrackingStep step = fed(tracker, scene_of(11, {plate, cup}));
  EXPECT_THAT(names_in(step), ElementsAre(names[1], names[0]));
  EXPECT_EQ(step.verdict, Verdict::kAgreed);
  EXPECT_EQ(tracker.arbiter_counts()->calls(), 0u);
}

// D16: on frame-to-frame data the arbiter alone is right, and hardly ever asks.
TEST(TrackingArbiter, AloneIsEnoughFromFrameToFrame) {
  std::mt19937 random(5);
  std::normal_distribution<double> noise(0, 0.015);
  std::uniform_real_distribution<double> uniform(0, 1);
  std::vector<Thing> things;
  for (int i = 0; i < 8; ++i) {
    Thing thing{0.4 * (i % 3), 0.4 * (i / 3), {uniform(random), uniform(random), uniform(random)}, {}};
    for (int k = 0; k < 8; ++k) thing.feature.push_back(uniform(random));
    things.push_back(thing);
  }
  SceneTracker tracker = arbitrated_tracker();
  std::vector<std::string> name(things.size());
  std::size_t right = 0, all = 0;
  for (int t = 0; t < 60; ++t) {
    std::vector<Thing> seen;
    std::vector<std::size_t> which;
    for (std::size_t i = 0; i < things.size(); ++i) {
      if (t > 0 && uniform(random) < 0.1) continue;  // hidden behind something
      Thing look = things[i];
      look.x += noise(random);
      look.y += noise(random);
      for (double& channel : look.color) channel = std::clamp(channel + noise(random), 0.0, 1.0);
      for (double& bin : look.feature) bin = std::max(0.0, bin + noise(random));
      seen.push_back(look);
      which.push_back(i);
    }
    const TrackingStep step = fed(tracker, scene_of(t, seen));
    for (std::size_t n = 0; n < which.size(); ++n) {
      if (t == 0) name[which[n]] = step.clusters[n].object;
      right += step.clusters[n].object == name[which[n]] ? 1u : 0u;
      ++all;
    }
    EXPECT_EQ(step.verdict == Verdict::kAgreed, step.evidence.empty());
  }
  EXPECT_GE(static_cast<double>(right), 0.99 * static_cast<double>(all));
  EXPECT_LE(tracker.arbiter_counts()->share_of_calls(), 0.05);
}

TEST(TrackingArbiter, TheSameScenesGiveTheSameSteps) {
  const auto run = [] {
    SceneTracker tracker = arbitrated_tracker();
    std::string text;
    for (const Scene& scene : {scene_of(0, {{0, 0, kRed}, {1, 0, kBlue}, {0.05, 0, kRed}}),
                               scene_of(1, {{0.03, 0, kRed}, {1, 0, kBlue}}), scene_of(2, {{0, 1, kBlue}})}) {
      text += json_text(step_to_json(fed(tracker, scene))) + "\n";
    }
    return text;
  };
  EXPECT_EQ(run(), run());
}

// A measurement of one's own is a class of its own.
class Weights : public Tracker {
 public:
  std::string name() const override { return "weight"; }
  double gate() const override { return 0.5; }
  std::vector<Ballot> vote(const Scene& scene) const override {
    std::vector<Ballot> ballots(scene.clusters.size());
    for (std::size_t n = 0; n < ballots.size(); ++n) {
      const double weight = weight_of(scene.clusters[n]);
      ballots[n].votes = weight > 0;
      for (const auto& [track, known] : tracks_) ballots[n].fits.emplace_back(track, known == weight ? 1.0 : 0.0);
    }
    return ballots;
  }
  TrackId follow(const Cluster& cluster, std::optional<TrackId> track) override {
    const TrackId id = track.value_or(tracks_.size() + 100);
    tracks_[id] = weight_of(cluster);
    return id;
  }
  void drop(TrackId track) override { tracks_.erase(track); }

 private:
  static double weight_of(const Cluster& cluster) {
    const Value* value = find(cluster.other, "weight");
    return value == nullptr ? 0 : value->number().value_or(0);
  }
  std::map<TrackId, double> tracks_;
};

TEST(TrackingArbiter, ATrackerOfOnesOwnVotesToo) {
  auto trackers = default_trackers();
  trackers.push_back(std::make_unique<Weights>());
  SceneTracker tracker = table1_tracker();
  tracker.use_arbiter(TrackingArbiter(std::move(trackers)));
  const auto scene = [](double time, double weight) {
    Scene result = scene_of(time, {{0, 0, kRed}});
    result.clusters[0].other = {{"weight", Value(weight)}};
    return result;
  };
  fed(tracker, scene(0, 2));
  const TrackingStep same = fed(tracker, scene(1, 2));
  EXPECT_EQ(same.verdict, Verdict::kAgreed);
  EXPECT_EQ(same.clusters[0].votes.back().first, "weight");
  EXPECT_EQ(fed(tracker, scene(2, 3)).verdict, Verdict::kContradicted);
}

TEST(TrackingArbiter, WhatIsForgottenIsNoCandidate) {
  TrackingArbiter arbiter;
  const Scene scene = scene_of(0, {{0, 0, kRed}, {1, 0, kBlue}});
  const std::vector<std::string> objects = {"a", "b"};
  arbiter.settle(scene, objects, Verdict::kAgreed);
  EXPECT_THAT(arbiter.judge(scene, objects, {false, false}).association, ElementsAre(0u, 1u));
  arbiter.forget("a");
  EXPECT_THAT(arbiter.judge(scene, objects, {false, false}).association, ElementsAre(std::nullopt, 1u));
  arbiter.resume("a", scene.clusters[0]);
  EXPECT_THAT(arbiter.judge(scene, objects, {false, false}).association, ElementsAre(0u, 1u));
}

TEST(TrackingArbiter, BadOptionsAreNamed) {
  EXPECT_EQ(validate(ArbiterOptions{}), "");
  EXPECT_THAT(validate(ArbiterOptions{.sure = 0}), HasSubstr("sure is 0"));
  EXPECT_THAT(validate(ArbiterOptions{.sure = 1.5}), HasSubstr("1.5"));
  EXPECT_THAT(validate(ArbiterOptions{.votes_needed = 0}), HasSubstr("votes_needed"));
}

}  // namespace
}  // namespace sherlog
