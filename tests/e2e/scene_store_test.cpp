// sherlog scenes with a store: in, out, questions, and what happens when something goes wrong.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <chrono>
#include <cstdlib>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <random>
#include <string>

#include "tests/e2e/program.h"

namespace sherlog::e2e {
namespace {

using testing::HasSubstr;
using Json = nlohmann::json;

const std::string kKitchen = SHERLOG_SOURCE_DIR "/examples/scenes/kitchen.jsonl";
const std::string kConcepts = " --concepts '" SHERLOG_SOURCE_DIR "/examples/scenes/concepts.json'";
const std::string kModels = SHERLOG_SOURCE_DIR "/models/";

// A store with the three shipped scenes.
class SceneStoreProgram : public testing::Test {
 protected:
  SceneStoreProgram() {
    const Outcome outcome = scratch_.sherlog("scenes import robot.db '" + kKitchen + "' --quiet");
    EXPECT_EQ(outcome.code, 0) << outcome.err;
  }
  Json json(const std::string& arguments) {
    const Outcome outcome = scratch_.sherlog("scenes " + arguments + " --json - --quiet");
    EXPECT_EQ(outcome.code, 0) << outcome.err;
    return Json::parse(outcome.out, nullptr, false);
  }
  // Exit code 2 and these words.
  void refused(const std::string& arguments, const std::string& words) {
    const Outcome outcome = scratch_.sherlog("scenes " + arguments);
    EXPECT_EQ(outcome.code, 2) << arguments << "\n" << outcome.out << outcome.err;
    EXPECT_THAT(outcome.err, HasSubstr(words));
  }
  std::size_t scene_count(const std::string& store = "robot.db") { return json("check " + store)["scenes"]; }

