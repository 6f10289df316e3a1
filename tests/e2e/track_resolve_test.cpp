// sherlog track resolve and show: who is who in a store, with and without trackers, over several runs; and the pictures.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>
#include <vector>

#include "perception_bridge/sqlite.h"
#include "tests/e2e/program.h"

namespace sherlog::e2e {
namespace {

using testing::HasSubstr;
using testing::Not;
using Json = nlohmann::json;

const std::string kFigure11 = SHERLOG_SOURCE_DIR "/examples/scenes/figure11.jsonl";

Json thing(const std::string& id, double x, double y, std::vector<double> color, const std::string& mark = "") {
  Json json = {{"id", id},
               {"rs.annotation.LocationAnnotation", {{{"position", {x, y}}, {"frame", "map"}}}},
               {"sherlog.annotation.MeanColor", {{{"color", color}}}}};
  if (!mark.empty()) json["rs.annotation.PerceptualHash"] = {{{"hash", mark}}};
  return json;
}

std::string scene(const std::string& id, double time, const std::vector<Json>& things) {
  return Json{{"id", id}, {"timestamp", time}, {"identifiables", things}}.dump() + "\n";
}

const std::vector<double> kWhite = {0.9, 0.9, 0.9}, kRed = {0.9, 0.1, 0.1}, kBlue = {0.1, 0.1, 0.9};

// Two equal cups with marks; they are moved; then the marks show again, exchanged against the program's guess or not.
std::vector<std::string> cup_scenes(const std::string& of_left, const std::string& of_right) {
  return {scene("before", 1, {thing("c0", 0, 0, kWhite, "0000"), thing("c1", 1, 0, kWhite, "ffff")}),
          scene("unclear", 2, {thing("c0", 0.5, 0.5, kWhite), thing("c1", 0.5, -0.5, kWhite)}),
          scene("later", 3, {thing("c0", 0.5, 0.5, kWhite, of_left), thing("c1", 0.5, -0.5, kWhite, of_right)})};
}

class TrackResolve : public testing::Test {
 protected:
  Json json(const std::string& arguments) {
    const Outcome outcome = scratch_.sherlog(arguments + " --json - --quiet");
    EXPECT_EQ(outcome.code, 0) << arguments << "\n" << outcome.err;
    return Json::parse(outcome.out, nullptr, false);
  }
  void import(const std::string& store, const std::string& text) {
    scratch_.write("in.jsonl", text);
    EXPECT_EQ(scratch_.sherlog("scenes import " + store + " in.jsonl --quiet").code, 0);
  }
  void refused(const std::string& arguments, const std::string& words) {
    const Outcome outcome = scratch_.sherlog(arguments);
    EXPECT_EQ(outcome.code, 2) << arguments << "\n" << outcome.out << outcome.err;
    EXPECT_THAT(outcome.err, HasSubstr(words));
  }
  Scratch scratch_;
};

TEST_F(TrackResolve, WithTrackersTheModelIsAskedOnlyWhereTheyDoNotAgree) {
  std::string text = scene("s0", 0, {thing("c0", 0, 0, kRed), thing("c1", 1, 0, kBlue)});
  for (int t = 1; t < 9; ++t)
    text += scene("s" + std::to_string(t), t, {thing("c0", 0.01 * t, 0, kRed), thing("c1", 1, 0, kBlue)});
  text += scene("moved", 9, {thing("c0", 0.5, 0.9, kRed), thing("c1", 1, 0, kBlue)});
  import("robot.db", text);
  const Json with = json("track resolve robot.db --arbiter --dry-run");
  EXPECT_EQ(with["arbiter"]["scenes"], 10);
  EXPECT_EQ(with["arbiter"]["calls"], 1);
  EXPECT_EQ(with["arbiter"]["contradicted"], 1);
  EXPECT_EQ(with["arbiter"]["share_of_calls"], 0.1);
  EXPECT_EQ(with["steps"][1]["method"], "arbiter");
  EXPECT_EQ(with["steps"][1]["verdict"], "agreed");
  EXPECT_EQ(with["steps"][1]["clusters"][0]["votes"].size(), 2u);
  EXPECT_EQ(with["steps"][9]["verdict"], "contradicted");
  EXPECT_EQ(with["steps"][9]["clusters"][0]["explanation"], "move");
  const Json without = json("track resolve robot.db --dry-run");
  EXPECT_FALSE(without.contains("arbiter"));
  for (std::size_t t = 0; t < 10; ++t) {
    for (std::size_t n = 0; n < 2; ++n)
      EXPECT_EQ(with["steps"][t]["clusters"][n]["object"], without["steps"][t]["clusters"][n]["object"]);
  }
  const Outcome outcome = scratch_.sherlog("track resolve robot.db --arbiter");
  EXPECT_THAT(outcome.out, HasSubstr("the model was asked in 1 of them (10.0 %)"));
  refused("track resolve robot.db --arbiter --sure 1.5", "--sure: sure is 1.5");
}

TEST_F(TrackResolve, ALaterSceneChangesTheHistoryAndTheHistorySaysSo) {
  for (const bool in_one_run : {true, false}) {
    const std::string store = in_one_run ? "one.db" : "three.db";
    std::string left;
    for (const auto& [a, b] : {std::pair{"ffff", "0000"}, std::pair{"0000", "ffff"}}) {
      std::string text;
      for (const std::string& line : cup_scenes(a, b)) text += line;
      const std::string trial = std::string(a) + store;
      std::string guess;
      Json last;
      if (in_one_run) {
        import(trial, text);
        const Json run = json("track resolve " + trial);
        guess = run["steps"][1]["clusters"][0]["object"];
        last = run;
      } else {
        for (const std::string& line : cup_scenes(a, b)) {
          import(trial, line);
          last = json("track resolve " + trial);
          ASSERT_EQ(last["steps"].size(), 1u);
          if (last["steps"][0]["scene"] == "unclear") {
            guess = last["steps"][0]["clusters"][0]["object"];
            EXPECT_EQ(last["open_questions"], 1);
          }
        }
      }
      const std::string truth = std::string(a) == "0000" ? "object-1" : "object-2";
      const Json step = last["steps"].back();
      EXPECT_EQ(last["open_questions"], 0);
      EXPECT_EQ(step["clusters"][0]["object"], truth);
      EXPECT_EQ(step.contains("revisions"), guess != truth);
      const Json history = json("scenes history " + trial + " " + truth);
      ASSERT_EQ(history["sightings"].size(), 3u);
      EXPECT_EQ(history["sightings"][1]["scene"], "unclear");
      EXPECT_EQ(history["sightings"][1]["cluster"], "c0") << "the later scene decides about the earlier one";
      const std::string words = scratch_.sherlog("scenes history " + trial + " " + truth).out;
      if (guess != truth) {
        EXPECT_THAT(words,
                    HasSubstr("c0 in unclear was taken for " + guess + " until later showed that it is " + truth));
        EXPECT_EQ(history["revisions"][0]["decidedBy"], "later");
        // What was believed then stays in the belief of that scene.
        EXPECT_THAT(scratch_.sherlog("scenes export " + trial).out,
                    HasSubstr("\"cluster\":\"c0\",\"object\":\"" + guess));
      } else {
        EXPECT_THAT(words, Not(HasSubstr("was taken for")));
      }
      left += guess == truth ? "confirmed " : "changed ";
      EXPECT_EQ(scratch_.sherlog("scenes check " + trial).code, 0);
    }
    EXPECT_THAT(left, HasSubstr("changed")) << "one of the two contradicts the guess";
    EXPECT_THAT(left, HasSubstr("confirmed"));
  }
}

TEST_F(TrackResolve, ScenesOlderThanTheLastAreNamedAndLeftOut) {
  import("robot.db", scene("noon", 10, {thing("c", 0, 0, kRed)}) + scene("evening", 20, {thing("c", 0, 0, kRed)}));
  json("track resolve robot.db");
  import("robot.db", scene("morning", 5, {thing("c", 1, 1, kBlue)}) + scene("night", 30, {}));
  const Outcome outcome = scratch_.sherlog("track resolve robot.db --dry-run");
  EXPECT_EQ(outcome.code, 0);
  EXPECT_THAT(outcome.err, HasSubstr("1 scenes are older than the last one"));
  const Json again = json("track resolve robot.db");
  EXPECT_EQ(again["left_out"], 1);
  ASSERT_EQ(again["steps"].size(), 1u);
  EXPECT_EQ(again["steps"][0]["scene"], "night");
  EXPECT_EQ(again["steps"][0]["disappeared"][0], "object-1");
  const Json all = json("track resolve robot.db --restart");
  EXPECT_EQ(all["steps"].size(), 4u);
  EXPECT_EQ(all["left_out"], 0);
}

// Equal things: who is taken for whom depends on the order in which the tracker knows them.
TEST_F(TrackResolve, SceneBySceneIsTheSameAsAtOnce) {
  // Two equal cups; one is seen again, and then both are elsewhere.
  const std::vector<std::string> scenes = {
      scene("s0", 0, {thing("a", 0.2, 0.2, kRed), thing("b", 0.8, 0.8, kRed)}),
      scene("s1", 1, {thing("a", 0.2, 0.2, kRed)}),
      scene("s2", 2, {thing("n", 10, 0, kRed), thing("m", 0, 10, kRed)}),
      scene("s3", 3, {thing("n", 20, 0, kRed)}),
      scene("s4", 4, {thing("n", 30, 0, kRed), thing("m", 0, 30, kRed), thing("x", 9, 9, kRed)}),
  };
  std::string all;
  for (const std::string& line : scenes) {
    all += line;
    import("often.db", line);
    json("track resolve often.db");
  }
  import("once.db", all);
  json("track resolve once.db");
  EXPECT_EQ(scratch_.sherlog("scenes export often.db").out, scratch_.sherlog("scenes export once.db").out);
}

TEST_F(TrackResolve, WhatAnotherProgramFoundOutMeanwhileIsNotOverwritten) {
  import("robot.db", scene("a", 1, {thing("c", 0, 0, kRed)}));
  json("track resolve robot.db");
  import("robot.db", scene("b", 2, {thing("c", 0, 0, kRed)}));
  // The other program: it holds the store until this one has read it and waits.
  SqlDatabase other((scratch_.folder() / "robot.db").string(), {});
  ASSERT_TRUE(other.execute("BEGIN IMMEDIATE"));
  std::thread finishes([&] {
    std::this_thread::sleep_for(std::chrono::seconds(2));
    EXPECT_TRUE(
        other.execute("UPDATE beliefs SET document = '{\"names\":7,\"objects\":[],\"questions\":[]}' "
                      "WHERE kind = 'identity_state'; COMMIT"));
  });
  refused("track resolve robot.db --wait 60", "another program has resolved scenes of the store");
  finishes.join();
  EXPECT_EQ(json("scenes history robot.db object-1")["sightings"].size(), 1u) << "nothing was written";
}

TEST_F(TrackResolve, WhatIsForgottenIsNeitherSeenNorInView) {
  import("robot.db", scene("noon", 0, {thing("c", 0, 0, kRed)}) + scene("later", 10, {}));
  const Json object = json("track resolve robot.db --forget 5")["objects"][0];
  EXPECT_EQ(object["wasSeen"], false);
  EXPECT_EQ(object["inView"], false);
  EXPECT_EQ(object["disappeared"], false) << "nobody looked for it";
  for (const char* bad : {"--forget -1", "--forget nan", "--wait nan", "--wait -1", "--utc-offset nan"})
    refused(std::string("track resolve robot.db ") + bad, "expected a number from");
}

TEST_F(TrackResolve, NamesThatDifferInCaseOnlyAreTaken) {
  import("robot.db", scene("noon", 0, {thing("c", 0, 0, kRed)}));
  import("robot.db", R"({"sherlog.record":"identity","id":"Object-1","lastSeen":0,"wasSeen":true,"inView":true,)"
                     R"("disappeared":false,"sightings":[]})"
                     "\n");
  EXPECT_EQ(json("track resolve robot.db --dry-run --restart")["objects"][0]["id"], "object-2");
  EXPECT_EQ(json("track resolve robot.db")["objects"][0]["id"], "object-2");
  EXPECT_THAT(scratch_.sherlog("scenes export robot.db").out, HasSubstr("\"id\":\"Object-1\""));
}

TEST_F(TrackResolve, AContradictionIsNamed) {
  std::ifstream in(SHERLOG_SOURCE_DIR "/models/identity_resolution/table1.mln");
  const std::string text((std::istreambuf_iterator<char>(in)), std::istreambuf_iterator<char>());
  ASSERT_FALSE(text.empty());
  scratch_.write("never.mln", text + "\n!appear(n).\n");
  import("robot.db", scene("noon", 0, {thing("c", 0, 0, kRed)}) + scene("later", 1, {thing("c", 0, 0, kRed)}));
  for (const char* command : {"track resolve robot.db --model never.mln --json r.json",
                              "track show robot.db --scene later --model always.mln"}) {
    scratch_.write("always.mln", text + "\n!appear(n).\n!is(o, n, stay).\n!is(o, n, move).\n!is(o, n, newview).\n");
    const Outcome outcome = scratch_.sherlog(command);
    EXPECT_EQ(outcome.code, 3) << outcome.err;
    EXPECT_THAT(outcome.err, HasSubstr("note: hard formula: "));
    EXPECT_THAT(outcome.err, HasSubstr("appear(N0)"));
  }
  const Json json = Json::parse(scratch_.read("r.json"), nullptr, false);
  EXPECT_EQ(json["termination"], "no_possible_world");
  EXPECT_FALSE(json["conflict"].empty());
}

// One pair, one row, one column or nothing old is a matching, too.
TEST_F(TrackResolve, SmallMatchingsAreMatchings) {
  import("robot.db", scene("s0", 0, {thing("a", 0, 0, kRed)}) + scene("s1", 1, {thing("a", 0, 0, kRed)}) +
                         scene("s2", 2, {thing("a", 0, 0, kRed), thing("b", 1, 1, kBlue)}) +
                         scene("s3", 3, {thing("b", 1, 1, kBlue)}) + scene("s4", 4, {}));
  const Json exact = json("track resolve robot.db --dry-run --method exact");
  const Json matching = json("track resolve robot.db --dry-run --method matching");
  ASSERT_EQ(matching["steps"].size(), 5u);
  for (std::size_t t = 0; t < 5; ++t) {
    for (std::size_t n = 0; n < exact["steps"][t]["clusters"].size(); ++n) {
      const Json &a = exact["steps"][t]["clusters"][n], &b = matching["steps"][t]["clusters"][n];
      EXPECT_EQ(a["object"], b["object"]);
      EXPECT_NEAR(a["probability"].get<double>(), b["probability"].get<double>(), 1e-9);
    }
  }
  const Outcome trials = scratch_.sherlog("track simulate --method matching --model paper --trials 300 --objects 4");
  EXPECT_EQ(trials.code, 0) << trials.err;
}

// One world says what is most probable, and not how probable it is.
TEST_F(TrackResolve, TheMostProbableWorldHasNoProbabilities) {
  import("robot.db", scene("s0", 0, {thing("a", 0, 0, kRed)}) + scene("s1", 1, {thing("a", 0, 0, kRed)}));
  const Json run = json("track resolve robot.db --method map");
  for (const Json& step : run["steps"]) {
    ASSERT_EQ(step["clusters"].size(), 1u);
    EXPECT_EQ(step["clusters"][0]["object"], "object-1");
    EXPECT_FALSE(step["clusters"][0].contains("probability")) << step;
  }
  const std::string exported = scratch_.sherlog("scenes export robot.db").out;
  EXPECT_THAT(exported, Not(HasSubstr("probability")));
  import("again.db", exported);
  EXPECT_EQ(scratch_.sherlog("scenes export again.db").out, exported);
  EXPECT_FALSE(json("scenes where robot.db object-1")["found"][0].contains("confidence"));
}

TEST_F(TrackResolve, TooManyPairsAreRefusedWithTheLimit) {
  std::vector<Json> many;
  for (int i = 0; i < 600; ++i) many.push_back({{"id", "c" + std::to_string(i)}});
  import("robot.db", scene("a", 1, many) + scene("b", 2, many));
  refused("track resolve robot.db", "360000 pairs, and the limit is 250000");
  refused("track resolve robot.db --arbiter", "360000 pairs");
  EXPECT_EQ(json("track resolve robot.db --to 1")["objects"].size(), 600u) << "the scene before was taken in";
  refused("track resolve robot.db --max-pairs 1000", "the limit is 1000");
}

// --- pictures ---

TEST_F(TrackResolve, ShowsTheKitchenScenesOfThePaper) {
  ASSERT_EQ(scratch_.sherlog("scenes import robot.db '" + kFigure11 + "'").code, 0);
  const Json plates = json("track show robot.db --scene plates-after --against plates-before --svg plates.svg");
  EXPECT_EQ(plates["schema"], "sherlog.track.show/1");
  EXPECT_EQ(plates["association"], (Json{{"c0", "plate-left"}, {"c1", "plate-middle"}, {"c2", "mug"}}));
  EXPECT_EQ(plates["explanation"], (Json{{"plate-left", "stay"}, {"plate-middle", "move"}, {"mug", "stay"}}));
  EXPECT_GT(plates["grades"]["similar"][0][1], 0.99);
  EXPECT_THAT(scratch_.read("plates.svg"), HasSubstr("plates-after against plates-before"));
  // The newest scene against the one before.
  const Json replaced = json("track show robot.db --html page.html");
  EXPECT_EQ(replaced["title"], "table-after against table-before");
  EXPECT_EQ(replaced["association"]["c0"], nullptr);
  EXPECT_EQ(replaced["explanation"]["magazine"], "disappear");
  EXPECT_GT(replaced["appear"][0], 0.5);
  EXPECT_THAT(scratch_.read("page.html"), HasSubstr("</svg>"));
  const Outcome to_output = scratch_.sherlog("track show robot.db --svg -");
  EXPECT_EQ(to_output.out.substr(0, 4), "<svg");
  EXPECT_THAT(scratch_.sherlog("track show robot.db").out, HasSubstr("magazine  disappear"));
}

TEST_F(TrackResolve, ShowsDumpedTrials) {
  ASSERT_EQ(scratch_.sherlog("track simulate --trials 3 --model paper --dump trials.jsonl --quiet").code, 0);
  const Json shown = json("track show --dump trials.jsonl --trial 2 --svg trial.svg");
  std::istringstream lines(scratch_.read("trials.jsonl"));
  std::string line;
  for (int i = 0; i < 3; ++i) std::getline(lines, line);
  const Json trial = Json::parse(line);
  EXPECT_EQ(shown["old"].size(), trial["old"].size());
  EXPECT_EQ(shown["association"], trial["result"]["association"]) << "the same model says the same";
  EXPECT_THAT(scratch_.read("trial.svg"), HasSubstr("the truth differs"));
}

TEST_F(TrackResolve, ShowSaysWhatItCannotDraw) {
  ASSERT_EQ(scratch_.sherlog("scenes import robot.db '" + kFigure11 + "'").code, 0);
  refused("track show", "either a STORE or --dump");
  refused("track show robot.db --dump x.jsonl", "either a STORE or --dump");
  refused("track show robot.db --scene nobody", "no scene 'nobody'");
  refused("track show robot.db --against nobody", "no scene 'nobody'");
  refused("track show robot.db --scene plates-before", "no scene before 'plates-before'");
  refused("track show robot.db --model learned", "--dump");
  refused("track show robot.db --mapping fusion", "no rule for pairs");
  refused("track show missing.db", "there is no store 'missing.db'");
  refused("track show --dump missing.jsonl", "cannot read 'missing.jsonl'");
  scratch_.write("bad.jsonl", "{\"trial\": 0}\n");
  refused("track show --dump bad.jsonl", "bad.jsonl:1: a trial has no number 'seed'");
  scratch_.write("empty.jsonl", "");
  refused("track show --dump empty.jsonl --trial 3", "has no trial 3");
  scratch_.sherlog("scenes import empty.db empty.jsonl");
  refused("track show empty.db", "the store has no scenes");
}

}  // namespace
}  // namespace sherlog::e2e
