#include "perception_bridge/scene_store.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <cmath>
#include <filesystem>
#include <fstream>

#include "perception_bridge/kitchen_scenes.h"
#include "tests/unit/perception_bridge/scene_store_file.h"

namespace sherlog {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

TEST_F(SceneStoreFile, AHundredScenesComeOutAsTheyWentIn) {
  SceneStore store = open();
  std::vector<Scene> scenes;
  ASSERT_TRUE(store.begin());
  for (std::uint64_t i = 0; i < 103; ++i) {
    scenes.push_back(kitchen_scene(default_kitchen(), 3, i));
    EXPECT_THAT(validate(scenes.back()), IsEmpty());
    EXPECT_EQ(store.add(scenes.back()), SceneStore::Added::kNew);
  }
  ASSERT_TRUE(store.commit());
  SceneStore reader = open({.read_only = true});
  std::size_t next = 0;
  EXPECT_TRUE(reader.for_each_scene({}, [&](const Scene& scene) { return scene == scenes[next++]; }));
  EXPECT_EQ(next, 103u) << "the visit ends at the first difference";
  EXPECT_EQ(reader.scene("kitchen-3-50"), scenes[50]);
  EXPECT_EQ(reader.scene("kitchen-3-103"), std::nullopt);
  EXPECT_THAT(reader.check(), IsEmpty());
}

TEST_F(SceneStoreFile, TheNewestBeliefOfAKindIsFoundAndAKindIsRemoved) {
  SceneStore store = open();
  for (const auto& [id, time] : {std::pair{"late", 3.0}, std::pair{"early", 1.0}, std::pair{"other", 5.0}})
    store.add(small_scene(id, time, {}));
  EXPECT_FALSE(store.newest_belief("state"));
  for (const char* id : {"late", "early"}) ASSERT_TRUE(store.add(StoredBelief{id, "state", Value(id)}));
  ASSERT_TRUE(store.add(StoredBelief{"other", "identity", Value(true)}));
  const auto newest = store.newest_belief("state");
  ASSERT_TRUE(newest);
  EXPECT_EQ(newest->scene, "late");
  EXPECT_EQ(newest->document, Value("late"));
  ASSERT_TRUE(store.remove_beliefs("state"));
  EXPECT_FALSE(store.newest_belief("state"));
  EXPECT_TRUE(store.belief("other", "identity"));
}

TEST_F(SceneStoreFile, ReplacingASceneTakesItsOldPartsAway) {
  SceneStore store = open();
  ASSERT_EQ(store.add(small_scene("s", 1, {{"Milk", "table"}, {"Cup", "table"}})), SceneStore::Added::kNew);
  ASSERT_TRUE(store.add(StoredEvidence{"s", "fusion", "x"}));
  const Scene other = small_scene("s", 2, {{"Bowl", "fridge"}});
  EXPECT_EQ(store.add(other), SceneStore::Added::kDuplicate);
  EXPECT_EQ(store.add(other, true), SceneStore::Added::kReplaced);
  EXPECT_EQ(store.scene("s"), other);
  EXPECT_EQ(store.cluster_count(), 1u);
  EXPECT_THAT(store.find("Milk", {}), IsEmpty());
  EXPECT_EQ(store.evidence("s", "fusion"), std::nullopt);
  EXPECT_THAT(store.check(), IsEmpty());
}

TEST_F(SceneStoreFile, WhereAThingIsAndWas) {
  SceneStore store = open();
  store.add(small_scene("s1", 100, {{"Milk", "table"}, {"Cup", "table"}}));
  store.add(small_scene("s2", 200, {{"Milk", "fridge"}}));
  store.add(small_scene("s3", 300, {{"Cup", "table"}}));
  const auto milk = store.find("milk", {});
  ASSERT_THAT(milk, SizeIs(2));
  EXPECT_EQ(milk[0].place, "fridge");
  EXPECT_EQ(milk[1].place, "table");
  EXPECT_THAT(store.find("Milk", {.to = 150}), SizeIs(1));
  EXPECT_THAT(store.at_place("table", {}), SizeIs(3));
  EXPECT_THAT(store.at_place("table", {.from = 250}), SizeIs(1));
  EXPECT_EQ(store.last_look("table"), 300);
  EXPECT_EQ(store.last_look("moon"), std::nullopt);
  EXPECT_EQ(store.scene_before("s3"), "s2");
  EXPECT_EQ(store.scene_before("s1"), std::nullopt);
  EXPECT_THAT(store.scenes({.places = {"table"}, .newest_first = true}), SizeIs(2));
  EXPECT_THAT(store.scenes({.limit = 1}), SizeIs(1));
}

TEST_F(SceneStoreFile, AnIdentityIsFoundByItsName) {
  SceneStore store = open();
  store.add(small_scene("s1", 100, {{"Cup", "table"}, {"Cup", "table"}}));
  Identity cup;
  cup.id = "my cup";
  cup.sightings = {{"s1", "c1", 0, 0.9, "appear"}};
  ASSERT_TRUE(store.add(cup));
  const auto found = store.find("my cup", {});
  ASSERT_THAT(found, SizeIs(1));
  EXPECT_EQ(found.front().cluster, "c1");
  EXPECT_EQ(found.front().time, 100);
}

// D23: 103 scenes with 587 clusters, of 587 clusters each 1 shape, and 269 answers of an image search.
TEST_F(SceneStoreFile, CountsAreThoseOfThePapersFigureSix) {
  SceneStore store = open();
  const std::pair<const char*, int> answers[] = {
      {"Logo", 66}, {"similar image", 62}, {"user result", 56}, {"text", 48}, {"product", 37}};
  std::vector<std::string> categories;
  for (const auto& [category, count] : answers)
    categories.insert(categories.end(), static_cast<std::size_t>(count), category);
  ASSERT_EQ(categories.size(), 269u);
  ASSERT_TRUE(store.begin());
  std::size_t cluster = 0;
  for (std::size_t i = 0; i < 103; ++i) {
    Scene scene;
    scene.id = "s" + std::to_string(i);
    scene.timestamp = static_cast<double>(i);
    Annotation context;
    context.type = "sherlog.annotation.Context";
    context.fields = {{"name", Value("breakfast")}};
    scene.annotations = {context};
    for (std::size_t k = 0; k < (i < 72 ? 6u : 5u); ++k, ++cluster) {  // 72 * 6 + 31 * 5 = 587
      Cluster& entry = scene.clusters.emplace_back();
      entry.id = "c" + std::to_string(k);
      Annotation shape;
      shape.type = "rs.annotation.Shape";
      shape.fields = {{"shape", Value("box")}};
      entry.annotations = {shape};
      if (cluster >= categories.size()) continue;
      Annotation goggles;
      goggles.type = "rs.annotation.Goggles";
      goggles.fields = {{"category", Value(categories[cluster])}, {"title", Value("x")}};
      entry.annotations.push_back(goggles);
    }
    ASSERT_EQ(store.add(scene), SceneStore::Added::kNew);
  }
  ASSERT_TRUE(store.commit());
  EXPECT_EQ(store.scene_count(), 103u);
  EXPECT_EQ(store.cluster_count(), 587u);
  const auto counts = store.type_counts();
  ASSERT_THAT(counts, SizeIs(3));
  EXPECT_EQ(counts[0].type, "rs.annotation.Goggles");
  EXPECT_EQ(counts[0].of_clusters, 269u);
  EXPECT_EQ(counts[1].of_clusters, 587u);
  EXPECT_EQ(counts[2].of_scenes, 103u);
  std::vector<std::pair<std::string, std::uint64_t>> expected(std::begin(answers), std::end(answers));
  EXPECT_EQ(store.field_counts("rs.annotation.Goggles", "category"), expected);
}

TEST_F(SceneStoreFile, RunTimesAreMeansAndSampleDeviations) {
  SceneStore store = open();
  for (const auto& [id, first, second] : {std::tuple("s1", 10.0, 100.0), std::tuple("s2", 20.0, 140.0)}) {
    Scene scene;
    scene.id = id;
    for (const auto& [name, milliseconds] : {std::pair("region", first), std::pair("goggles", second)}) {
      Annotation log;
      log.type = "rs.annotation.LoggingInformation";
      log.fields = {{"annotator", Value(name)}, {"milliseconds", Value(milliseconds)}};
      scene.annotations.push_back(log);
    }
    store.add(scene);
  }
  const TimeReport report = store.times();
  ASSERT_THAT(report.annotators, SizeIs(2));
  EXPECT_EQ(report.annotators[0].annotator, "region");
  EXPECT_DOUBLE_EQ(report.annotators[0].mean, 15);
  EXPECT_DOUBLE_EQ(report.annotators[0].deviation, std::sqrt(50.0));  // (5^2 + 5^2) / 1
  EXPECT_DOUBLE_EQ(report.annotators[1].mean, 120);
  EXPECT_DOUBLE_EQ(report.total.mean, 135);  // (110 + 160) / 2
  EXPECT_DOUBLE_EQ(report.total.deviation, std::sqrt(1250.0));
}

// --- files ---

TEST_F(SceneStoreFile, AnOlderSchemaIsBroughtUpToDateWithItsScenes) {
  run_sql(store_schema(1) +
          "INSERT INTO scenes(name, time, place, layout) VALUES ('old', 7, '', 2);"
          "INSERT INTO clusters(scene, name, scene_time, place) VALUES (1, 'c0', 7, 'table');");
  SceneStore reader = open({.read_only = true});  // reading alone migrates too
  ASSERT_TRUE(reader.has("old"));
  SceneStore store = open();
  EXPECT_EQ(store.scene("old")->clusters.size(), 1u);
  EXPECT_TRUE(store.add(StoredEvidence{"old", "m", "x"}));
  EXPECT_EQ(store.evidence("old", "m"), "x");
}

TEST_F(SceneStoreFile, SightingsKeepTheirProbabilitiesFromVersion2On) {
  run_sql(store_schema(2) +
          "INSERT INTO scenes(name, time, place, layout) VALUES ('old', 7, '', 2);"
          "INSERT INTO clusters(scene, name, scene_time, place) VALUES (1, 'c0', 7, 'table');"
          "INSERT INTO identities(name, last_seen, was_seen, in_view, disappeared) VALUES ('cup', 7, 1, 1, 0);"
          "INSERT INTO sightings VALUES (1, 7, 1, 0.5, 'appear');");
  SceneStore store = open();
  Identity cup = *store.identity("cup");
  ASSERT_THAT(cup.sightings, SizeIs(1));
  EXPECT_EQ(cup.sightings[0].probability, 0.5);
  cup.sightings[0].probability.reset();
  EXPECT_TRUE(store.add(cup)) << store.problem();
  EXPECT_EQ(store.identity("cup")->sightings[0].probability, std::nullopt);
  EXPECT_TRUE(store.check().empty());
}

TEST_F(SceneStoreFile, AnIdentityThatIsStoredAgainKeepsItsPlace) {
  SceneStore store = open();
  for (const char* id : {"cup", "plate", "cup"}) EXPECT_TRUE(store.add(Identity{.id = id}));
  EXPECT_EQ(store.identities(), (std::vector<std::string>{"cup", "plate"}));
}

TEST_F(SceneStoreFile, ANewerSchemaIsRefused) {
  open();
  run_sql("PRAGMA user_version = 99");
  EXPECT_THAT(problem_of({}), HasSubstr("newer program (schema 99"));
  EXPECT_THAT(problem_of({.read_only = true}), HasSubstr("newer program (schema 99"));
}

TEST_F(SceneStoreFile, OtherFilesAreRefused) {
  EXPECT_THAT(problem_of({.read_only = true}), HasSubstr("there is no store"));
  std::ofstream(path_) << "Milk(c0)\nThis is no database, and it is long enough to be sure of that.\n";
  EXPECT_THAT(problem_of({}), HasSubstr("is not a scene store"));
  std::filesystem::remove(path_);
  run_sql("CREATE TABLE music(title TEXT)");
  EXPECT_THAT(problem_of({}), HasSubstr("not a scene store"));
  path_ = folder_.string();
  EXPECT_THAT(problem_of({}), HasSubstr("Is a directory"));
  path_ = (folder_ / "no" / "such" / "robot.db").string();
  EXPECT_THAT(problem_of({}), HasSubstr("cannot open"));
}

TEST_F(SceneStoreFile, AFullDiskLosesNothingThatWasCommitted) {
  open();
  SceneStore store = open({.max_bytes = 120'000});
  ASSERT_EQ(store.add(small_scene("first", 1, {{"Milk", "table"}})), SceneStore::Added::kNew);
  std::string text;
  for (int i = 0; i < 400; ++i) {
    text += R"({"id":"s)" + std::to_string(i) + R"(","timestamp":1,"x":")" + std::string(1000, 'x') + "\"}\n";
  }
  const ImportResult result = import(store, text);
  EXPECT_EQ(result.termination, Termination::kRefused);
  EXPECT_THAT(result.failure, HasSubstr("the disk is full"));
  EXPECT_EQ(result.added, 0u);
  EXPECT_EQ(store.scene_count(), 1u);
  EXPECT_THAT(store.check(), IsEmpty());
  EXPECT_EQ(store.add(small_scene("second", 2, {})), SceneStore::Added::kNew);
}

TEST_F(SceneStoreFile, ALockedStoreIsNamedAfterTheWait) {
  SceneStore writer = open();
  ASSERT_TRUE(writer.begin());
  ASSERT_EQ(writer.add(small_scene("s", 1, {})), SceneStore::Added::kNew);
  SceneStore other = open({.wait_seconds = 0.01});
  EXPECT_EQ(other.add(small_scene("t", 1, {})), SceneStore::Added::kFailed);
  EXPECT_THAT(other.problem(), HasSubstr("locked by another program"));
  EXPECT_EQ(other.scene_count(), 0u) << "readers see what was committed";
  ASSERT_TRUE(writer.commit());
  EXPECT_EQ(other.add(small_scene("t", 1, {})), SceneStore::Added::kNew);
}

TEST_F(SceneStoreFile, AReadOnlyStoreCanBeReadAndNotWritten) {
  {
    SceneStore store = open();
    store.add(small_scene("s", 1, {}));
  }
  ASSERT_EQ(chmod(path_.c_str(), 0444), 0);
  EXPECT_THAT(problem_of({}), HasSubstr("is read-only"));
  SceneStore reader = open({.read_only = true});
  EXPECT_TRUE(reader.has("s"));
  EXPECT_EQ(reader.add(small_scene("t", 1, {})), SceneStore::Added::kFailed);
  EXPECT_THAT(reader.problem(), HasSubstr("is read-only"));
}

TEST_F(SceneStoreFile, AFileThatWasCutIsFoundOut) {
  {
    SceneStore store = open();
    for (std::uint64_t i = 0; i < 50; ++i) store.add(kitchen_scene(default_kitchen(), 1, i));
  }
  std::filesystem::resize_file(path_, std::filesystem::file_size(path_) / 2);
  std::string problem;
  auto store = SceneStore::open(path_, {.read_only = true}, problem);
  EXPECT_TRUE(!store || !store->check().empty());
  EXPECT_TRUE(store || !problem.empty());
}

// --- places ---

TEST_F(SceneStoreFile, AThingIsWhereItsSceneIsUnlessItSaysMore) {
  SceneStore store = open();
  Scene scene = small_scene("s", 5, {{"Milk", "fridge"}});
  scene.annotations = {on("t1")};
  scene.clusters.emplace_back();
  scene.clusters.back().id = "c1";
  scene.clusters.back().annotations = {label("Cup")};
  ASSERT_EQ(store.add(scene), SceneStore::Added::kNew);
  const auto found = store.at_place("t1", {});
  ASSERT_THAT(found, SizeIs(1));
  EXPECT_EQ(found[0].label, "Cup");
  EXPECT_EQ(found[0].place, "t1");
  EXPECT_EQ(store.find("Cup", {}).at(0).place, "t1");
  EXPECT_EQ(store.find("Milk", {}).at(0).place, "fridge");
  EXPECT_THAT(store.at_place("fridge", {}), SizeIs(1));
}

TEST_F(SceneStoreFile, NoPlaceIsNoPlace) {
  SceneStore store = open();
  ASSERT_EQ(store.add(small_scene("s", 5, {{"Milk", ""}})), SceneStore::Added::kNew);
  EXPECT_EQ(store.last_look(""), std::nullopt);
  EXPECT_THAT(store.at_place("", {}), IsEmpty());
}

TEST_F(SceneStoreFile, ScenesOfSeveralPlacesComeOnceAndInOrder) {
  SceneStore store = open();
  store.add(small_scene("both", 2, {{"Milk", "t1"}, {"Cup", "t2"}}));
  store.add(small_scene("first", 1, {{"Milk", "t2"}}));
  store.add(small_scene("last", 3, {{"Milk", "t1"}}));
  store.add(small_scene("elsewhere", 2, {{"Milk", "t3"}}));
  const auto ids = [&](const SceneFilter& filter) {
    std::vector<std::string> result;
    for (const SceneSummary& scene : store.scenes(filter)) result.push_back(scene.id);
    return result;
  };
  EXPECT_THAT(ids({.places = {"t1", "t2"}}), ElementsAre("first", "both", "last"));
  EXPECT_THAT(ids({.places = {"t1", "t2"}, .limit = 2}), ElementsAre("first", "both"));
  EXPECT_THAT(ids({.places = {"t1", "t2"}, .limit = 2, .newest_first = true}), ElementsAre("last", "both"));
}

TEST_F(SceneStoreFile, AThingHasTheNamesOfItsLabelsAndItsIdentities) {
  SceneStore store = open();
  store.add(small_scene("s", 1, {{"Milk", "t1"}}));
  ASSERT_TRUE(store.add(Identity{.id = "milk-1", .sightings = {{"s", "c0"}}}));
  EXPECT_THAT(store.names_of("s", "c0"), ElementsAre("Milk", "milk-1"));
}

// --- types under other names ---

TEST_F(SceneStoreFile, AliasesAreCountedAndTimedWithTheirType) {
  SceneStore store = open();
  ASSERT_EQ(import(store, R"({"id":"s","timestamp":1,)"
                          R"("rs.annotation.LoggingInformation":[{"annotator":"A","milliseconds":10}],)"
                          R"("Logging":[{"annotator":"A","milliseconds":20}],"LoggingInformation":[)"
                          R"({"annotator":"A","milliseconds":30}],"identifiables":[{"id":"c",)"
                          R"("rs.annotation.Goggles":[{"category":"Logo","title":"x"}],)"
                          R"("GogglesAnnotation":[{"category":"Logo","title":"y"}]}]})")
                .added,
            1u);
  const TimeReport times = store.times();
  ASSERT_THAT(times.annotators, SizeIs(1));
  EXPECT_EQ(times.annotators[0].runs, 3u);
  EXPECT_EQ(times.annotators[0].mean, 20);
  const auto counts = store.type_counts();
  ASSERT_THAT(counts, SizeIs(2));
  EXPECT_EQ(counts[0].type, "rs.annotation.Goggles");
  EXPECT_EQ(counts[0].of_clusters, 2u);
  EXPECT_EQ(counts[1].of_scenes, 3u);
  EXPECT_THAT(store.field_counts("rs.annotation.Goggles", "category"), ElementsAre(testing::Pair("Logo", 2)));
}

TEST_F(SceneStoreFile, ASchemaBelowZeroIsDamage) {
  { SceneStore store = open(); }
  run_sql("PRAGMA user_version = -1");
  EXPECT_THAT(problem_of({}), HasSubstr("damaged"));
  EXPECT_THAT(problem_of({.read_only = true}), HasSubstr("damaged"));
}

}  // namespace
}  // namespace sherlog