  Scratch scratch_;
};

TEST_F(SceneStoreProgram, AHundredScenesGoInAndComeOutUnchanged) {
  ASSERT_EQ(scratch_.sherlog("scenes generate --scenes 103 --format jsonl -o in.jsonl").code, 0);
  const Json imported = json("import new.db in.jsonl");
  EXPECT_EQ(imported["schema"], "sherlog.scenes.import/1");
  EXPECT_EQ(imported["added"], 103);
  EXPECT_EQ(scratch_.sherlog("scenes export new.db -o out.jsonl").code, 0);
  EXPECT_EQ(scratch_.read("in.jsonl"), scratch_.read("out.jsonl"));
  EXPECT_EQ(scratch_.sherlog("scenes export new.db").out, scratch_.read("in.jsonl"));
}

TEST_F(SceneStoreProgram, AnswersWhereThingsAreAndWere) {
  const Json milk = json("where robot.db milk" + kConcepts);
  ASSERT_EQ(milk["found"].size(), 1u);
  EXPECT_EQ(milk["found"][0]["scene"], "evening-1");
  EXPECT_EQ(milk["found"][0]["position"], Json({0.15, 0.2, 0.97}));
  EXPECT_EQ(milk["belongs"], "fridge");
  EXPECT_FALSE(milk.contains("place_seen_without_it"));
  const Json cereals = json("where robot.db cereals" + kConcepts);
  EXPECT_EQ(cereals["found"][0]["scene"], "breakfast-1");
  EXPECT_EQ(cereals["place_seen_without_it"], 1353610800.0);
  const Json history = json("history robot.db Bowl");
  EXPECT_EQ(history["stays"].size(), 1u);
  EXPECT_EQ(history["stays"][0]["sightings"], 2);
  EXPECT_THAT(scratch_.sherlog("scenes where robot.db unicorn").out, HasSubstr("never seen"));
}

// What begins at a time is of the part of the day that begins then, and of no other.
TEST_F(SceneStoreProgram, EveryMomentIsOfOnePartOfTheDay) {
  std::string text;
  for (const char* hour : {"0", "5", "12", "18", "24"})
    text += fmt::format("{{\"id\":\"h{}\",\"timestamp\":{}}}\n", hour, 1353542400 + 3600 * std::stoi(hour));
  scratch_.write("hours.jsonl", text);
  ASSERT_EQ(scratch_.sherlog("scenes import hours.db hours.jsonl").code, 0);
  const std::string now = " --now 2012-11-22T13:00:00";
  for (const auto& [part, ids] : std::map<std::string, std::vector<std::string>>{{"night", {"h0"}},
                                                                                 {"morning", {"h5"}},
                                                                                 {"afternoon", {"h12"}},
                                                                                 {"evening", {"h18"}},
                                                                                 {"today", {"h0", "h5", "h12", "h18"}},
                                                                                 {"yesterday", {}}}) {
    std::vector<std::string> found;
    const Json list = json("list hours.db --during " + part + now);
    for (const Json& scene : list["scenes"]) found.push_back(scene["id"]);
    EXPECT_EQ(found, ids) << part;
  }
}

TEST_F(SceneStoreProgram, AnswersWhatWasOnTheTable) {
  EXPECT_EQ(json("on robot.db table" + kConcepts)["found"].size(), 4u);
  EXPECT_EQ(json("on robot.db table --during morning" + kConcepts)["found"].size(), 3u);
  EXPECT_EQ(json("on robot.db table --during afternoon" + kConcepts)["found"].size(), 0u);
  // In Japan it was evening already.
  EXPECT_EQ(json("on robot.db table --during evening --now 2012-11-22 --utc-offset 9" + kConcepts)["found"].size(), 0u);
  EXPECT_EQ(json("on robot.db table --during afternoon --now 2012-11-22 --utc-offset 9" + kConcepts)["found"].size(),
            3u);
  EXPECT_EQ(json("on robot.db table --what milk" + kConcepts)["answer"], true);
  EXPECT_EQ(json("on robot.db table --what cereals" + kConcepts)["answer"], false);
  EXPECT_EQ(json("on robot.db table --what cereals --to 2012-11-22T12:00" + kConcepts)["answer"], true);
  EXPECT_THAT(scratch_.sherlog("scenes on robot.db moon").out, HasSubstr("nothing was ever seen at 'moon'"));
}

TEST_F(SceneStoreProgram, EachPlaceOfAConceptHasItsOwnLastLook) {
  const auto scene = [](const char* id, int time, const char* thing, const char* place) {
    return std::string(R"({"id":")") + id + R"(","timestamp":)" + std::to_string(time) +
           R"(,"identifiables":[{"id":"c","Detection":[{"name":")" + thing + R"("}],"TFLocation":[{"frame_id":")" +
           place + "\"}]}]}\n";
  };
  scratch_.write("two.jsonl", scene("a", 1500, "Milk", "t1") + scene("b", 2000, "Cup", "t2"));
  scratch_.write("who.jsonl",
                 R"({"sherlog.record":"identity","id":"object-7","sightings":[{"scene":"a","cluster":"c"}]})");
  scratch_.write("tables.json", R"({"concepts":{"table":["t1","t2"]}})");
  ASSERT_EQ(scratch_.sherlog("scenes import two.db two.jsonl who.jsonl").code, 0);
  const std::string tables = " --concepts tables.json";
  EXPECT_EQ(json("on two.db table --what Milk" + tables)["answer"], true);
  EXPECT_EQ(json("on two.db table --what Cup" + tables)["answer"], true);
  EXPECT_EQ(json("on two.db table" + tables)["last_look"], 2000);
  EXPECT_EQ(json("on two.db table --what object-7" + tables)["answer"], true) << "an identity";
  EXPECT_EQ(json("on two.db t2 --what object-7")["answer"], false);
  const Json scenes = json("list two.db --place table --limit 1" + tables)["scenes"];
  ASSERT_EQ(scenes.size(), 1u);
  EXPECT_EQ(scenes[0]["id"], "a");
}

TEST_F(SceneStoreProgram, TimesWithoutAZoneAreLocal) {
  // The shipped scenes were seen at 8:00, 12:00 and later, UTC.
  EXPECT_EQ(json("list robot.db --to 2012-11-22T08:30")["scenes"].size(), 1u);
  EXPECT_EQ(json("list robot.db --to 2012-11-22T08:30 --utc-offset 9")["scenes"].size(), 0u);
  EXPECT_EQ(json("list robot.db --to 2012-11-22T08:30Z --utc-offset 9")["scenes"].size(), 1u);
  EXPECT_EQ(json("list robot.db --to 2012-11-22T17:30 --utc-offset 9")["scenes"].size(), 1u);
}

TEST_F(SceneStoreProgram, DesignatorsBecomeScenesAndEvidence) {
  scratch_.write("designators.jsonl",
                 R"({"id":"17","timestamp":5,"rs.annotation.Shape":[{"shape":"box","confidence":0.9,"source":"x"}]})"
                 "\n"
                 R"({"id":"18","timestamp":5,"rs.annotation.Detection":[{"name":"Milk","confidence":0.8}]})"
                 "\n");
  const Json imported = json("import rs.db designators.jsonl");
  EXPECT_EQ(imported["added"], 1);
  EXPECT_EQ(imported["designators"], 2);
  const std::string evidence = scratch_.sherlog("scenes evidence rs.db --mapping robosherlock --fuzzy").out;
  EXPECT_THAT(evidence, HasSubstr("0.9 shape(c0,box)"));
  EXPECT_THAT(evidence, HasSubstr("0.8 detection(c1,Milk)"));
}

TEST_F(SceneStoreProgram, IdentitiesOfAnotherStoreDoNotTakeTheirPlace) {
  const std::string mine = R"({"sherlog.record":"identity","id":"object-1","sightings":[{"scene":")";
  scratch_.write("mine.jsonl", mine + R"(breakfast-1","cluster":"c0"}]})");
  scratch_.write("other.jsonl", mine + R"(breakfast-1","cluster":"c1"}]})");
  ASSERT_EQ(scratch_.sherlog("scenes import robot.db mine.jsonl").code, 0);
  refused("import robot.db other.jsonl", "identity 'object-1' already");
  const Json replaced = json("import robot.db other.jsonl --replace");
  EXPECT_EQ(replaced["dropped"]["sightings"], 1);
  // Scenes that are the same keep what was concluded from them.
  const Json same = json("import robot.db '" + kKitchen + "' --replace");
  EXPECT_EQ(same["unchanged"], 3);
  EXPECT_EQ(same["replaced"], 0);
  EXPECT_EQ(json("where robot.db object-1")["found"].size(), 1u);
}

