#include "perception_bridge/four_tables.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <set>

#include "perception_bridge/four_tables_json.h"
#include "perception_bridge/object_fates.h"
#include "perception_bridge/portable_random.h"
#include "perception_bridge/track_score.h"

namespace sherlog {
namespace {

using testing::HasSubstr;

constexpr auto kStay = ClusterExplanation::kStay, kMove = ClusterExplanation::kMove,
               kNewview = ClusterExplanation::kNewview, kDisappear = ClusterExplanation::kDisappear,
               kHidden = ClusterExplanation::kHidden;

Observation cluster(std::uint32_t object, std::uint32_t table, double x, double y) {
  Observation o;
  o.object = object;
  o.table = table;
  o.position = {x, y};
  return o;
}

// --- the truth, case by case

struct TruthCase {
  const char* claim;
  ObjectHistory history;
  bool seen_now;
  Observation old;
  ClusterExplanation expected;
};

TEST(FourTablesTruth, FollowsItsDefinition) {
  // The view: table 2, x from 0.1 to 1.
  const TruthCase cases[] = {
      {"untouched and seen", {false, false}, true, cluster(0, 2, 0.5, 0.5), kStay},
      {"moved and seen", {true, false}, true, cluster(0, 2, 0.5, 0.5), kMove},
      {"moved here from another table", {true, false}, true, cluster(0, 1, 0.5, 0.5), kMove},
      {"moved and changed is a move", {true, true}, true, cluster(0, 2, 0.5, 0.5), kMove},
      {"only changed is a new view", {false, true}, true, cluster(0, 2, 0.5, 0.5), kNewview},
      {"seen again though measured beside the view", {false, false}, true, cluster(0, 2, 0.05, 0.5), kStay},
      {"not seen, place in view", {true, false}, false, cluster(0, 2, 0.5, 0.5), kDisappear},
      {"not seen, place at the edge of the view", {false, false}, false, cluster(0, 2, 0.1, 1.0), kDisappear},
      {"not seen, place beside the view", {false, false}, false, cluster(0, 2, 0.09, 0.5), kHidden},
      {"removed, but its place is on another table", {false, false}, false, cluster(0, 3, 0.5, 0.5), kHidden},
  };
  for (const TruthCase& c : cases) {
    SCOPED_TRACE(c.claim);
    FourTablesTrial trial;
    trial.view = {2, {0.1, 0.0}, {1.0, 1.0}};
    trial.old_clusters = {c.old};
    trial.new_clusters = {cluster(1, 2, 0.3, 0.3)};  // nobody knows it: it has appeared
    if (c.seen_now) trial.new_clusters.push_back(cluster(0, 2, 0.6, 0.6));
    const Resolution truth = true_resolution(trial, {c.history, {}});
    EXPECT_EQ(truth.explanation[0], c.expected);
    EXPECT_FALSE(truth.association[0]);
    if (c.seen_now) {
      EXPECT_EQ(truth.association[1], 0u);
    }
  }
}

// --- the world

TEST(FourTables, ATrialDependsOnSeedAndNumberAlone) {
  const FourTablesConfig config;
  const auto line = [&](std::uint64_t seed, std::uint64_t number) {
    const FourTablesTrial trial = simulate_four_tables(config, seed, number);
    return trial_line(trial, {trial.truth, Termination::kCompleted, "", 0}, false);
  };
  EXPECT_EQ(line(1, 7), line(1, 7));
  EXPECT_NE(line(1, 7), line(1, 8));
  EXPECT_NE(line(1, 7), line(2, 7));
}

TEST(FourTables, EveryTrialIsConsistent) {
  FourTablesConfig config;
  config.noise = 0.1;
  config.actions = 5;
  std::set<ClusterExplanation> met;
  for (std::uint64_t number = 0; number < 500; ++number) {
    const FourTablesTrial trial = simulate_four_tables(config, 3, number);
    SCOPED_TRACE(number);
    EXPECT_EQ(trial.old_clusters.size(), 12u);  // 80 % of 15
    EXPECT_EQ(trial.actions.size(), 5u);
    EXPECT_LE(trial.view.max[0] - trial.view.min[0], 1.0);
    std::set<std::uint32_t> objects, acted;
    for (const SimulatedAction& a : trial.actions) acted.insert(a.object);
    for (const Observation& o : trial.old_clusters) {
      EXPECT_TRUE(objects.insert(o.object).second);
      EXPECT_EQ(o.out_of_view, !trial.view.contains(o.table, o.position));
      for (double x : o.position) EXPECT_TRUE(x >= 0 && x <= 1);
      for (double x : o.color) EXPECT_TRUE(x >= 0 && x <= 1);
    }
    std::set<std::uint32_t> seen;
    for (std::size_t n = 0; n < trial.new_clusters.size(); ++n) {
      const Observation& now = trial.new_clusters[n];
      EXPECT_TRUE(seen.insert(now.object).second);
      EXPECT_EQ(now.table, trial.view.table);
      EXPECT_EQ(trial.truth.association[n].has_value(), objects.contains(now.object));
      if (trial.truth.association[n]) {
        EXPECT_EQ(trial.old_clusters[*trial.truth.association[n]].object, now.object);
      }
    }
    for (std::size_t o = 0; o < trial.old_clusters.size(); ++o) {
      const ClusterExplanation e = trial.truth.explanation[o];
      met.insert(e);
      EXPECT_EQ(seen.contains(trial.old_clusters[o].object), e == kStay || e == kMove || e == kNewview);
      if (e == kHidden) {
        EXPECT_TRUE(trial.old_clusters[o].out_of_view);
      }
      if (e == kDisappear) {
        EXPECT_FALSE(trial.old_clusters[o].out_of_view);
      }
      if (e == kMove || e == kNewview) {
        EXPECT_TRUE(acted.contains(trial.old_clusters[o].object));
      }
    }
  }
  EXPECT_EQ(met.size(), 5u);
}

TEST(FourTables, WithoutActionsNothingMoves) {
  FourTablesConfig config;
  config.actions = 0;
  for (std::uint64_t number = 0; number < 50; ++number) {
    const FourTablesTrial trial = simulate_four_tables(config, 1, number);
    for (const ClusterExplanation e : trial.truth.explanation)
      EXPECT_TRUE(e == kStay || e == kHidden || e == kDisappear);
    for (const auto& partner : trial.truth.association) EXPECT_TRUE(partner);
  }
}

TEST(FourTables, AWorldWithoutObjectsIsAWorld) {
  FourTablesConfig config;
  config.objects = 0;
  const FourTablesTrial trial = simulate_four_tables(config, 1, 0);
  EXPECT_TRUE(trial.old_clusters.empty());
  EXPECT_TRUE(trial.actions.empty());  // there is nothing to act on
}

TEST(ObjectFates, AgreeWithTheSimulation) {
  FourTablesConfig config;
  config.actions = 5;
  config.tables = 1;  // with a view of the whole table every object that is there is seen
  config.sensor_range = 0;
  double stay = 0, move = 0, newview = 0, gone = 0, put = 0;
  constexpr int kTrials = 4000;
  for (std::uint64_t number = 0; number < kTrials; ++number) {
    const FourTablesTrial trial = simulate_four_tables(config, 5, number);
    for (const ClusterExplanation e : trial.truth.explanation) {
      (e == kStay ? stay : e == kMove ? move : e == kNewview ? newview : gone) += 1.0 / (12 * kTrials);
    }
    for (const auto& partner : trial.truth.association) put += partner ? 0 : 1.0 / (3 * kTrials);
  }
  const ObjectFates fates = object_fates(config);
  EXPECT_NEAR(fates.untouched, stay, 0.01);  // 48,000 objects: one standard error is at most 0.0023
  EXPECT_NEAR(fates.moved + fates.moved_and_changed, move, 0.01);
  EXPECT_NEAR(fates.changed, newview, 0.01);
  EXPECT_NEAR(fates.gone, gone, 0.01);
  EXPECT_NEAR(fates.put, put, 0.02);
}

// --- numbers

TEST(PortableRandom, LogarithmIsThatOfTheLibrary) {
  for (double x : {1e-300, 1e-9, 0.3, 0.7071, 0.99999, 1.0, 1.5, 2.0, 1e9}) {
    EXPECT_NEAR(portable_log(x), std::log(x), 1e-15 * (1 + std::abs(std::log(x)))) << x;
  }
}

TEST(PortableRandom, NormalsHaveTheMomentsOfNormals) {
  PortableRandom random(1, 1);
  double sum = 0, squares = 0, fourth = 0;
  constexpr int kDraws = 200000;
  for (int i = 0; i < kDraws; ++i) {
    const double z = random.normal();
    sum += z;
    squares += z * z;
    fourth += z * z * z * z;
  }
  EXPECT_NEAR(sum / kDraws, 0, 0.01);
  EXPECT_NEAR(squares / kDraws, 1, 0.015);
  EXPECT_NEAR(fourth / kDraws, 3, 0.15);
}

// --- configuration

TEST(FourTablesConfig, ReadsBackWhatItWrites) {
  FourTablesConfig config;
  config.noise = 0.075;
  config.tables = 7;
  FourTablesConfig read;
  EXPECT_EQ(read_config(to_json(config), read), "");
  EXPECT_EQ(to_json(read), to_json(config));
}

TEST(FourTablesConfig, BadOnesAreNamedAndChangeNothing) {
  FourTablesConfig config;
  const std::string before = to_json(config);
  EXPECT_THAT(read_config(R"({"nois": 0.1})", config), HasSubstr("unknown parameter 'nois'"));
  EXPECT_THAT(read_config(R"({"noise": -1})", config), HasSubstr("'noise' is -1"));
  EXPECT_THAT(read_config(R"({"noise": "big"})", config), HasSubstr("must be a number"));
  EXPECT_THAT(read_config(R"({"objects": 2.5})", config), HasSubstr("whole number"));
  EXPECT_THAT(read_config(R"({"sensor_range": 3})", config), HasSubstr("has to see some of the table"));
  EXPECT_THAT(read_config("[1]", config), HasSubstr("object"));
  EXPECT_NE(read_config("{", config), "");
  EXPECT_EQ(to_json(config), before);
}

// --- scores

TEST(TrackScore, CountsAsTheTruthAndTheAnswerSay) {
  FourTablesTrial trial;
  trial.config.objects = 3;
  trial.view = {1, {0, 0}, {1, 1}};
  trial.old_clusters = {cluster(0, 1, 0.1, 0.1), cluster(1, 2, 0.5, 0.5)};
  trial.new_clusters = {cluster(0, 1, 0.1, 0.1), cluster(2, 1, 0.9, 0.9)};
  trial.old_clusters[1].out_of_view = true;
  trial.actions = {{ActionKind::kPut, 2}};
  trial.truth = {{0u, std::nullopt}, {kStay, kHidden}};
  TrackScore right;
  right.add(trial, trial.truth);
  EXPECT_EQ(right.association.right(), 2u);
  EXPECT_EQ(right.explanation.total(), 3u);  // two old ones and one that has appeared
  EXPECT_EQ(right.explanation.right(), 3u);
  EXPECT_EQ(right.acted_on.total(), 1u);
  TrackScore wrong;
  wrong.add(trial, {{std::nullopt, 0u}, {kMove, kDisappear}});
  EXPECT_EQ(wrong.association.right(), 0u);
  EXPECT_EQ(wrong.explanation.right(), 0u);
  EXPECT_EQ(wrong.explanation.total(), 4u);  // it says that the other new one has appeared, too
  EXPECT_EQ(wrong.disappeared_out_of_view, 1u);
}

TEST(GroupedShare, IntervalsKnowThatThingsOfOneGroupGoTogether) {
  GroupedShare alone, together;
  for (int i = 0; i < 400; ++i) {
    alone.add(i % 4 != 0 ? 1 : 0, 1);
    if (i % 4 == 0) together.add(i % 16 != 0 ? 4 : 0, 4);
  }
  EXPECT_DOUBLE_EQ(alone.rate(), 0.75);
  EXPECT_DOUBLE_EQ(together.rate(), 0.75);
  const auto narrow = alone.interval(), wide = together.interval();
  EXPECT_NEAR(narrow.high - narrow.low, 2 * 1.96 * std::sqrt(0.75 * 0.25 / 400), 0.004);
  EXPECT_NEAR(wide.high - wide.low, 2 * 1.96 * std::sqrt(0.75 * 0.25 / 100), 0.004);
  GroupedShare perfect;
  perfect.add(10, 10);
  EXPECT_LT(perfect.interval().low, 0.8);  // ten right ones prove little
  EXPECT_NEAR(perfect.interval().high, 1.0, 1e-12);
}

}  // namespace
}  // namespace sherlog
