// Who is who over time: names that last, what is out of view, and second thoughts.
#include "perception_bridge/scene_tracker.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <random>
#include <set>

#include "tests/unit/perception_bridge/tracking_scenes.h"

namespace sherlog {
namespace {

using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;
using testing::SizeIs;
using testing::UnorderedElementsAre;

const std::array<double, 3> kWhite = {0.95, 0.95, 0.95}, kRed = {0.9, 0.1, 0.1}, kGreen = {0.1, 0.8, 0.1},
                            kBlue = {0.1, 0.1, 0.9}, kYellow = {0.9, 0.9, 0.1}, kBlack = {0.02, 0.02, 0.02};

const TrackedObject& object_named(const SceneTracker& tracker, const std::string& name) {
  const auto found =
      std::ranges::find_if(tracker.objects(), [&](const TrackedObject& object) { return object.identity.id == name; });
  EXPECT_NE(found, tracker.objects().end()) << name;
  return *found;
}

// --- B6: ten steps ---

TEST(SceneTracker, KeepsNamesOverTenStepsOfMovesRemovalOcclusionAndOtherViews) {
  SceneTracker tracker = table1_tracker();
  const Thing red{0.2, 0.2, kRed}, green{0.8, 0.2, kGreen}, blue{0.2, 0.8, kBlue}, yellow{0.8, 0.8, kYellow},
      black{3.2, 0.2, kBlack};
  const auto near = [](double t, const std::vector<Thing>& things) {
    return looking_at(scene_of(t, things), {-0.2, -0.2}, {1.2, 1.2});
  };
  const auto far = [](double t, const std::vector<Thing>& things) {
    return looking_at(scene_of(t, things), {2.5, -0.2}, {3.9, 1.2});
  };
  // 1: all on the near table. 2: the same.
  const auto names = names_in(fed(tracker, near(1, {red, green, blue, yellow})));
  EXPECT_EQ(names_in(fed(tracker, near(2, {red, green, blue, yellow}))), names);
  // 3: red is moved.
  Thing moved = red;
  moved.x = moved.y = 0.5;
  TrackingStep step = fed(tracker, near(3, {green, moved, blue, yellow}));
  EXPECT_THAT(names_in(step), ElementsAre(names[1], names[0], names[2], names[3]));
  EXPECT_EQ(step.clusters[1].explanation, "move");
  // 4: green is taken away.
  step = fed(tracker, near(4, {moved, blue, yellow}));
  EXPECT_THAT(names_in(step), ElementsAre(names[0], names[2], names[3]));
  EXPECT_THAT(step.disappeared, ElementsAre(names[1]));
  // 5: the other table, with one more thing; nothing of the near one has disappeared by that.
  step = fed(tracker, far(5, {black}));
  EXPECT_EQ(step.clusters[0].explanation, "appear");
  EXPECT_THAT(step.disappeared, IsEmpty());
  EXPECT_THAT(step.hidden, SizeIs(4));
  const std::string black_name = step.clusters[0].object;
  EXPECT_THAT(names, Not(Contains(black_name)));
  EXPECT_FALSE(object_named(tracker, names[2]).identity.disappeared);
  EXPECT_TRUE(object_named(tracker, names[1]).identity.disappeared) << "it was gone before";
  // 6, 7: back; blue is behind something.
  for (double t : {6.0, 7.0}) {
    step = fed(tracker, near(t, {moved, yellow}));
    EXPECT_THAT(names_in(step), ElementsAre(names[0], names[3]));
    EXPECT_THAT(step.hidden, ElementsAre(black_name));
    EXPECT_THAT(step.disappeared, UnorderedElementsAre(names[1], names[2]));
  }
  // 8: blue and green are there again, green elsewhere.
  Thing returned = green;
  returned.x = 1.0;
  returned.y = 0.5;
  step = fed(tracker, near(8, {blue, returned, moved, yellow}));
  EXPECT_THAT(names_in(step), ElementsAre(names[2], names[1], names[0], names[3]));
  EXPECT_THAT(step.disappeared, IsEmpty());
  // 9: the other table, where nothing has changed. 10: everything at a glance.
  EXPECT_THAT(names_in(fed(tracker, far(9, {black}))), ElementsAre(black_name));
  step = fed(tracker, scene_of(10, {black, yellow, blue, returned, moved}));
  EXPECT_THAT(names_in(step), ElementsAre(black_name, names[3], names[2], names[1], names[0]));
  EXPECT_EQ(tracker.objects().size(), 5u);
  EXPECT_THAT(object_named(tracker, names[3]).identity.sightings, SizeIs(8));
}

TEST(SceneTracker, WhatIsOccludedForTenStepsKeepsItsName) {
  SceneTracker tracker = table1_tracker();
  const Thing cup{0, 0, kRed}, plate{1, 0, kBlue};
  const auto names = names_in(fed(tracker, scene_of(0, {cup, plate})));
  for (int t = 1; t <= 10; ++t) fed(tracker, scene_of(t, {plate}));
  EXPECT_THAT(names_in(fed(tracker, scene_of(11, {cup, plate}))), ElementsAre(names[0], names[1]));
}

// B8, with the tracker, both alone and under an arbiter.
TEST(SceneTracker, NothingOutOfViewIsEverReportedAsDisappeared) {
  for (const bool with_arbiter : {false, true}) {
    std::mt19937 random(7);
    std::uniform_real_distribution<double> uniform(0, 1);
    SceneTracker tracker = with_arbiter ? arbitrated_tracker() : table1_tracker();
    std::vector<Thing> things;
    for (int i = 0; i < 6; ++i)
      things.push_back({2 * uniform(random), uniform(random), {uniform(random), uniform(random), uniform(random)}});
    for (int t = 0; t < 40; ++t) {
      if (uniform(random) < 0.3) things[static_cast<std::size_t>(6 * uniform(random))].x = 2 * uniform(random);
      const double left = 1.2 * uniform(random);
      std::vector<Thing> seen;
      for (const Thing& thing : things) {
        if (thing.x >= left && thing.x <= left + 0.8 && uniform(random) > 0.1) seen.push_back(thing);
      }
      const Scene scene = looking_at(scene_of(t, seen), {left, 0}, {left + 0.8, 1});
      std::map<std::string, bool> out;
      for (const TrackedObject& object : tracker.objects())
        out[object.identity.id] = out_of_view_of({&object.cluster, 1}, scene).front();
      const TrackingStep step = fed(tracker, scene);
      for (const std::string& name : step.disappeared) EXPECT_FALSE(out.at(name)) << name << " in scene " << t;
      for (const std::string& name : step.hidden) EXPECT_TRUE(out.at(name)) << name << " in scene " << t;
      const auto objects = names_in(step);
      EXPECT_EQ(std::set<std::string>(objects.begin(), objects.end()).size(), objects.size())
          << "no object is in two places";
    }
  }
}

// --- bad and empty scenes ---

TEST(SceneTracker, RefusesASceneOlderThanTheLastAndGoesOn) {
  SceneTracker tracker = table1_tracker();
  fed(tracker, scene_of(5, {{0, 0, kRed}}));
  Monitor quiet;
  const TrackingStep step = tracker.feed(scene_of(4, {{0, 0, kRed}}), quiet);
  EXPECT_EQ(step.termination, Termination::kRefused);
  EXPECT_THAT(step.message, HasSubstr("scene 's4' at 4 is older than the last one, at 5"));
  EXPECT_THAT(step.clusters, IsEmpty());
  EXPECT_EQ(object_named(tracker, "object-1").identity.sightings.size(), 1u);
  EXPECT_EQ(fed(tracker, scene_of(5, {{0, 0, kRed}})).clusters[0].object, "object-1") << "of the same time is fine";
}

TEST(SceneTracker, RefusesMorePairsThanTheLimitSays) {
  SceneTracker tracker = table1_tracker({.most_pairs = 5});
  fed(tracker, scene_of(0, {{0, 0}, {1, 0}, {2, 0}}));
  Monitor quiet;
  const TrackingStep step = tracker.feed(scene_of(1, {{0, 0}, {1, 0}}), quiet);
  EXPECT_EQ(step.termination, Termination::kRefused);
  EXPECT_THAT(step.message, HasSubstr("2 clusters against 3 objects: 6 pairs, and the limit is 5"));
  EXPECT_EQ(tracker.last_time(), 0);
  EXPECT_EQ(fed(tracker, scene_of(2, {{0, 0}})).clusters[0].object, "object-1");
}

TEST(SceneTracker, EmptyScenesAreScenes) {
  SceneTracker tracker = table1_tracker();
  EXPECT_THAT(fed(tracker, scene_of(0, {})).clusters, IsEmpty());
  fed(tracker, scene_of(1, {{0, 0, kRed}}));
  EXPECT_THAT(fed(tracker, scene_of(2, {})).disappeared, ElementsAre("object-1"));
  EXPECT_EQ(fed(tracker, scene_of(3, {{0, 0, kRed}})).clusters[0].object, "object-1");
}

TEST(SceneTracker, ClustersWithoutAnnotationsAreNewOrAnything) {
  SceneTracker tracker = table1_tracker();
  Scene bare = scene_of(0, {{0, 0}});
  bare.clusters[0].annotations.clear();
  EXPECT_EQ(fed(tracker, bare).clusters[0].explanation, "appear");
  bare.id = "again";
  bare.timestamp = 1;
  EXPECT_EQ(fed(tracker, bare).clusters.size(), 1u);
}

TEST(SceneTracker, ForgetsWhatWasNotSeenForLong) {
  SceneTracker tracker = table1_tracker({.forget_seconds = 10});
  fed(tracker, scene_of(0, {{0, 0, kRed}}));
  EXPECT_EQ(fed(tracker, scene_of(9, {{0, 0, kRed}})).clusters[0].object, "object-1");
  EXPECT_EQ(fed(tracker, scene_of(30, {{0, 0, kRed}})).clusters[0].object, "object-2");
}

TEST(SceneTracker, KeepsWhatOlderSightingsSay) {
  SceneTracker tracker = table1_tracker();
  fed(tracker, scene_of(0, {{0, 0, kRed, {}, "0123"}}));
  fed(tracker, scene_of(1, {{0.1, 0, kRed}}));
  const Cluster& look = object_named(tracker, "object-1").cluster;
  EXPECT_THAT(annotations_of(look.annotations, "rs.annotation.PerceptualHash"), SizeIs(1));
  EXPECT_THAT(position_of(look)->coordinates, ElementsAre(0.1, 0.0));
  EXPECT_THAT(annotations_of(look.annotations, "sherlog.annotation.MeanColor"), SizeIs(1));
}

TEST(SceneTracker, SaysWhatAModelOrAMappingLacks) {
  Diagnostics diagnostics;
  std::string problem;
  const auto problem_of = [&](const std::string& model, const std::string& mapping) {
    EXPECT_FALSE(SceneTracker::make(*parse_model(model, "m", diagnostics), *shipped_mapping(mapping), {}, {}, problem));
    return problem;
  };
  EXPECT_THAT(problem_of("is(o,n,e)\n", "identity"), HasSubstr("'appear'"));
  EXPECT_THAT(problem_of(std::string(paper_identity_model()), "fusion"), HasSubstr("no rule for pairs"));
  EXPECT_THAT(problem_of(std::string(paper_identity_model()), "robosherlock"), HasSubstr("looksSimilar"));
}

// --- second thoughts ---

// Two equal cups with a mark on the bottom; then both stand elsewhere, and the marks do not show.
struct Cups {
  Thing a{0, 0, kWhite, {}, "0000"}, b{1, 0, kWhite, {}, "ffff"};
  Thing left{0.5, 0.5, kWhite}, right{0.5, -0.5, kWhite};
  // The marks show again: the right cup is that one.
  std::vector<Thing> marked(const std::string& of_left, const std::string& of_right) const {
    Thing l = left, r = right;
    l.hash = of_left;
    r.hash = of_right;
    return {l, r};
  }
};

TEST(OpenQuestion, AnUnclearSightingKeepsItsAlternatives) {
  SceneTracker tracker = table1_tracker();
  const Cups cups;
  const auto names = names_in(fed(tracker, scene_of(0, {cups.a, cups.b})));
  EXPECT_THAT(tracker.open_questions(), IsEmpty());
  const TrackingStep step = fed(tracker, scene_of(1, {cups.left, cups.right}));
  ASSERT_THAT(tracker.open_questions(), SizeIs(1));
  const OpenQuestion& question = tracker.open_questions()[0];
  EXPECT_THAT(question.open, ElementsAre(true, true));
  EXPECT_EQ(question.scene.id, "s1");
  EXPECT_NEAR(*step.clusters[0].probability, step.clusters[0].others.at(0).probability, 1e-6);
  EXPECT_THAT(names_in(step), UnorderedElementsAre(names[0], names[1]));
  // Nobody knows which mark is where.
  for (const TrackedObject& object : tracker.objects())
    EXPECT_THAT(annotations_of(object.cluster.annotations, "rs.annotation.PerceptualHash"), IsEmpty());
  // Scenes that say nothing new leave it open.
  EXPECT_EQ(names_in(fed(tracker, scene_of(2, {cups.left, cups.right}))), names_in(step));
  EXPECT_THAT(tracker.open_questions(), SizeIs(1));
}

TEST(OpenQuestion, ALaterSceneChangesWhoWasWho) {
  for (const bool with_arbiter : {false, true}) {
    SceneTracker tracker = with_arbiter ? arbitrated_tracker() : table1_tracker();
    const Cups cups;
    fed(tracker, scene_of(0, {cups.a, cups.b}));
    const auto guessed = names_in(fed(tracker, scene_of(1, {cups.left, cups.right})));
    fed(tracker, scene_of(2, {cups.left, cups.right}));
    // The marks say that the guess was wrong.
    const bool left_is_a = guessed[0] == "object-1";
    const auto marks = left_is_a ? cups.marked("ffff", "0000") : cups.marked("0000", "ffff");
    const TrackingStep step = fed(tracker, scene_of(3, marks));
    EXPECT_THAT(names_in(step), ElementsAre(guessed[1], guessed[0]));
    ASSERT_THAT(step.revisions, SizeIs(2));
    EXPECT_EQ(step.revisions[0].scene, "s1");
    EXPECT_EQ(step.revisions[0].cluster, "c0");
    EXPECT_EQ(step.revisions[0].was, guessed[0]);
    EXPECT_EQ(step.revisions[0].is, guessed[1]);
    EXPECT_GT(step.revisions[0].probability, 0.8);
    EXPECT_THAT(tracker.open_questions(), IsEmpty());
    // The whole history since, and its record.
    for (std::size_t n = 0; n < 2; ++n) {
      const Identity& identity = object_named(tracker, guessed[1 - n]).identity;
      ASSERT_THAT(identity.sightings, SizeIs(4));
      for (std::size_t i = 1; i < 4; ++i) EXPECT_EQ(identity.sightings[i].cluster, "c" + std::to_string(n));
      EXPECT_EQ(identity.sightings[1].explanation, "move");
      EXPECT_GT(identity.sightings[1].probability, 0.8);
      EXPECT_EQ(identity.last_seen, 3);
      const Value* records = find(identity.other, "revisions");
      ASSERT_TRUE(records != nullptr && records->list() != nullptr);
      EXPECT_THAT(*records->list(), SizeIs(2)) << "what was taken from it, and what it got";
      EXPECT_EQ(*records->list()->at(0).find("decidedBy")->text(), "s3");
    }
    EXPECT_THAT(json_text(step_to_json(step)), HasSubstr("\"revisions\":[{\"scene\":\"s1\""));
    // It is consistent from here on.
    EXPECT_THAT(names_in(fed(tracker, scene_of(4, marks))), ElementsAre(guessed[1], guessed[0]));
    EXPECT_EQ(tracker.objects().size(), 2u);
  }
}

TEST(OpenQuestion, ALaterSceneConfirmsWhoWasWho) {
  SceneTracker tracker = table1_tracker();
  const Cups cups;
  fed(tracker, scene_of(0, {cups.a, cups.b}));
  const auto guessed = names_in(fed(tracker, scene_of(1, {cups.left, cups.right})));
  const auto marks = guessed[0] == "object-1" ? cups.marked("0000", "ffff") : cups.marked("ffff", "0000");
  const TrackingStep step = fed(tracker, scene_of(2, marks));
  EXPECT_EQ(names_in(step), guessed);
  EXPECT_THAT(step.revisions, IsEmpty());
  EXPECT_THAT(tracker.open_questions(), IsEmpty());
  EXPECT_GT(object_named(tracker, guessed[0]).identity.sightings[1].probability, 0.8) << "known now";
}

TEST(OpenQuestion, OneMarkIsEnoughForBoth) {
  SceneTracker tracker = table1_tracker();
  const Cups cups;
  fed(tracker, scene_of(0, {cups.a, cups.b}));
  const auto guessed = names_in(fed(tracker, scene_of(1, {cups.left, cups.right})));
  // The left one is hidden behind the hand that turns the right one.
  const bool left_is_a = guessed[0] == "object-1";
  const auto marks = left_is_a ? cups.marked("", "0000") : cups.marked("", "ffff");
  const TrackingStep step = fed(tracker, scene_of(2, {marks[1]}));
  EXPECT_THAT(names_in(step), ElementsAre(guessed[0]));
  EXPECT_THAT(step.disappeared, ElementsAre(guessed[1])) << "the left one, by its new name";
  EXPECT_THAT(step.revisions, SizeIs(2));
}

TEST(OpenQuestion, WhatSeemedNewIsFoundToBeAnOldThing) {
  SceneTracker tracker = table1_tracker({.settled = 0.7});
  // Another light and another place: 0.47 similar, 0.05 near.
  const Thing before{0, 0, {0.5, 0.5, 0.5}, {1, 5, 2, 8}, "0ff0"}, after{0.865, 0, {0.9345, 0.5, 0.5}};
  Thing later = after;
  later.feature = before.feature;
  later.hash = before.hash;
  fed(tracker, scene_of(0, {before}));
  const TrackingStep unclear = fed(tracker, scene_of(1, {after}));
  ASSERT_THAT(tracker.open_questions(), SizeIs(1)) << *unclear.clusters[0].probability;
  ASSERT_EQ(unclear.clusters[0].object, "object-2");
  const TrackingStep step = fed(tracker, scene_of(2, {later}));
  EXPECT_THAT(step.clusters[0].object, "object-1");
  EXPECT_THAT(step.disappeared, IsEmpty());
  EXPECT_THAT(tracker.removed(), ElementsAre("object-2"));
  ASSERT_EQ(tracker.objects().size(), 1u);
  EXPECT_THAT(tracker.objects()[0].identity.sightings, SizeIs(3));
  EXPECT_EQ(fed(tracker, scene_of(3, {later, {9, 9, kRed}})).clusters[1].object, "object-3") << "no name is used twice";
}

TEST(OpenQuestion, WhatSeemedOldIsFoundToBeNew) {
  SceneTracker tracker = table1_tracker({.settled = 0.7});
  const Thing before{0, 0, {0.5, 0.5, 0.5}, {}, "0000"}, after{0.8, 0, {0.5, 0.9, 0.5}};
  Thing later = after;
  later.hash = "ffff";
  fed(tracker, scene_of(0, {before}));
  const TrackingStep unclear = fed(tracker, scene_of(1, {after}));
  ASSERT_THAT(tracker.open_questions(), SizeIs(1)) << *unclear.clusters[0].probability;
  ASSERT_EQ(unclear.clusters[0].object, "object-1");
  const TrackingStep step = fed(tracker, scene_of(2, {later}));
  EXPECT_THAT(step.clusters[0].object, "object-2");
  EXPECT_THAT(step.disappeared, ElementsAre("object-1"));
  const Identity& old = object_named(tracker, "object-1").identity;
  EXPECT_THAT(old.sightings, SizeIs(1));
  EXPECT_EQ(old.last_seen, 0);
  EXPECT_TRUE(old.disappeared);
  EXPECT_THAT(object_named(tracker, "object-2").identity.sightings, SizeIs(2));
  EXPECT_THAT(tracker.removed(), IsEmpty());
}

TEST(OpenQuestion, OnlySoManyAreKept) {
  SceneTracker tracker = table1_tracker({.most_questions = 2});
  for (int t = 0; t < 6; ++t) {
    const double shift = t % 2 == 0 ? 0.0 : 3.0;
    fed(tracker, scene_of(t, {{shift, 0.5, kWhite}, {shift, -0.5, kWhite}}));
    EXPECT_LE(tracker.open_questions().size(), 2u);
  }
  EXPECT_EQ(tracker.open_questions().size(), 2u);
  EXPECT_EQ(tracker.open_questions().back().scene.id, "s5");
}

TEST(OpenQuestion, ALookIsCompletedByWhatItLacksAndNotByPlaces) {
  Cluster earlier = cluster_of("c", {0, 0, kRed});
  EXPECT_FALSE(complete_look(earlier, cluster_of("d", {5, 5, kBlue})));
  EXPECT_TRUE(complete_look(earlier, cluster_of("d", {5, 5, kBlue, {}, "00"})));
  EXPECT_FALSE(complete_look(earlier, cluster_of("e", {6, 6, kBlue, {}, "ff"}))) << "the first mark counts";
  EXPECT_THAT(position_of(earlier)->coordinates, ElementsAre(0.0, 0.0));
  ASSERT_THAT(earlier.annotations, SizeIs(3));
  EXPECT_EQ(*find(earlier.annotations[2].fields, "hash")->text(), "00");
}

// --- where a thing was last ---

// Said in three ways; `frame` is that of its scene.
enum class Said : std::uint8_t { kPose, kLocation, kPoints, kNot };
Scene scene_with(double time, Said said, double x, const std::string& frame = "map") {
  Scene scene = scene_of(time, {{x, 0, kRed}});
  scene.frame = frame;
  Cluster& cluster = scene.clusters[0];
  cluster.annotations.erase(cluster.annotations.begin());
  const Value at = number_list({x, 0, 0});
  if (said == Said::kPose) {
    const Value pose(Value::Object{{"translation", at}, {"rotation", number_list({0, 0, 0, 1})}});
    cluster.annotations.push_back(made("rs.annotation.PoseAnnotation", {{"world", pose}}));
  }
  if (said == Said::kLocation)
    cluster.annotations.push_back(made("rs.annotation.LocationAnnotation", {{"position", at}}));
  if (said == Said::kPoints) cluster.hypotheses.push_back(made("rs.scene.ClusterPoints", {{"centroid", at}}));
  take_frame_of_scene(scene);
  return scene;
}

TEST(SceneTrackerPlaces, TheLastPositionCountsInWhateverWordsItIsSaid) {
  for (const Said before : {Said::kPose, Said::kLocation, Said::kPoints}) {
    for (const Said after : {Said::kPose, Said::kLocation, Said::kPoints}) {
      for (const bool arbitrated : {false, true}) {
        SceneTracker tracker = arbitrated ? arbitrated_tracker() : table1_tracker();
        fed(tracker, scene_with(0, before, 0));
        EXPECT_THAT(names_in(fed(tracker, scene_with(1, after, 5))), ElementsAre("object-1"));
        EXPECT_THAT(fed(tracker, looking_at(scene_of(2, {}), {-1, -1}, {1, 1})).hidden, ElementsAre("object-1"));
        EXPECT_THAT(fed(tracker, looking_at(scene_of(3, {}), {4, -1}, {6, 1})).disappeared, ElementsAre("object-1"));
      }
    }
  }
}

TEST(SceneTrackerPlaces, APositionThatIsNotReplacedStaysInItsFrame) {
  for (const Said before : {Said::kPose, Said::kLocation, Said::kPoints}) {
    SceneTracker tracker = table1_tracker();
    fed(tracker, scene_with(0, before, 0));
    EXPECT_THAT(names_in(fed(tracker, scene_with(1, Said::kNot, 0, "odom"))), ElementsAre("object-1"));
    EXPECT_EQ(position_of(tracker.objects()[0].cluster)->frame, "map");
    Scene elsewhere = looking_at(scene_of(2, {}), {-1, -1}, {1, 1});
    elsewhere.annotations[0].frame = "odom";
    EXPECT_THAT(fed(tracker, elsewhere).hidden, ElementsAre("object-1"));
    EXPECT_THAT(fed(tracker, looking_at(scene_of(3, {}), {-1, -1}, {1, 1})).disappeared, ElementsAre("object-1"));
  }
}

// --- going on later ---

TEST(SceneTrackerState, ATrackerThatWasStoppedGoesOnAsIfItHadNot) {
  const Cups cups;
  const std::vector<Scene> scenes = {scene_of(0, {cups.a, cups.b}), scene_of(1, {cups.left, cups.right}),
                                     scene_of(2, {cups.left}), scene_of(3, cups.marked("ffff", "0000")),
                                     scene_of(4, {cups.left, {3, 3, kRed}})};
  SceneTracker at_once = table1_tracker();
  std::vector<std::string> expected;
  for (const Scene& scene : scenes) expected.push_back(json_text(step_to_json(fed(at_once, scene))));
  SceneTracker tracker = table1_tracker();
  for (std::size_t i = 0; i < scenes.size(); ++i) {
    EXPECT_EQ(json_text(step_to_json(fed(tracker, scenes[i]))), expected[i]);
    // As text, since that is what a store keeps.
    std::string problem;
    const auto state = parse_json(json_text(tracker.state()), problem);
    ASSERT_TRUE(state) << problem;
    SceneTracker next = table1_tracker();
    // In another order than that in which they came.
    for (auto object = tracker.objects().rbegin(); object != tracker.objects().rend(); ++object)
      next.resume(object->identity, Cluster{}, 0);
    ASSERT_TRUE(next.restore(*state, problem)) << problem;
    EXPECT_EQ(next.last_time(), tracker.last_time());
    tracker = std::move(next);
  }
}

TEST(SceneTrackerState, WhatIsNoStateIsRefused) {
  SceneTracker tracker = table1_tracker();
  fed(tracker, scene_of(0, {{0, 0, kRed}}));
  std::string problem;
  for (const char* text : {"{}", "[]", R"({"names":-1,"objects":[],"questions":[]})",
                           R"({"names":1,"objects":[{"id":"x"}],"questions":[]})",
                           R"({"names":1,"objects":[],"questions":[{"scene":{}}]})"}) {
    EXPECT_FALSE(tracker.restore(*parse_json(text, problem), problem)) << text;
    EXPECT_THAT(problem, HasSubstr("not as it was written"));
  }
  EXPECT_EQ(fed(tracker, scene_of(1, {{0, 0, kRed}})).clusters[0].object, "object-1") << "nothing was changed";
}

}  // namespace
}  // namespace sherlog
