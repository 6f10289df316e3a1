// sherlog advise, and the question the other way round: which observation is to be expected.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <string>

#include "tests/e2e/program.h"

namespace sherlog::e2e {
namespace {

using testing::HasSubstr;
using Json = nlohmann::json;

const std::string kFolder = SHERLOG_SOURCE_DIR "/models/information_fusion/";
const std::string kFusion = "-m '" + kFolder + "fusion.mln' ";

Json answer(const Scratch& scratch, const std::string& arguments) {
  const Outcome outcome = scratch.sherlog(arguments + " --json -");
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  return Json::parse(outcome.out, nullptr, false);
}

// A box of cereals at breakfast: which sign should be looked for?
TEST(ExpectedObservations, AreAnOrdinaryQuery) {
  const Scratch scratch;
  scratch.write("scene.db", "scene(Breakfast)\nshape(c1, Box)\nobject(c1, Vitalis_Cereals)\n");
  const Json json = answer(scratch, "infer " + kFusion + "-e scene.db -q 'goggles_Logo(c1,?l)' --method exact");
  std::string best;
  double best_probability = 0, oetker = 0;
  for (const Json& entry : json["marginals"]) {
    if (entry["probability"] > best_probability) {
      best_probability = entry["probability"];
      best = entry["atom"];
    }
    if (entry["atom"] == "goggles_Logo(c1,\"Dr Oetker\")") oetker = entry["probability"];
  }
  EXPECT_EQ(best, "goggles_Logo(c1,\"Dr Oetker\")");
  // Weight 2.5 for the sign on these cereals, -3 for any sign.
  EXPECT_NEAR(oetker, 1 / (1 + std::exp(0.5)), 1e-9);
}

TEST(Advise, RanksByDropForEachSecond) {
  const Scratch scratch;
  const Json json = answer(scratch, "advise " + kFusion + "-e '" + kFolder + "worked_example.db' -q object");
  EXPECT_EQ(json["schema"], "sherlog.advise/1");
  EXPECT_EQ(json["termination"], "completed");
  EXPECT_GT(json["entropy"], 0.0);
  EXPECT_LE(json["entropy"], json["marginal_entropy"]);
  // Shape and colour are known for both; the sign is known for c1 only.
  ASSERT_EQ(json["annotators"].size(), 7u);
  double last = 1e9;
  for (const Json& entry : json["annotators"]) {
    EXPECT_NE(entry["annotator"], "shape");
    EXPECT_FALSE(entry["annotator"] == "goggles_Logo" && entry["cluster"] == "c1");
    EXPECT_GE(entry["expected_entropy_drop"], 0.0);
    EXPECT_LE(entry["drop_per_second"], last);
    EXPECT_NEAR(entry["drop_per_second"].get<double>() * entry["seconds"].get<double>(), entry["expected_entropy_drop"],
                1e-12);
    last = entry["drop_per_second"];
  }
}

TEST(Advise, CostsComeFromAFile) {
  const Scratch scratch;
  scratch.write("costs.txt",
                "# seconds\ngoggles_Logo 0.001\n\ngoggles_Text 1000  // slow\nGoggles 5 goggles_Logo goggles_Text\n");
  scratch.write("costs.json",
                R"({"goggles_Logo": 0.001, "goggles_Text": {"seconds": 1000},
                    "Goggles": {"seconds": 5, "predicates": ["goggles_Logo", "goggles_Text"]}})");
  scratch.write("scene.db", "shape(c1, Box)\ncolor(c1, White)\nscene(Breakfast)\n");
  const std::string command = "advise " + kFusion + "-e scene.db -q object --costs ";
  Json lines = answer(scratch, command + "costs.txt"), json = answer(scratch, command + "costs.json");
  lines.erase("seconds");
  json.erase("seconds");
  EXPECT_EQ(lines, json);
  ASSERT_EQ(json["annotators"].size(), 3u);
  EXPECT_EQ(json["annotators"][0]["annotator"], "goggles_Logo");
  EXPECT_EQ(json["annotators"][1]["annotator"], "Goggles");
  EXPECT_EQ(json["annotators"][1]["seconds"], 5.0);
  EXPECT_GT(json["annotators"][1]["expected_entropy_drop"], json["annotators"][0]["expected_entropy_drop"]);
  EXPECT_EQ(json["annotators"][2]["annotator"], "goggles_Text");
}

TEST(Advise, BadCostsAreNamed) {
  const Scratch scratch;
  const std::string command = "advise " + kFusion + "-e '" + kFolder + "worked_example.db' -q object --costs ";
  const std::pair<const char*, const char*> cases[] = {
      {"goggles_Logo 0\n", "a run time is above 0"},
      {"goggles_Logo -1\n", "a run time is above 0"},
      {"goggles_Logo nan\n", "a run time is above 0"},
      {"goggles_Logo inf\n", "a run time is above 0"},
      {"goggles_Logo\n", "'' is not a number of seconds"},
      {"\ngoggles_Logo fast\n", "costs:2:1"},
      {"goggles_Logos 1\n", "did you mean 'goggles_Logo'?"},
      {"goggles_Logo 1\ngoggles_Logo 2\n", "twice"},
      {"object 1\n", "which is what is asked"},
      {"Mixed 1 goggles_Logo scene\n", "about different things"},
      {"", "no annotators"},
      {"{\"goggles_Logo\": \"one\"}", "expected seconds"},
      {"{\"goggles_Logo\": 1", "not a JSON object"},
  };
  for (const auto& [text, message] : cases) {
    scratch.write("costs", text);
    const Outcome outcome = scratch.sherlog(command + "costs");
    EXPECT_EQ(outcome.code, 2) << text;
    EXPECT_THAT(outcome.err, HasSubstr(message)) << text;
    EXPECT_EQ(outcome.out, "") << text;
  }
  EXPECT_EQ(scratch.sherlog(command + "missing").code, 2);
}

TEST(Advise, OtherBadInputIsExit2) {
  const Scratch scratch;
  scratch.write("two.db", "shape(c1, Box)\n---\nshape(c1, Round)\n");
  scratch.write("plain.mln", "A(thing)\nB(thing)\n1 A(x) ^ B(x)\n");
  scratch.write("plain.db", "A(X)\n");
  EXPECT_EQ(scratch.sherlog("advise " + kFusion + "-e two.db -q object").code, 2);
  EXPECT_EQ(scratch.sherlog("advise " + kFusion + "-e '" + kFolder + "worked_example.db'").code, 2);
  EXPECT_EQ(scratch.sherlog("advise " + kFusion + "-q object --max-outcomes 0").code, 2);
  const Outcome map =
      scratch.sherlog("advise " + kFusion + "-e '" + kFolder + "worked_example.db' -q object --method map");
  EXPECT_EQ(map.code, 2);
  EXPECT_THAT(map.err, HasSubstr("no marginal probabilities"));
  scratch.write("soft.db", "0.8 shape(c1, Box)\n");
  EXPECT_EQ(scratch.sherlog("advise " + kFusion + "-e soft.db -q object --soft-evidence jeffrey").code, 2);
  EXPECT_EQ(scratch.sherlog("advise " + kFusion + "-e soft.db -q object").code, 0);
  const Outcome unknown = scratch.sherlog("advise -m plain.mln -e plain.db -q B");
  EXPECT_EQ(unknown.code, 2);
  EXPECT_THAT(unknown.err, HasSubstr("--costs"));
}

TEST(Advise, SceneWithoutAWorldIsExit3) {
  const Scratch scratch;
  scratch.write(
      "m.mln",
      "shape(c, form)\nobject(c, kind!)\nobject(c, Cup) v object(c, Bowl).\nshape(c, Box) => !object(c, Cup).\n"
      "shape(c, Flat) => !object(c, Bowl).\ncolor(c, hue)\n1 color(c, Red) ^ object(c, Cup)\n");
  scratch.write("e.db", "shape(C1, Box)\nshape(C1, Flat)\n");
  const Outcome outcome = scratch.sherlog("advise -m m.mln -e e.db -q object --json -");
  EXPECT_EQ(outcome.code, 3) << outcome.err;
  const Json json = Json::parse(outcome.out);
  EXPECT_EQ(json["termination"], "no_possible_world");
  EXPECT_FALSE(json.contains("annotators"));
  EXPECT_FALSE(json["conflict"].empty());
}

TEST(Advise, SameSeedSameAnswerWhereOutcomesAreDrawn) {
  const Scratch scratch;
  const std::string command =
      "advise " + kFusion + "-e '" + kFolder + "breakfast_scene.db' -q object --max-outcomes 1 --seed 9";
  Json one = answer(scratch, command), two = answer(scratch, command + " --threads 2");
  one.erase("seconds");
  two.erase("seconds");
  EXPECT_EQ(one, two);
  const Json exact = answer(scratch, "advise " + kFusion + "-e '" + kFolder + "breakfast_scene.db' -q object");
  std::size_t drawn = 0;
  for (const Json& entry : one["annotators"]) {
    if (!entry.contains("mcse")) continue;
    ++drawn;
    for (const Json& other : exact["annotators"]) {
      if (other["annotator"] != entry["annotator"] || other["cluster"] != entry["cluster"]) continue;
      EXPECT_NEAR(entry["expected_entropy_drop"].get<double>(), other["expected_entropy_drop"].get<double>(),
                  5 * entry["mcse"].get<double>());
    }
  }
  EXPECT_GT(drawn, 5u);
}

}  // namespace
}  // namespace sherlog::e2e
