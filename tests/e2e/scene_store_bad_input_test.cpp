// What goes wrong with scenes and stores: each is named, and the store is as it was.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <fstream>
#include <nlohmann/json.hpp>
#include <string>

#include "perception_bridge/scene_store.h"
#include "perception_bridge/sqlite.h"
#include "tests/e2e/program.h"

namespace sherlog::e2e {
namespace {

using testing::HasSubstr;
using Json = nlohmann::json;

// A store with one good scene, and a file good.jsonl with another.
class SceneStoreBadInput : public testing::Test {
 protected:
  SceneStoreBadInput() {
    scratch_.write("first.jsonl", "{\"id\":\"first\",\"timestamp\":1}\n");
    scratch_.write("good.jsonl", "{\"id\":\"good\",\"timestamp\":2}\n");
    EXPECT_EQ(scratch_.sherlog("scenes import robot.db first.jsonl --quiet").code, 0);
  }
  Outcome import(const std::string& text, const std::string& options = "") {
    scratch_.write("in.jsonl", text + "\n");
    return scratch_.sherlog("scenes import robot.db in.jsonl " + options);
  }
  // Refused with these words, or left out with them; nothing of it is in the store.
  void bad_line(const std::string& text, const std::string& words) {
    SCOPED_TRACE(text.substr(0, 200));
    const std::size_t before = scene_count();
    const Outcome stopped = import(text);
    EXPECT_EQ(stopped.code, 2);
    EXPECT_THAT(stopped.err, HasSubstr("in.jsonl:1: "));
    EXPECT_THAT(stopped.err, HasSubstr(words));
    const Outcome skipped = import(text, "--on-error skip");
    EXPECT_EQ(skipped.code, 0);
    EXPECT_THAT(skipped.err, HasSubstr(words));
    EXPECT_EQ(scene_count(), before);
  }
  std::size_t scene_count() {
    const Outcome outcome = scratch_.sherlog("scenes check robot.db --json - --quiet");
    EXPECT_EQ(outcome.code, 0) << outcome.err;
    return Json::parse(outcome.out)["scenes"];
  }
  void refused(const std::string& arguments, const std::string& words) {
    const Outcome outcome = scratch_.sherlog(arguments);
    EXPECT_EQ(outcome.code, 2) << arguments << "\n" << outcome.out << outcome.err;
    EXPECT_THAT(outcome.err, HasSubstr(words));
  }
  void run_sql(const std::string& sql) {
    SqlDatabase database((scratch_.folder() / "robot.db").string(), {});
    EXPECT_TRUE(database.execute(sql)) << database.problem();
  }
  Scratch scratch_;
};

std::string with_annotation(const std::string& annotation) {
  return R"({"id":"s","timestamp":2,"identifiables":[{"id":"c",)" + annotation + "}]}";
}

TEST_F(SceneStoreBadInput, UnknownTypesAreKeptWithAWarning) {
  const Outcome outcome = import(with_annotation(R"("their.annotation.Weight":[{"grams":500}])"));
  EXPECT_EQ(outcome.code, 0);
  EXPECT_THAT(outcome.err, HasSubstr("'their.annotation.Weight' is not an annotation type that is known"));
  EXPECT_THAT(scratch_.sherlog("scenes export robot.db").out,
              HasSubstr(R"("their.annotation.Weight":[{"grams":500}])"));
}

TEST_F(SceneStoreBadInput, MissingTypesAreNoObstacle) {
  EXPECT_EQ(import(R"({"id":"s","timestamp":2,"identifiables":[{"id":"c"},{"id":"d"}]})").code, 0);
  EXPECT_EQ(import(R"({"id":"t","timestamp":3,"identifiables":[{"id":"c"}]})").code, 0);
  for (const char* command :
       {"scenes evidence robot.db --mapping fusion", "scenes evidence robot.db t --mapping identity",
        "track resolve robot.db", "track resolve robot.db --restart --arbiter", "track show robot.db",
        "scenes sigmas robot.db --mapping identity", "scenes counts robot.db", "scenes times robot.db",
        "scenes where robot.db milk", "scenes on robot.db table"}) {
    const Outcome outcome = scratch_.sherlog(std::string(command) + " --quiet");
    EXPECT_TRUE(outcome.code == 0 || !outcome.err.empty()) << command;
    EXPECT_LE(outcome.code, 2) << command << outcome.err;
  }
  // What a mapping needs and a scene lacks is said, and is no evidence.
  const Outcome evidence = scratch_.sherlog("scenes evidence robot.db t --against s --mapping identity");
  EXPECT_EQ(evidence.code, 0) << evidence.err;
  EXPECT_THAT(evidence.out, HasSubstr("0.5 similar(O0,N0)"));
}

TEST_F(SceneStoreBadInput, DistancesAreNumbersFromZeroOn) {
  bad_line(R"({"id":"m","timestamp":2,"rs.annotation.ClusterDistancesMatrix":[{"matrix":[[0,-1],[1,0]]}]})",
           "'matrix': -1 is negative");
  bad_line(R"({"id":"m","timestamp":2,"rs.annotation.ClusterDistancesMatrix":[{"matrix":[[0,NaN],[1,0]]}]})",
           "syntax error");
  bad_line(R"({"id":"m","timestamp":2,"rs.annotation.ClusterDistancesMatrix":[{"matrix":[[0,null],[1,0]]}]})",
           "'matrix'");
  bad_line(R"({"id":"m","timestamp":2,"rs.annotation.ClusterSimilaritiesMatrix":[{"matrix":[[1,2],[0,1]]}]})",
           "'matrix'");
  bad_line(with_annotation(R"("rs.annotation.ColorHistogram":[{"hist":[-1,2]}])"), "'hist': -1 is negative");
  bad_line(with_annotation(R"("rs.annotation.Shape":[{"shape":"box","confidence":1.5}])"), "confidence");
  bad_line(with_annotation(R"("rs.annotation.Geometry":[{"size":[1,1e999,1]}])"), "in.jsonl:1");
}

TEST_F(SceneStoreBadInput, MalformedLinesAreNamed) {
  bad_line("{\"id\":\"s\",\"timestamp\":", "line 1, column");
  bad_line("milk", "column");
  bad_line("[1,2]", "a scene is an object");
  bad_line(R"({"timestamp":2})", "'id'");
  bad_line(R"({"id":"s"})", "'timestamp'");
  bad_line(R"({"id":"s","timestamp":1353571200000})", "timestamp");
  bad_line(R"({"id":"s","timestamp":2,"id":"t"})", "twice");
  bad_line("{\"id\":\"\xff\",\"timestamp\":2}", "UTF-8");
  bad_line(std::string(100'000, '['), "in.jsonl:1");
  bad_line(R"({"sherlog.record":"identity","id":"x","sightings":[{"scene":"first","cluster":"c","probability":7}]})",
           "'probability'");
}

TEST_F(SceneStoreBadInput, IdsAreThereOnce) {
  bad_line(R"({"id":"s","timestamp":2,"identifiables":[{"id":"c"},{"id":"c"}]})", "two clusters have the id 'c'");
  bad_line(R"({"id":"first","timestamp":2})", "the store has a scene 'first' already");
}

TEST_F(SceneStoreBadInput, EmptyScenesAndFilesAreFine) {
  EXPECT_EQ(import(R"({"id":"nothing","timestamp":2,"identifiables":[]})").code, 0);
  EXPECT_EQ(import("").code, 0);
  const Outcome outcome = scratch_.sherlog("track resolve robot.db");
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("2 scenes, 0 objects"));
}

// --- several files ---

TEST_F(SceneStoreBadInput, OneBadFileTakesTheOthersBack) {
  scratch_.write("bad.jsonl", "{\"id\":\"x\",\"timestamp\":3}\nbroken\n");
  for (const char* files : {"good.jsonl bad.jsonl", "bad.jsonl good.jsonl", "good.jsonl missing.jsonl"}) {
    const Outcome outcome = scratch_.sherlog(std::string("scenes import robot.db ") + files + " --json -");
    EXPECT_EQ(outcome.code, 2);
    EXPECT_THAT(outcome.err, HasSubstr("nothing was imported"));
    const Json json = Json::parse(outcome.out);
    EXPECT_EQ(json["added"], 0);
    EXPECT_EQ(json["scenes_in_store"], 1);
    EXPECT_EQ(scene_count(), 1u);
  }
  // The one who wants to go on goes on.
  const Outcome skipped = scratch_.sherlog("scenes import robot.db bad.jsonl good.jsonl --on-error skip");
  EXPECT_EQ(skipped.code, 0);
  EXPECT_THAT(skipped.err, HasSubstr("bad.jsonl:2: "));
  EXPECT_EQ(scene_count(), 3u);
}

TEST_F(SceneStoreBadInput, GoodFilesAreOneTransaction) {
  scratch_.write("more.jsonl", "{\"id\":\"more\",\"timestamp\":3}\n");
  EXPECT_EQ(scratch_.sherlog("scenes import robot.db good.jsonl more.jsonl").code, 0);
  EXPECT_EQ(scene_count(), 3u);
  // The same scene in two of them is an error in the second one.
  refused("scenes import other.db good.jsonl good.jsonl", "good.jsonl:1: the store has a scene 'good' already");
  EXPECT_FALSE(scratch_.exists("other.db"));
}

// --- the store's file ---

TEST_F(SceneStoreBadInput, AStoreOfANewerProgramIsRefusedAndLeftAlone) {
  run_sql("PRAGMA user_version = 77");
  for (const char* command : {"scenes check robot.db", "scenes list robot.db", "scenes import robot.db good.jsonl",
                              "scenes export robot.db", "track resolve robot.db", "track show robot.db"}) {
    refused(command, "newer program (schema 77");
  }
  run_sql("PRAGMA user_version = " + std::to_string(kStoreVersion));
  EXPECT_EQ(scene_count(), 1u);
}

TEST_F(SceneStoreBadInput, ALockedStoreCanBeReadAndIsWrittenLater) {
  {
    std::string problem;
    auto store = SceneStore::open((scratch_.folder() / "robot.db").string(), {}, problem);
    ASSERT_TRUE(store) << problem;
    ASSERT_TRUE(store->begin());
    refused("scenes import robot.db good.jsonl --wait 0.05", "locked by another program");
    refused("track resolve robot.db --wait 0.05", "locked by another program");
    refused("track resolve robot.db --restart --wait 0.05", "locked by another program");
    EXPECT_EQ(scene_count(), 1u);
    store->roll_back();
  }
  EXPECT_EQ(scratch_.sherlog("scenes import robot.db good.jsonl").code, 0);
  EXPECT_EQ(scene_count(), 2u);
}

TEST_F(SceneStoreBadInput, AReadOnlyStoreIsReadAndNotWritten) {
  ASSERT_EQ(chmod((scratch_.folder() / "robot.db").c_str(), 0444), 0);
  refused("scenes import robot.db good.jsonl", "is read-only");
  refused("track resolve robot.db", "is read-only");
  EXPECT_EQ(scratch_.sherlog("track resolve robot.db --dry-run").code, 0);
  EXPECT_EQ(scene_count(), 1u);
}

TEST_F(SceneStoreBadInput, AFullDiskIsSaidAndNothingIsHalfThere) {
  ASSERT_EQ(scratch_.sherlog("scenes generate --scenes 300 --format jsonl -o many.jsonl --quiet").code, 0);
  // No file may grow beyond 100 KB.
  const Outcome outcome = scratch_.shell("ulimit -f 200; \"$S\" scenes import robot.db many.jsonl");
  EXPECT_EQ(outcome.code, 2) << outcome.out << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("nothing was imported"));
  EXPECT_EQ(scene_count(), 1u);
  EXPECT_EQ(scratch_.sherlog("scenes import robot.db many.jsonl").code, 0) << "with room again";
  EXPECT_EQ(scene_count(), 301u);
  for (const char* command : {"scenes export robot.db -o /dev/full", "scenes export robot.db >/dev/full",
                              "track show robot.db --svg /dev/full", "scenes list robot.db --json /dev/full"}) {
    const Outcome full = scratch_.sherlog(command);
    EXPECT_NE(full.code, 0) << command;
    EXPECT_THAT(full.err, HasSubstr("No space left on device")) << command;
  }
}

TEST_F(SceneStoreBadInput, AFullStoreIsSaidWhereverItGetsFull) {
  const std::string text = R"({"id":"s","timestamp":1,")" + std::string(300'000, 'k') + "\":1}\n";
  scratch_.write("big.jsonl", text);
  for (const char* command :
       {"scenes import new.db big.jsonl --max-size 100K", "scenes import robot.db big.jsonl --max-size 100K",
        "scenes import robot.db big.jsonl --max-size 100K --on-error skip"}) {
    refused(command, "no room in the store");
  }
  EXPECT_EQ(scene_count(), 1u);
}

TEST_F(SceneStoreBadInput, ADamagedStoreIsSaid) {
  ASSERT_EQ(scratch_.sherlog("scenes generate --scenes 50 --format jsonl -o many.jsonl --quiet").code, 0);
  ASSERT_EQ(scratch_.sherlog("scenes import robot.db many.jsonl").code, 0);
  {
    std::fstream file(scratch_.folder() / "robot.db", std::ios::binary | std::ios::in | std::ios::out);
    file.seekp(4096);  // behind the header and the list of tables
    file << std::string(200'000, '\xff');
  }
  for (const char* command : {"scenes where robot.db Milk", "scenes history robot.db Milk", "scenes on robot.db table",
                              "scenes list robot.db", "scenes show robot.db first", "scenes counts robot.db",
                              "scenes times robot.db", "scenes export robot.db", "scenes evidence robot.db",
                              "scenes import robot.db good.jsonl", "scenes check robot.db"}) {
    refused(command, "robot.db' is damaged");
  }
}

TEST_F(SceneStoreBadInput, NoResultTakesThePlaceOfWhatIsRead) {
  for (const char* name : {"concepts.json", "mapping.json", "costs.txt"}) scratch_.write(name, "{}\n");
  scratch_.write("m.mln", "object(c, o!)\n");
  ASSERT_EQ(scratch_.shell("ln -s robot.db link.db").code, 0);
  const std::string before = scratch_.read("robot.db");
  for (const auto& [command, lost] : std::vector<std::pair<std::string, std::string>>{
           {"scenes export robot.db -o", "robot.db"},
           {"scenes export robot.db -o", "link.db"},
           {"scenes export link.db -o", "robot.db"},
           {"scenes export robot.db -o", "robot.db-wal"},
           {"scenes evidence robot.db -o", "robot.db"},
           {"scenes sigmas robot.db -o", "robot.db"},
           {"scenes sigmas robot.db --mapping mapping.json -o", "mapping.json"},
           {"scenes list robot.db --json", "robot.db"},
           {"scenes show robot.db first --json", "robot.db"},
           {"scenes counts robot.db --json", "robot.db"},
           {"scenes check robot.db --json", "robot.db"},
           {"scenes where robot.db milk --json", "robot.db"},
           {"scenes where robot.db milk --concepts concepts.json --json", "concepts.json"},
           {"scenes mapping mapping.json --json", "mapping.json"},
           {"scenes reprocess robot.db --json", "robot.db"},
           {"scenes reprocess robot.db -m m.mln -q object --json", "m.mln"},
           {"scenes import robot.db good.jsonl --json", "robot.db"},
           {"scenes import robot.db good.jsonl --json", "good.jsonl"},
           {"scenes import new.db good.jsonl --json", "./new.db"},
           {"track resolve robot.db --json", "robot.db"},
           {"track resolve robot.db --model m.mln --json", "m.mln"},
           {"track show robot.db --svg", "robot.db"},
           {"track show --dump good.jsonl --svg", "good.jsonl"},
           {"track simulate --config mapping.json --json", "mapping.json"},
           {"track simulate --model m.mln --trials 1 --dump", "m.mln"},
           {"track learn --scenes robot.db -o", "robot.db"},
           {"advise -m m.mln -q object --costs costs.txt --json", "costs.txt"}}) {
    refused(command + " " + lost, "'" + lost + "' is read: a result would take its place");
  }
  EXPECT_EQ(scratch_.read("robot.db"), before);
  EXPECT_FALSE(scratch_.exists("new.db"));
  EXPECT_EQ(scratch_.read("m.mln"), "object(c, o!)\n");
  EXPECT_EQ(scratch_.sherlog("scenes export robot.db -o first.jsonl").code, 0) << "what nobody reads can be replaced";
}

TEST_F(SceneStoreBadInput, WhatWouldBeIgnoredIsSaid) {
  refused("scenes import robot.db .", "cannot read '.': it is a directory");
  refused("scenes reprocess robot.db -q object", "--query needs a --model");
  scratch_.write("twice.json", R"({"tables": 4, "tables": 3})");
  refused("track simulate --trials 1 --config twice.json", "twice.json: ");
  refused("track show --dump good.jsonl --trial -1", "expected a whole number");
  bad_line(
      R"({"sherlog.record":"identity","id":"cup","sightings":[{"scene":"first","cluster":"c","explanation":"foo"}]})",
      "a sighting's 'explanation' is 'foo'");
}

// Text that was read off a label has line breaks.
TEST_F(SceneStoreBadInput, EvidenceCanBeReadBackWhateverTheAnnotatorsWrote) {
  scratch_.write("m.mln",
                 "logo(cluster, text)\nobject(cluster, thing!)\nthing = {Milk, Tea}\n1 logo(c, \"Fresh milk\") => "
                 "object(c, Milk)\n");
  scratch_.write("mapping.json", R"({"name":"logos","clusters":{"domain":"cluster","prefix":"c"},"rules":[)"
                                 R"({"annotation":"rs.annotation.Goggles","value":"/title","predicate":"logo"}]})");
  const std::string text = R"({"id":"a\nb","timestamp":2,"identifiables":[{"id":"c","rs.annotation.Goggles":[)"
                           R"({"category":"Logo","title":"Fresh\r\nmilk\n"},{"category":"Logo","title":"T\u0000ea"},)"
                           R"({"category":"Logo","title":"\n"}]}]})";
  ASSERT_EQ(import(text).code, 0);
  ASSERT_EQ(scratch_.sherlog("scenes evidence robot.db --mapping mapping.json -o e.db").code, 0);
  EXPECT_EQ(scratch_.read("e.db"),
            "// first\n---\n// a b\ncluster = {c0}\nlogo(c0,\"Fresh milk\")\nlogo(c0,\"T ea\")\n");
  const Outcome inferred = scratch_.sherlog("infer -m m.mln -e e.db -q object");
  EXPECT_EQ(inferred.code, 0) << inferred.err;
  const Outcome again = scratch_.sherlog("scenes reprocess robot.db --mapping mapping.json -m m.mln -q object");
  EXPECT_EQ(again.code, 0) << again.err;
  EXPECT_THAT(again.out, HasSubstr("2 beliefs"));
}

TEST_F(SceneStoreBadInput, AStoreThatIsDamagedFurtherOnIsNotTakenForAShorterOne) {
  ASSERT_EQ(scratch_.sherlog("scenes generate --scenes 100 --format jsonl -o many.jsonl --quiet").code, 0);
  ASSERT_EQ(scratch_.sherlog("scenes import robot.db many.jsonl").code, 0);
  {
    const auto size = std::filesystem::file_size(scratch_.folder() / "robot.db");
    std::fstream file(scratch_.folder() / "robot.db", std::ios::binary | std::ios::in | std::ios::out);
    file.seekp(static_cast<std::streamoff>(size - size / 10));
    file << std::string(size / 10, '\xff');
  }
  refused("track resolve robot.db --dry-run", "robot.db' is damaged");
  refused("track resolve robot.db", "robot.db' is damaged");
}

TEST_F(SceneStoreBadInput, AStoreThatIsMadeForNothingGoesAway) {
  scratch_.write("bad.jsonl", "broken\n");
  const std::size_t before = scratch_.file_count();
  refused("scenes import new.db missing.jsonl", "cannot read 'missing.jsonl'");
  refused("scenes import new.db bad.jsonl", "bad.jsonl:1: ");
  EXPECT_EQ(scratch_.sherlog("scenes import new.db good.jsonl --max-seconds 0").code, 4);
  EXPECT_EQ(scratch_.file_count(), before);
  refused("scenes import robot.db bad.jsonl", "bad.jsonl:1: ");
  EXPECT_EQ(scene_count(), 1u) << "one that was there stays";
}

TEST_F(SceneStoreBadInput, EveryCommandHeedsItsLimits) {
  ASSERT_EQ(scratch_.sherlog("scenes generate --scenes 20 --format jsonl -o many.jsonl --quiet").code, 0);
  ASSERT_EQ(scratch_.sherlog("scenes import robot.db many.jsonl").code, 0);
  for (const char* command :
       {"import robot.db good.jsonl", "import robot.db good.jsonl --on-error skip", "export robot.db -o out.jsonl",
        "evidence robot.db -o out.db", "sigmas robot.db -o out.json", "reprocess robot.db", "list robot.db",
        "show robot.db first", "counts robot.db", "times robot.db", "where robot.db Milk", "history robot.db Milk",
        "on robot.db table", "check robot.db"}) {
    const Outcome outcome = scratch_.sherlog(std::string("scenes ") + command + " --max-seconds 0 --json -");
    EXPECT_EQ(outcome.code, 4) << command << outcome.out << outcome.err;
    EXPECT_EQ(Json::parse(outcome.out, nullptr, false)["termination"], "time_limit") << command << outcome.out;
    EXPECT_THAT(outcome.err, HasSubstr("the time limit was reached")) << command;
  }
  EXPECT_EQ(scene_count(), 21u);
}

TEST_F(SceneStoreBadInput, AnInterruptedImportEndsWith130) {
  // Lines without end.
  const std::string lines = R"(seq 1 1000000000 | sed "s/.*/{\"id\":\"x&\",\"timestamp\":1}/")";
  const std::string interrupted = " | timeout --preserve-status -s INT 0.5 \"$S\" scenes import robot.db - ";
  const Outcome stopped = scratch_.shell(lines + interrupted + "--json -");
  EXPECT_EQ(stopped.code, 130) << stopped.err;
  EXPECT_EQ(Json::parse(stopped.out, nullptr, false)["termination"], "interrupted") << stopped.out;
  EXPECT_EQ(scene_count(), 1u);
  const Outcome skipping = scratch_.shell(lines + interrupted + "--on-error skip --json -");
  EXPECT_EQ(skipping.code, 130) << skipping.err;
  EXPECT_EQ(scene_count(), 1 + Json::parse(skipping.out)["added"].get<std::size_t>());
}

// As from programs that signal a process and its group.
TEST_F(SceneStoreBadInput, TwoSignalsAtOnceAskOnce) {
  const Outcome stopped =
      scratch_.shell(R"((cat good.jsonl; sleep 3) | "$S" scenes import robot.db - --json - & p=$!; sleep 0.5; )"
                     "kill -TERM $p; kill -INT $p; sleep 0.01; kill -TERM $p; wait $p");
  EXPECT_EQ(stopped.code, 130) << stopped.err;
  EXPECT_EQ(Json::parse(stopped.out, nullptr, false)["termination"], "interrupted") << stopped.out;
}

TEST_F(SceneStoreBadInput, AnImportThatIsInterruptedWhileItWaitsEndsWith130) {
  const Outcome stopped = scratch_.shell(
      R"((cat good.jsonl; sleep 2) | timeout --preserve-status -s INT 0.5 "$S" scenes import robot.db - --json -)");
  EXPECT_EQ(stopped.code, 130) << stopped.err;
  EXPECT_EQ(Json::parse(stopped.out, nullptr, false)["termination"], "interrupted") << stopped.out;
  EXPECT_EQ(scene_count(), 1u);
}

TEST_F(SceneStoreBadInput, EveryBadLineHasItsNumber) {
  std::string text;
  for (int i = 0; i < 30; ++i) text += "broken\n";
  scratch_.write("bad.jsonl", text);
  const Outcome outcome = scratch_.sherlog("scenes import robot.db bad.jsonl --on-error skip --quiet --json -");
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  const Json json = Json::parse(outcome.out);
  EXPECT_EQ(json["skipped"], 30);
  EXPECT_EQ(json["bad_lines"][0]["file"], "bad.jsonl");
  ASSERT_EQ(json["bad_lines"][0]["lines"].size(), 30u);
  EXPECT_EQ(json["bad_lines"][0]["lines"][29], 30);
}

TEST_F(SceneStoreBadInput, ASchemaBelowZeroIsDamage) {
  run_sql("PRAGMA user_version = -1");
  refused("scenes import robot.db good.jsonl", "is damaged");
  refused("scenes list robot.db", "is damaged");
}

}  // namespace
}  // namespace sherlog::e2e