TEST_F(SceneStoreProgram, ReprocessingNamesAContradiction) {
  scratch_.write("hard.mln", "#include \"" + kModels + "information_fusion/predicates.mln\"\n!shape(c, Box).\n");
  const Outcome outcome = scratch_.sherlog("scenes reprocess robot.db -m hard.mln -q object --json -");
  EXPECT_EQ(outcome.code, 3) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("hard formula"));
  EXPECT_EQ(Json::parse(outcome.out)["termination"], "no_possible_world");
}

TEST_F(SceneStoreProgram, ListsShowsAndCounts) {
  EXPECT_EQ(json("list robot.db")["scenes"].size(), 3u);
  EXPECT_EQ(json("list robot.db --place stove" + kConcepts)["scenes"].size(), 1u);
  EXPECT_EQ(json("list robot.db --newest-first --limit 1")["scenes"][0]["id"], "evening-1");
  std::ifstream in(kKitchen);
  std::string line;
  std::getline(in, line);
  EXPECT_EQ(json("show robot.db breakfast-1")["scene"], Json::parse(line));
  const Json counts = json("counts robot.db");
  EXPECT_EQ(counts["clusters"], 10);
  EXPECT_EQ(counts["goggles"]["Logo"], 2);
  const Json times = json("times robot.db");
  EXPECT_EQ(times["total"]["runs"], 3);
  double sum = 0;
  for (const Json& row : times["annotators"]) sum += row["mean"].get<double>();
  EXPECT_NEAR(times["total"]["mean"], sum, 1e-9);
  refused("show robot.db no-such-scene", "no scene 'no-such-scene'");
}

TEST_F(SceneStoreProgram, StoredScenesAreEvidenceForTheShippedModels) {
  EXPECT_EQ(scratch_.sherlog("scenes evidence robot.db --mapping fusion -o all.db --quiet").code, 0);
  EXPECT_EQ(scratch_.sherlog("check -m '" + kModels + "information_fusion/fusion.mln' -e all.db --quiet").code, 0);
  EXPECT_EQ(
      scratch_.sherlog("scenes evidence robot.db evening-1 --mapping identity --against breakfast-1 -o pair.db --quiet")
          .code,
      0);
  const Outcome outcome = scratch_.sherlog("infer -m '" + kModels +
                                           "identity_resolution/table1.mln' -e pair.db -q is,appear,disappear,hidden "
                                           "--method map --quiet --json -");
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const std::string map = Json::parse(outcome.out)["map"]["true_atoms"].dump();
  EXPECT_THAT(map, HasSubstr("is(O1,N0,stay)"));  // the bowl
  EXPECT_THAT(map, HasSubstr("is(O2,N1,move)"));  // the milk
}

TEST_F(SceneStoreProgram, ReprocessingGivesTheSameEvidenceAgain) {
  const std::string fusion = "reprocess robot.db -m '" + kModels + "information_fusion/fusion.mln' -q object";
  const Json first = json(fusion);
  EXPECT_EQ(first["new"], 3);
  EXPECT_EQ(first["beliefs"], 3);
  const Json again = json(fusion);
  EXPECT_EQ(again["new"], 0);
  EXPECT_EQ(again["changed"], 0);
  // A mapping that was edited gives other evidence.
  Json mapping = json("mapping fusion");
  mapping["rules"][0]["threshold"] = 0.99;
  scratch_.write("strict.json", mapping.dump());
  EXPECT_EQ(json("reprocess robot.db --mapping strict.json")["changed"], 3);
  EXPECT_TRUE(json("show robot.db cooking-1")["beliefs"]["fusion"].contains("marginals"));
  // All of it is in the export, and comes back.
  ASSERT_EQ(scratch_.sherlog("scenes export robot.db -o all.jsonl").code, 0);
  EXPECT_EQ(json("import copy.db all.jsonl")["records"], 6);
  EXPECT_EQ(scratch_.sherlog("scenes export copy.db").out, scratch_.read("all.jsonl"));
}

TEST_F(SceneStoreProgram, SigmasAreLearnedFromTheIdentitiesInTheStore) {
  ASSERT_EQ(scratch_.sherlog("scenes export robot.db -o all.jsonl").code, 0);
  const auto identity = [](const char* id, const char* first, const char* second) {
    return Json{{"sherlog.record", "identity"},
                {"id", id},
                {"sightings",
                 {{{"scene", "breakfast-1"}, {"cluster", first}}, {{"scene", "evening-1"}, {"cluster", second}}}}}
               .dump() +
           "\n";
  };
  scratch_.write("who.jsonl", identity("bowl-1", "c1", "c0") + identity("milk-1", "c2", "c1"));
  refused("sigmas robot.db -o learned.json", "0 pairs");
  EXPECT_EQ(json("import robot.db who.jsonl")["records"], 2);
  EXPECT_EQ(json("where robot.db milk-1")["found"][0]["cluster"], "c1");
  // The scenes of the counter without the one of the stove between them.
  scratch_.write("counter.jsonl", [&] {
    std::string text;
    std::ifstream in(kKitchen);
    for (std::string line; std::getline(in, line);)
      text += line.find("cooking-1") == std::string::npos ? line + "\n" : "";
    return text + scratch_.read("who.jsonl");
  }());
  json("import counter.db counter.jsonl");
  const Json learned = json("sigmas counter.db -o learned.json");
  EXPECT_EQ(learned["pairs"], 4);
  EXPECT_GE(learned["log_likelihood"].get<double>(), learned["log_likelihood_before"].get<double>());
  EXPECT_EQ(scratch_.sherlog("scenes evidence counter.db --mapping learned.json --quiet").code, 0);
}

TEST_F(SceneStoreProgram, ABadLineIsNamedAndStopsOrIsSkipped) {
  scratch_.write("bad.jsonl",
                 "{\"id\":\"a\",\"timestamp\":1}\n{\"id\":\"b\",\"timestamp\":\n{\"id\":\"c\",\"timestamp\":3}\n");
  refused("import robot.db bad.jsonl", "bad.jsonl:2: line 1, column");
  EXPECT_EQ(scene_count(), 3u);
  const Outcome skipped = scratch_.sherlog("scenes import robot.db bad.jsonl --on-error skip");
  EXPECT_EQ(skipped.code, 0);
  EXPECT_THAT(skipped.err, HasSubstr("bad.jsonl:2:"));
  EXPECT_EQ(scene_count(), 5u);
  refused("import robot.db bad.jsonl", "has a scene 'a' already");
  scratch_.write("bad.jsonl",
                 "{\"id\":\"a\",\"timestamp\":2}\n{\"id\":\"b\",\"timestamp\":\n{\"id\":\"c\",\"timestamp\":3}\n");
  const Json replaced = json("import robot.db bad.jsonl --replace --on-error skip");
  EXPECT_EQ(replaced["replaced"], 1);
  EXPECT_EQ(replaced["unchanged"], 1);
  EXPECT_EQ(replaced["skipped"], 1);
  EXPECT_EQ(replaced["problems"][0]["line"], 2);
}

TEST_F(SceneStoreProgram, BadInputIsExit2AndSaysWhy) {
  refused("list missing.db", "there is no store 'missing.db'");
  EXPECT_FALSE(scratch_.exists("missing.db"));
  refused("list '" + kKitchen + "'", "is not a scene store");
  refused("import robot.db missing.jsonl", "cannot read 'missing.jsonl'");
  refused("list robot.db --from yesterday", "'yesterday' is no time");
  refused("list robot.db --during noon", "none of morning");
  refused("where robot.db milk --concepts missing.json", "missing.json");
  refused("evidence robot.db --mapping missing.json", "none of fusion");
  refused("evidence robot.db nobody", "no scene 'nobody'");
  refused("reprocess missing.db", "there is no store");
  refused("reprocess robot.db -m '" + kModels + "information_fusion/fusion.mln'", "needs a --query");
  scratch_.write("mapping.json", R"({"name":"m","rulez":[]})");
  refused("evidence robot.db --mapping mapping.json", "did you mean 'rules'?");
  std::string big = R"({"id":"big","timestamp":1,"identifiables":[)";
  for (int i = 0; i < 10'000; ++i) big += (i > 0 ? ",{\"id\":\"c" : "{\"id\":\"c") + std::to_string(i) + "\"}";
  scratch_.write("big.jsonl", big + "]}\n");
  refused("import robot.db big.jsonl", "has 10000 clusters; the limit is 5000");
  EXPECT_EQ(json("import robot.db big.jsonl --max-clusters 10000")["clusters"], 10'000);
  scratch_.write("empty.jsonl", "");
  EXPECT_EQ(json("import robot.db empty.jsonl")["added"], 0);
}

TEST_F(SceneStoreProgram, AStoreThatCannotBeWrittenIsLeftAsItWas) {
  ASSERT_EQ(scratch_.sherlog("scenes generate --scenes 200 --format jsonl -o many.jsonl").code, 0);
  refused("import robot.db many.jsonl --max-size 300K", "the disk is full");
  EXPECT_EQ(scene_count(), 3u);
  ASSERT_EQ(chmod((scratch_.folder() / "robot.db").c_str(), 0444), 0);
  refused("import robot.db many.jsonl", "is read-only");
  refused("reprocess robot.db", "is read-only");
  EXPECT_EQ(scene_count(), 3u);
}

TEST_F(SceneStoreProgram, ResolvingKeepsTheNamesOfThingsThatComeBack) {
  const auto resolve = [&](const std::string& options) {
    const Outcome outcome = scratch_.sherlog("track resolve robot.db --quiet --json - " + options);
    EXPECT_EQ(outcome.code, 0) << outcome.err;
    return Json::parse(outcome.out);
  };
  EXPECT_EQ(resolve("--dry-run")["steps"].size(), 3u);
  const Json first = resolve("--to 1353590000");  // without the evening
  ASSERT_EQ(first["steps"].size(), 2u);
  EXPECT_EQ(first["steps"][1]["hidden"].size(), 3u) << "nothing out of view has disappeared";
  EXPECT_EQ(first["steps"][1]["disappeared"].size(), 0u);
  // A second run goes on from the store.
  const Json second = resolve("");
  ASSERT_EQ(second["steps"].size(), 1u);
  const Json& clusters = second["steps"][0]["clusters"];
  EXPECT_EQ(clusters[0]["object"], "object-2");  // the bowl
  EXPECT_EQ(clusters[0]["explanation"], "stay");
  EXPECT_EQ(clusters[1]["object"], "object-3");  // the milk
  EXPECT_EQ(clusters[1]["explanation"], "move");
  EXPECT_EQ(json("history robot.db object-3")["sightings"].size(), 2u);
  EXPECT_EQ(resolve("")["steps"].size(), 0u);
  EXPECT_EQ(resolve("--restart")["objects"].size(), second["objects"].size());
  EXPECT_EQ(scratch_.sherlog("track resolve robot.db --mapping fusion").code, 2);
}

TEST_F(SceneStoreProgram, TheSchemaIsPrinted) {
  const Outcome outcome = scratch_.sherlog("scenes schema");
  EXPECT_EQ(outcome.out, read_all(SHERLOG_SOURCE_DIR "/docs/scene.schema.json"));
}

// SHERLOG_KILLS sets how often; each import has 60 scenes of 3 clusters, and is there whole or not at all.
TEST(SceneStoreKilled, WhatWasCommittedStaysAndNothingIsHalfThere) {
  const Scratch scratch;
  const char* wanted = std::getenv("SHERLOG_KILLS");
  const int kills = wanted == nullptr ? 8 : std::atoi(wanted);
  const auto lines = [](int run) {
    std::string text;
    for (int i = 0; i < 60; ++i) {
      text += R"({"id":"r)" + std::to_string(run) + "-" + std::to_string(i) + R"(","timestamp":)" +
              std::to_string(run) + R"(,"identifiables":[)";
      for (const char* cluster : {"a", "b", "c"}) {
        text += std::string(text.back() == '[' ? "" : ",") + R"({"id":")" + cluster +
                R"(","rs.annotation.Detection":[{"name":"Milk"}]})";
      }
      text += "]}\n";
    }
    return text;
  };
  scratch.write("first.jsonl", lines(0));
  const auto start = std::chrono::steady_clock::now();
  ASSERT_EQ(scratch.sherlog("scenes import warm.db first.jsonl").code, 0);
  const double usual = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  std::mt19937 random(3);
  std::uniform_real_distribution<double> uniform(0, 1.3 * usual);
  std::size_t committed = 0;
  int killed = 0;
  for (int run = 1; run <= kills; ++run) {
    scratch.write("run.jsonl", lines(run));
    const std::string wait = std::to_string(uniform(random));
    const Outcome outcome = scratch.shell("\"$S\" scenes import robot.db run.jsonl --quiet & p=$!; sleep " + wait +
                                          "; kill -9 $p; wait $p");
    killed += outcome.code == 137 ? 1 : 0;
    if (!scratch.exists("robot.db")) continue;  // it was killed before it began
    const Outcome check = scratch.sherlog("scenes check robot.db --json -");
    ASSERT_EQ(check.code, 0) << "run " << run << ": " << check.err;
    const Json json = Json::parse(check.out);
    const std::size_t scenes = json["scenes"];
    EXPECT_EQ(json["clusters"], 3 * scenes);
    EXPECT_TRUE(scenes == committed || scenes == committed + 60)
        << "run " << run << ": " << scenes << " after " << committed;
    EXPECT_TRUE(outcome.code != 0 || scenes == committed + 60) << "run " << run << " said that it was done";
    committed = scenes;
  }
  EXPECT_GT(killed, 0) << "no import was interrupted";
}

}  // namespace
}  // namespace sherlog::e2e
