// sherlog learn and sherlog xval: what they answer, to the letter of their documents, and what they say to bad input.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <random>
#include <string>
#include <vector>

#include "tests/e2e/program.h"

namespace sherlog::e2e {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;
using Json = nlohmann::json;

// Three heads of four: the likelihood is largest at log 3, where it is 3 log(3/4) + log(1/4).
constexpr const char* kCoins = "Heads(coin)\n0 Heads(x)\n";
constexpr const char* kThreeOfFour = "coin = {A, B, C, D}\nHeads(A)\nHeads(B)\nHeads(C)\n";
const double kCoinOptimum = 3 * std::log(0.75) + std::log(0.25);

constexpr const char* kKitchen =
    "context = {Breakfast, Cooking}\nobject(cluster, kind!)\nshape(cluster, form)\nscene(context)\n"
    "0 shape(c, +s) ^ object(c, +o)\n0 scene(+t) ^ object(c, +o)\n";
constexpr const char* kScenes =
    "scene(Breakfast)\nshape(C1, Box)\nshape(C2, Round)\nobject(C1, Cereal)\nobject(C2, Bowl)\n---\n"
    "scene(Cooking)\nshape(C1, Round)\nobject(C1, Pot)\n---\n"
    "scene(Breakfast)\nshape(C1, Round)\nobject(C1, Bowl)\n---\n"
    "scene(Cooking)\nshape(C1, Box)\nshape(C2, Round)\nobject(C1, Cereal)\nobject(C2, Pot)\n";

class Learning : public testing::Test {
 protected:
  void SetUp() override {
    scratch.write("coin.mln", kCoins);
    scratch.write("coin.db", kThreeOfFour);
    scratch.write("m.mln", kKitchen);
    scratch.write("t.db", kScenes);
  }
  Outcome run(const std::string& arguments) const { return scratch.sherlog(arguments); }
  Json json(const std::string& arguments) const {
    const Outcome outcome = run(arguments + " --json -");
    EXPECT_EQ(outcome.code, 0) << arguments << "\n" << outcome.err;
    return Json::parse(outcome.out, nullptr, false);
  }
  Json learn(const std::string& arguments) const { return json("learn -o out.mln " + arguments); }
  // Nothing on standard output, one of these sentences on the other.
  void expect_refused(const std::string& arguments, const std::string& message, int code = 2) const {
    const Outcome outcome = run(arguments);
    EXPECT_EQ(outcome.code, code) << arguments << "\n" << outcome.err;
    EXPECT_THAT(outcome.out, IsEmpty()) << arguments;
    EXPECT_THAT(outcome.err, AllOf(HasSubstr("error: "), HasSubstr(message))) << arguments;
    EXPECT_FALSE(scratch.exists("out.mln")) << arguments;
  }
  // People whose friendships nobody can sum over, so that sampling takes as long as one likes.
  void write_long_work() const {
    std::mt19937_64 random(5);
    std::string data;
    for (int i = 0; i < 60; ++i) {
      if (random() % 5 < 2) data += "Smokes(P" + std::to_string(i) + ")\n";
      for (int j = 0; j < 60; ++j) {
        if (i != j && random() % 6 == 0) {
          data += "Friends(P" + std::to_string(i) + ",P" + std::to_string(j) + ")\n";
        }
      }
    }
    scratch.write("long.mln",
                  "Smokes(person)\nFriends(person,person)\n0 Smokes(x)\n0 Friends(x,y) => (Smokes(x) <=> Smokes(y))\n");
    scratch.write("long.db", data);
  }
  const std::string long_work =
      "learn -m long.mln -t long.db -o out.mln --method mcsat --discriminative Smokes --samples 100000";
  Scratch scratch;
};

std::vector<double> weights_of(const Json& document) {
  std::vector<double> weights;
  for (const Json& entry : document["weights"]) weights.push_back(entry["weight"]);
  return weights;
}

// --- what learn answers

TEST_F(Learning, DocumentIsTheContracts) {
  const Json result = learn("-m coin.mln -t coin.db");
  EXPECT_EQ(result["schema"], "sherlog.learn/1");
  EXPECT_EQ(result["method"], "pll");
  EXPECT_EQ(result["termination"], "completed");
  EXPECT_EQ(result["prior"]["mean"], 0.0);
  EXPECT_EQ(result["prior"]["stdev"], 10.0);
  EXPECT_EQ(result["converged"], true);
  EXPECT_GE(result["iterations"], 1);
  EXPECT_LE(result["gradient_norm"], 1e-6);
  ASSERT_EQ(result["weights"].size(), 1u);
  EXPECT_EQ(result["weights"][0]["formula"], "Heads(x)");
  const double w = result["weights"][0]["weight"];
  // The slope of the likelihood is the prior's: 3 - 4 p = w / 100.
  EXPECT_NEAR(3 - 4 / (1 + std::exp(-w)), w / 100, 1e-6);
  EXPECT_NEAR(result["objective"].get<double>(), 3 * w - 4 * std::log1p(std::exp(w)), 1e-9);
  EXPECT_NEAR(result["objective_with_prior"].get<double>(), result["objective"].get<double>() - w * w / 200, 1e-9);
  EXPECT_TRUE(result["seconds"].is_object());
  EXPECT_FALSE(result.contains("message"));
}

TEST_F(Learning, EveryMethodFindsTheOddsOfACoin) {
  for (const char* method : {"pll", "bpll", "ll", "dpll --discriminative Heads", "cll --discriminative Heads"}) {
    const Json result = learn("-m coin.mln -t coin.db --prior-stdev inf --method " + std::string(method));
    EXPECT_NEAR(result["objective"].get<double>(), kCoinOptimum, 1e-9) << method;
    EXPECT_NEAR(result["weights"][0]["weight"].get<double>(), std::log(3), 1e-6) << method;
    EXPECT_EQ(result["objective"], result["objective_with_prior"]) << method;
  }
  const Json sampled = learn("-m coin.mln -t coin.db --prior-stdev inf --method mcsat --discriminative Heads");
  EXPECT_NEAR(sampled["weights"][0]["weight"].get<double>(), std::log(3), 1e-2);
  // It samples the slope and never knows the value.
  EXPECT_FALSE(sampled.contains("objective"));
  EXPECT_FALSE(sampled.contains("objective_with_prior"));
}

TEST_F(Learning, OptimumDoesNotDependOnTheWeightsOfTheModel) {
  scratch.write("other.mln", "Heads(coin)\n-4 Heads(x)\n");
  const Json one = learn("-m coin.mln -t coin.db --prior-stdev 2 --prior-mean 1");
  const Json two = learn("-m other.mln -t coin.db --prior-stdev 2 --prior-mean 1");
  EXPECT_NEAR(weights_of(one)[0], weights_of(two)[0], 1e-6);
  const double w = weights_of(one)[0];
  EXPECT_NEAR(one["objective_with_prior"].get<double>(), one["objective"].get<double>() - (w - 1) * (w - 1) / 8, 1e-9);
}

TEST_F(Learning, FormulaMayHaveAPriorOfItsOwn) {
  scratch.write("two.mln", "Heads(coin)\nTails(coin)\n0 Heads(x)\nHeads(A) v !Heads(A).\n0 Tails(x)\n");
  scratch.write("two.db", "coin = {A, B, C, D}\nHeads(A)\nHeads(B)\nHeads(C)\nTails(A)\nTails(B)\nTails(C)\n");
  const std::vector<double> w = weights_of(learn("-m two.mln -t two.db --prior-stdev inf --formula-stdev 2=0.5"));
  EXPECT_NEAR(w[0], std::log(3), 1e-6);
  EXPECT_NEAR(3 - 4 / (1 + std::exp(-w[1])), w[1] / 0.25, 1e-6);
}

TEST_F(Learning, SeveralDatabasesAddUp) {
  scratch.write("one.db", "coin = {A, B, C}\nHeads(A)\nHeads(B)\n");
  scratch.write("two.db", "coin = {A}\nHeads(A)\n");
  scratch.write("both.db", "coin = {A, B, C}\nHeads(A)\nHeads(B)\n---\ncoin = {A}\nHeads(A)\n");
  for (const char* files : {"-t one.db -t two.db", "-t both.db"}) {
    const Json result = learn("-m coin.mln --prior-stdev inf " + std::string(files));
    EXPECT_EQ(result["databases"], 2) << files;
    EXPECT_NEAR(result["objective"].get<double>(), kCoinOptimum, 1e-9) << files;
    EXPECT_NEAR(weights_of(result)[0], std::log(3), 1e-6) << files;
  }
  const Outcome piped =
      scratch.shell("cat both.db | \"$S\" learn -m coin.mln -t - -o out.mln --prior-stdev inf --json -");
  ASSERT_EQ(piped.code, 0) << piped.err;
  EXPECT_NEAR(Json::parse(piped.out)["objective"].get<double>(), kCoinOptimum, 1e-9);
}

TEST_F(Learning, SameAnswerWhateverTheThreads) {
  for (const char* method : {"pll", "cll --discriminative object", "mcsat --discriminative object --samples 200"}) {
    const std::string arguments = "-m m.mln -t t.db --seed 3 --method " + std::string(method);
    EXPECT_EQ(learn(arguments + " --threads 1")["weights"], learn(arguments + " --threads 4")["weights"]) << method;
  }
}

TEST_F(Learning, FixedWeightsStayAndAreListed) {
  scratch.write("fix.mln", "Heads(coin)\nRed(coin)\n#fixweight\n0.7 Heads(x)\n0 Red(x)\n@2.5 Heads(x) ^ Red(x)\n");
  const std::string data = "coin = {A, B, C, D}\nHeads(A)\nHeads(B)\nHeads(C)\nRed(D)\n";
  scratch.write("fix.db", data);
  const Json result = learn("-m fix.mln -t fix.db");
  ASSERT_EQ(result["weights"].size(), 3u);
  EXPECT_EQ(result["weights"][0]["weight"], 0.7);
  EXPECT_EQ(result["weights"][0]["fixed"], true);
  EXPECT_FALSE(result["weights"][1].contains("fixed"));
  EXPECT_NE(result["weights"][1]["weight"], 0.0);
  EXPECT_EQ(result["weights"][2]["weight"], 2.5);
  EXPECT_EQ(result["weights"][2]["fixed"], true);
  // The prior speaks of the one that is learned.
  const double w = result["weights"][1]["weight"];
  EXPECT_NEAR(result["objective_with_prior"].get<double>(), result["objective"].get<double>() - w * w / 200, 1e-9);
  // And so it is with the model that was written.
  const Json again = json("learn -m out.mln -t fix.db -o again.mln");
  EXPECT_EQ(again["weights"][0], result["weights"][0]);
  EXPECT_EQ(again["weights"][2], result["weights"][2]);
  EXPECT_NEAR(again["objective"].get<double>(), result["objective"].get<double>(), 1e-9);
}

TEST_F(Learning, FormulaWithoutAWeightIsLearned) {
  scratch.write("none.mln", "Heads(coin)\nHeads(x) ^ Heads(x)\n");
  const Json result = learn("-m none.mln -t coin.db --prior-stdev inf");
  EXPECT_NEAR(weights_of(result)[0], std::log(3), 1e-6);
}

TEST_F(Learning, WrittenModelReadsBackWithTheSameObjective) {
  for (const char* method : {"pll", "dpll --discriminative object", "cll --discriminative object"}) {
    const std::string options = " -t t.db --prior-stdev 2 --method " + std::string(method);
    const Json result = learn("-m m.mln" + options);
    EXPECT_EQ(result["weights"].size(), 12u);  // 2 shapes and 2 contexts with 3 kinds
    const Outcome check = run("check -m out.mln -e t.db");
    EXPECT_EQ(check.code, 0) << check.err;
    // Started at the optimum nothing moves.
    const Json again = json("learn -m out.mln -o again.mln --max-iterations 1" + options);
    EXPECT_NEAR(again["objective"].get<double>(), result["objective"].get<double>(), 1e-9) << method;
    EXPECT_NEAR(again["objective_with_prior"].get<double>(), result["objective_with_prior"].get<double>(), 1e-9);
    EXPECT_EQ(weights_of(again).size(), 12u);
    for (std::size_t w = 0; w < 12; ++w) EXPECT_NEAR(weights_of(again)[w], weights_of(result)[w], 1e-6);
  }
  scratch.write("scene.db", "scene(Breakfast)\nshape(C1, Box)\n");
  EXPECT_EQ(run("infer -m out.mln -e scene.db -q object").code, 0);
}

TEST_F(Learning, WrittenModelSaysWhereItIsFrom) {
  ASSERT_EQ(run("learn -m m.mln -t t.db -o out.mln --method cll --discriminative object --prior-stdev 2").code, 0);
  const std::string text = scratch.read("out.mln");
  for (const char* part : {"// ", "method cll", "m.mln", "t.db", "4 databases", "object", "standard deviation 2",
                           "objective -", "converged"}) {
    EXPECT_THAT(text, HasSubstr(part));
  }
  const Outcome printed = run("learn -m m.mln -t t.db -o - --method cll --discriminative object --prior-stdev 2");
  EXPECT_EQ(printed.out, text);
}

TEST_F(Learning, StandardErrorsAreThoseOfTheCurvature) {
  const Json result = learn("-m coin.mln -t coin.db --prior-stdev inf --standard-errors");
  EXPECT_NEAR(result["weights"][0]["standard_error"].get<double>(), 1 / std::sqrt(4 * 0.75 * 0.25), 1e-6);
  EXPECT_FALSE(learn("-m coin.mln -t coin.db")["weights"][0].contains("standard_error"));
}

TEST_F(Learning, WhatTheDataCannotTellIsNamed) {
  // Never false in any world that differs by one variable; never true at all; one twice.
  scratch.write("odd.mln",
                "colour = {Red, Blue}\nHeads(coin)\nPaint(coin, colour)\n0 Heads(x)\n0 Heads(x) ^ Paint(x, +c)\n"
                "0 Heads(x) v !Heads(x)\n0 Heads(x)\n");
  const Outcome outcome =
      run("learn -m odd.mln -t coin.db -o out.mln --method dpll --discriminative Heads --prior-mean 0.5 --json json");
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_THAT(outcome.err, AllOf(HasSubstr("says nothing about 3 of 5 weights"),
                                 HasSubstr("'Heads(x) ^ Paint(x, Red)' and 'Heads(x) ^ Paint(x, Blue)'"),
                                 HasSubstr("cannot tell apart the weights of 'Heads(x)' and 'Heads(x)'")));
  EXPECT_THAT(outcome.out, HasSubstr("Paint(x, Blue)  (the data says nothing about it)"));
  const Json result = Json::parse(scratch.read("json"));
  ASSERT_EQ(result["weights"].size(), 5u);
  for (const Json& entry : result["weights"]) EXPECT_EQ(entry["identified"], false);
  EXPECT_EQ(result["weights"][1]["weight"], 0.5);  // the prior's
  EXPECT_EQ(result["weights"][3]["weight"], 0.5);
  // Both halves of the same formula share what there is.
  EXPECT_NEAR(result["weights"][0]["weight"].get<double>(), result["weights"][4]["weight"].get<double>(), 1e-6);
  EXPECT_THAT(run("learn -m odd.mln -t coin.db -o out.mln --quiet").err, IsEmpty());
}

// --- what learn says to bad input

TEST_F(Learning, DatabaseWithoutTheTargetIsNamed) {
  scratch.write("no.db", "scene(Cooking)\nshape(C1, Round)\nobject(C1, Pot)\n---\nscene(Breakfast)\nshape(C1, Box)\n");
  for (const std::string method : {"pll", "cll --discriminative object"}) {
    expect_refused("learn -m m.mln -t no.db -o out.mln --method " + method,
                   "database 2 of 2: no.db:5: exactly one value of object(C1,?) must be true");
  }
  expect_refused("xval -m m.mln -t no.db -q object --folds 2", "no true atom of 'object'");
  // Without a mark "nothing is true" is an answer, and an unlikely one.
  scratch.write("none.db", "coin = {A, B}\n---\ncoin = {A, B}\nHeads(A)\n");
  const Outcome some = run("learn -m coin.mln -t none.db -o out.mln --method dpll --discriminative Heads");
  EXPECT_EQ(some.code, 0);
  EXPECT_THAT(some.err, HasSubstr("1 of 2 databases state no true atom of 'Heads' (the first is number 1)"));
  const Outcome folds = run("xval -m coin.mln -t none.db -q Heads --folds 2");
  EXPECT_EQ(folds.code, 0);
  EXPECT_THAT(folds.err, HasSubstr("1 of 2 databases state no true atom of 'Heads'"));
}

TEST_F(Learning, ContradictoryLabelsAreShownWithBothPlaces) {
  scratch.write("two.db", "object(C1,Cereal)\nobject(C1,Bowl)\nscene(Breakfast)\n");
  scratch.write("not.db", "object(C1,Cereal)\nscene(Breakfast)\n!object(C1,Cereal)\n");
  for (const std::string command : {"learn -m m.mln -o out.mln -t ", "xval -m m.mln -q object -t "}) {
    const Outcome two = run(command + "two.db");
    EXPECT_EQ(two.code, 2);
    EXPECT_THAT(two.err, AllOf(HasSubstr("two.db:2:1"), HasSubstr("two.db:1:1")));
    const Outcome both = run(command + "not.db");
    EXPECT_EQ(both.code, 2);
    EXPECT_THAT(both.err, AllOf(HasSubstr("not.db:3:1"), HasSubstr("not.db:1:1")));
  }
}

TEST_F(Learning, TrainingDataHasNoDegreesAndNoUnknownAtoms) {
  scratch.write("soft.db", "coin = {A, B}\n0.7 Heads(A)\n");
  scratch.write("open.db", "coin = {A, B}\n?Heads(A)\n");
  expect_refused("learn -m coin.mln -t soft.db -o out.mln", "soft.db:2: training data must say whether Heads(A)");
  expect_refused("learn -m coin.mln -t open.db -o out.mln", "open.db:2: training data must say whether Heads(A)");
}

TEST_F(Learning, BrokenHardFormulaIsNamedWithItsGroundFormulaAndThePlaces) {
  scratch.write("hard.mln", std::string(kKitchen) + "shape(c, Box) => !object(c, Bowl).\n");
  scratch.write("broken.db",
                "scene(Breakfast)\nshape(C1,Round)\nobject(C1,Cereal)\n---\n"
                "object(C7,Bowl)\nshape(C7,Box)\n");
  const std::string methods[] = {"pll",
                                 "bpll",
                                 "ll",
                                 "dpll --discriminative object",
                                 "cll --discriminative object",
                                 "mcsat --discriminative object"};
  for (const std::string& method : methods) {
    const std::string arguments = "learn -m hard.mln -t broken.db -o out.mln --method " + method;
    expect_refused(arguments,
                   "database 2 of 2: the training data breaks a hard formula: hard.mln:7: "
                   "shape(C7,Box) => !object(C7,Bowl)",
                   3);
    EXPECT_THAT(run(arguments).err, AllOf(HasSubstr("broken.db:6: shape(C7,Box) is true"),
                                          HasSubstr("broken.db:5: object(C7,Bowl) is true")));
  }
  const Outcome outcome = run("learn -m hard.mln -t broken.db -o out.mln --json -");
  EXPECT_EQ(Json::parse(outcome.out)["termination"], "no_possible_world");
  expect_refused("xval -m hard.mln -t broken.db -q object --folds 2", "shape(C7,Box) => !object(C7,Bowl)", 3);
}

TEST_F(Learning, HardFormulaThatTheEvidenceAloneBreaksIsNamed) {
  scratch.write("hard.mln", std::string(kKitchen) + "!(shape(c, Box) ^ shape(c, Round)).\n");
  scratch.write("broken.db", "shape(C1,Box)\nshape(C1,Round)\nobject(C1,Cereal)\n");
  for (const std::string method : {"pll", "cll --discriminative object"}) {
    const Outcome outcome = run("learn -m hard.mln -t broken.db -o out.mln --method " + method);
    EXPECT_EQ(outcome.code, 3);
    EXPECT_THAT(outcome.err, AllOf(HasSubstr("hard.mln:7"), HasSubstr("shape(C1,Box)"), HasSubstr("shape(C1,Round)")));
    EXPECT_FALSE(scratch.exists("out.mln"));
  }
}

TEST_F(Learning, BadPriorsAreNamed) {
  const std::string command = "learn -m m.mln -t t.db -o out.mln ";
  for (const std::string stdev : {"0", "-1", "nan"}) {
    expect_refused(command + "--prior-stdev=" + stdev, "standard deviation is " + stdev);
    expect_refused(command + "--formula-stdev 1=" + stdev, "standard deviation is " + stdev);
    expect_refused("xval -m m.mln -t t.db -q object --prior-stdev=" + stdev, "standard deviation is " + stdev);
  }
  expect_refused(command + "--prior-stdev wide", "'wide' is neither a number nor 'inf'");
  expect_refused(command + "--prior-mean inf", "mean is inf");
  expect_refused(command + "--prior-l1=-1", "rate is -1");
  expect_refused(command + "--formula-stdev 3=1", "names no soft formula");
  expect_refused(command + "--formula-stdev 1", "NUMBER=STDEV");
  expect_refused("xval -m m.mln -t t.db -q object --tune 1=0,1", "standard deviation above 0");
}

TEST_F(Learning, WrongUsageSaysWhatIsPossible) {
  const std::string command = "learn -m m.mln -t t.db -o out.mln ";
  expect_refused(command + "--method plll", "there are pll, bpll, dpll, cll, ll, mcsat");
  expect_refused("xval -m m.mln -t t.db -q object --method plll", "there are pll, bpll, dpll, cll, ll, mcsat");
  expect_refused(command + "--method cll", "needs --discriminative");
  expect_refused(command + "--discriminative object", "no use for --discriminative");
  expect_refused(command + "--method cll --discriminative objekt", "did you mean 'object'?");
  expect_refused(command + "--block object", "no use for --block");
  expect_refused(command + "--max-iterations 0", "--max-iterations: 0 is less than 1");
  expect_refused(command + "--max-iterations 4294967295", "is more than");
  expect_refused(command + "--tolerance 0", "--tolerance: 0 is not above 0");
  expect_refused(command + "--method mcsat --discriminative object --samples 0", "--samples");
  expect_refused("learn -m - -t - -o out.mln", "standard input ('-') can be read only once");
  expect_refused("learn -m m.mln -t - -t - -o out.mln", "standard input ('-') can be read only once");
  expect_refused("xval -m m.mln -t - --fold-file - -q object", "standard input ('-') can be read only once");
  expect_refused("learn -m m.mln -t missing.db -o out.mln", "missing.db");
  expect_refused("learn -m m.mln -t t.db", "--output");
  scratch.write("soft.mln", "object(cluster, kind!)\nobject(c, A) v !object(c, A).\n");
  scratch.write("soft.db", "object(C1, A)\nobject(C2, B)\n");
  // Nothing to learn is no error; the model is written as it is.
  const Outcome nothing = run("learn -m soft.mln -t soft.db -o out.mln");
  EXPECT_EQ(nothing.code, 0);
  EXPECT_THAT(nothing.err, HasSubstr("there is no weight to learn"));
  EXPECT_THAT(nothing.out, HasSubstr("0 weights"));
  EXPECT_THAT(scratch.read("out.mln"), HasSubstr("object(c, A) v !object(c, A)."));
}

TEST_F(Learning, OutputsAreCheckedBeforeTheWork) {
  scratch.shell("mkdir folder");
  // The model is not even looked for.
  for (const std::string path : {"no/such/folder/out.mln", "folder", "folder/", "''"}) {
    const Outcome outcome = run("learn -m missing.mln -t missing.db -o " + path);
    EXPECT_EQ(outcome.code, 2) << path;
    EXPECT_THAT(outcome.err, Not(HasSubstr("missing"))) << path;
    for (const char* option : {"--csv", "--latex", "--svg", "--html", "--predictions", "--json"}) {
      if (path == "''" && std::string(option) != "--json") continue;
      const Outcome folds = run("xval -m missing.mln -t missing.db -q object " + std::string(option) + " " + path);
      EXPECT_EQ(folds.code, 2) << option << " " << path;
      EXPECT_THAT(folds.err, Not(HasSubstr("missing"))) << option << " " << path;
    }
  }
  expect_refused("learn -m m.mln -t t.db -o - --json -", "two results cannot both go to standard output");
}

TEST_F(Learning, FailedRunLeavesTheOldFileAlone) {
  scratch.write("old.mln", "// old\n");
  const std::size_t files = scratch.file_count();
  scratch.write("t.db", "object(C1,Cereal)\nobject(C1,Bowl)\n");
  EXPECT_EQ(run("learn -m m.mln -t t.db -o old.mln").code, 2);
  EXPECT_EQ(scratch.read("old.mln"), "// old\n");
  EXPECT_EQ(scratch.file_count(), files);
}

TEST_F(Learning, FullDiskLeavesTheOldFileAlone) {
  scratch.write("old.mln", "// old\n");
  std::string wide = std::string(kKitchen) + "kind = {";
  for (int i = 0; i < 400; ++i) wide += (i > 0 ? ", K" : "K") + std::to_string(i);
  scratch.write("wide.mln", wide + "}\n");
  const std::size_t files = scratch.file_count();
  const Outcome outcome = scratch.shell("ulimit -f 8; \"$S\" learn -m wide.mln -t t.db -o old.mln --quiet");
  EXPECT_EQ(outcome.code, 1) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("cannot write 'old.mln'"));
  EXPECT_EQ(scratch.read("old.mln"), "// old\n");
  EXPECT_EQ(scratch.file_count(), files);
  const Outcome full = run("learn -m coin.mln -t coin.db -o /dev/full");
  EXPECT_EQ(full.code, 1);
  EXPECT_THAT(full.err, HasSubstr("cannot write '/dev/full'"));
}

TEST_F(Learning, KilledRunLeavesTheOldFileAlone) {
  write_long_work();
  scratch.write("out.mln", "// old\n");
  const std::size_t files = scratch.file_count();
  const Outcome outcome = scratch.shell("\"$S\" " + long_work + " & p=$!; sleep 1; kill -KILL $p; wait $p");
  EXPECT_EQ(outcome.code, 128 + 9);
  EXPECT_EQ(scratch.read("out.mln"), "// old\n");
  EXPECT_EQ(scratch.file_count(), files);
}

TEST_F(Learning, InterruptAndTimeLimitHandOverTheWeightsSoFar) {
  write_long_work();
  const Outcome interrupted =
      scratch.shell("\"$S\" " + long_work + " --json json & p=$!; sleep 2; kill -INT $p; wait $p");
  EXPECT_EQ(interrupted.code, 130) << interrupted.err;
  EXPECT_EQ(Json::parse(scratch.read("json"))["termination"], "interrupted");
  const Outcome limited = run(long_work + " --max-seconds 1 --json json");
  EXPECT_EQ(limited.code, 4) << limited.err;
  EXPECT_THAT(limited.err, HasSubstr("the weights are the best so far"));
  const Json result = Json::parse(scratch.read("json"));
  EXPECT_EQ(result["termination"], "time_limit");
  EXPECT_EQ(result["converged"], false);
  EXPECT_EQ(result["weights"].size(), 2u);
  EXPECT_EQ(run("check -m out.mln -e long.db").code, 0);
  EXPECT_THAT(scratch.read("out.mln"), HasSubstr("not converged"));
}

TEST_F(Learning, InterruptBeforeTheFirstWeightWritesNothing) {
  write_long_work();
  const Outcome outcome = run("learn -m long.mln -t long.db -o out.mln --max-seconds 0 --json -");
  EXPECT_EQ(outcome.code, 4) << outcome.err;
  EXPECT_EQ(Json::parse(outcome.out)["termination"], "time_limit");
  EXPECT_FALSE(scratch.exists("out.mln"));
}

TEST_F(Learning, TooWideForExactSumsSaysWhatElseThereIs) {
  write_long_work();
  expect_refused("learn -m long.mln -t long.db -o out.mln --method cll --discriminative Smokes", "mcsat", 4);
}

// --- xval

constexpr const char* kXval = "xval -m m.mln -t t.db -q object ";

TEST_F(Learning, XvalDocumentIsTheContracts) {
  const Json result = json(std::string(kXval) + "--folds 2 --seed 4");
  EXPECT_EQ(result["schema"], "sherlog.xval/1");
  EXPECT_EQ(result["termination"], "completed");
  EXPECT_EQ(result["examples"], 6);
  for (const char* part :
       {"accuracy", "macro_precision", "macro_recall", "macro_f1", "log_loss", "calibration_error"}) {
    EXPECT_TRUE(result[part].is_number()) << part;
  }
  EXPECT_EQ(result["confusion"]["labels"], Json({"Cereal", "Bowl", "Pot"}));
  double right = 0, all = 0;
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t j = 0; j < 3; ++j) all += result["confusion"]["counts"][i][j].get<double>();
    right += result["confusion"]["counts"][i][i].get<double>();
  }
  EXPECT_EQ(all, 6);
  EXPECT_NEAR(result["accuracy"].get<double>(), right / 6, 1e-12);
  ASSERT_EQ(result["folds"].size(), 2u);
  double examples = 0, correct = 0;
  for (const Json& fold : result["folds"]) {
    for (const char* part : {"train_seconds", "test_seconds", "accuracy"}) EXPECT_TRUE(fold[part].is_number()) << part;
    EXPECT_EQ(fold["databases"], 2);
    examples += fold["examples"].get<double>();
    correct += fold["accuracy"].get<double>() * fold["examples"].get<double>();
  }
  EXPECT_EQ(examples, 6);
  EXPECT_NEAR(correct, right, 1e-9);
}

// Fold 1 has nothing but cups, fold 2 nothing but bowls: each is taken for what the other taught.
TEST_F(Learning, ConfusionIsPredictedByTrue) {
  scratch.write("prior.mln", "object(cluster, kind!)\n0 object(c, +o)\n");
  scratch.write("cups.db", "object(C1,Cup)\n---\nobject(C1,Cup)\nobject(C2,Cup)\n---\nobject(C1,Bowl)\n");
  scratch.write("folds", "1\n1\n2\n");
  const Outcome outcome = run("xval -m prior.mln -t cups.db -q object --fold-file folds --json -");
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("2 labels are in one fold only"));
  EXPECT_THAT(outcome.err, HasSubstr("Cup, Bowl"));
  const Json result = Json::parse(outcome.out);
  EXPECT_EQ(result["confusion"]["labels"], Json({"Cup", "Bowl"}));
  EXPECT_EQ(result["confusion"]["counts"], Json({{0, 1}, {3, 0}}));
  EXPECT_EQ(result["accuracy"], 0.0);
  EXPECT_GT(result["log_loss"], std::log(2));
  EXPECT_LT(result["log_loss"], 34.0);  // never seen is not impossible
  EXPECT_EQ(result["folds"][0]["examples"], 3);
}

TEST_F(Learning, FoldsAreTheSeedsOrTheFiles) {
  const auto without_times = [&](const std::string& arguments) {
    Json result = json(std::string(kXval) + arguments);
    result.erase("seconds");
    for (Json& fold : result["folds"]) fold.erase("train_seconds"), fold.erase("test_seconds");
    return result;
  };
  EXPECT_EQ(without_times("--folds 2 --seed 7 --threads 1"), without_times("--folds 2 --seed 7 --threads 3"));
  scratch.write("leave-one-out", "1 2 3 4\n");
  Json dealt = without_times("--folds 4"), given = without_times("--fold-file leave-one-out");
  dealt.erase("folds"), given.erase("folds");  // their order is the seed's
  for (const char* part : {"accuracy", "log_loss"}) {
    EXPECT_NEAR(dealt[part].get<double>(), given[part].get<double>(), 1e-12) << part;
  }
  EXPECT_EQ(dealt["confusion"], given["confusion"]);
}

TEST_F(Learning, BadFoldsAreNamed) {
  expect_refused(std::string(kXval) + "--folds 5", "5 folds cannot be made of 4 databases");
  expect_refused(std::string(kXval) + "--folds 1", "--folds: 1 is less than 2");
  expect_refused(std::string(kXval) + "--folds 0", "--folds: 0 is less than 2");
  const std::pair<const char*, const char*> files[] = {
      {"1 1 3 3", "fold 2 has no database"},
      {"1 2", "the fold file has 2 entries, there are 4 databases"},
      {"1 1 2 2 2", "the fold file has 5 entries, there are 4 databases"},
      {"1 1 1 1", "names one fold only"},
      {"", "names no fold"},
      {"0 1 1 2", "'0' is not the number of a fold"},
      {"1 1 two 2", "'two' is not the number of a fold"},
      {"1 1 2 99999999999", "'99999999999' is not the number of a fold"},
      {"1 1 2 4294967295", "fold 3 has no database"},
  };
  for (const auto& [text, message] : files) {
    scratch.write("folds", text);
    expect_refused(std::string(kXval) + "--fold-file folds", message);
  }
  expect_refused(std::string(kXval) + "--fold-file missing", "--fold-file: 'missing' cannot be read");
}

TEST_F(Learning, XvalWantsOnePredicate) {
  expect_refused("xval -m m.mln -t t.db", "--query");
  expect_refused("xval -m m.mln -t t.db -q object -q shape", "the one predicate");
  expect_refused("xval -m m.mln -t t.db -q objects", "did you mean 'object'?");
  expect_refused("xval -m m.mln -t t.db -q object --discriminative shape", "--discriminative");
  scratch.write("unused.mln", std::string(kKitchen) + "spare(cluster)\n");
  expect_refused("xval -m unused.mln -t t.db -q spare --folds 2", "no formula mentions 'spare'");
}

TEST_F(Learning, XvalWritesEveryReport) {
  ASSERT_EQ(run(std::string(kXval) + "--folds 2 --csv c.csv --latex c.tex --svg c.svg --html c.html "
                                     "--predictions p.csv")
                .code,
            0);
  EXPECT_THAT(scratch.read("c.csv"), HasSubstr("Cereal,Bowl,Pot"));
  EXPECT_THAT(scratch.read("c.tex"), HasSubstr("\\begin{tabular}"));
  EXPECT_THAT(scratch.read("c.svg"), HasSubstr("<svg"));
  EXPECT_THAT(scratch.read("c.html"), HasSubstr("<html"));
  const std::string predictions = scratch.read("p.csv");
  EXPECT_EQ(std::count(predictions.begin(), predictions.end(), '\n'), 7);  // a header and six objects
}

TEST_F(Learning, XvalInterruptedHandsOverTheFoldsSoFar) {
  write_long_work();
  std::string many;
  for (int i = 0; i < 6; ++i) many += (i > 0 ? "---\n" : "") + scratch.read("long.db");
  scratch.write("many.db", many);
  const Outcome outcome =
      run("xval -m long.mln -t many.db -q Smokes --folds 2 --method mcsat --max-seconds 1 --json -");
  EXPECT_EQ(outcome.code, 4) << outcome.err;
  const Json result = Json::parse(outcome.out);
  EXPECT_EQ(result["termination"], "time_limit");
  EXPECT_LT(result["folds"].size(), 2u);
}

TEST_F(Learning, ConstantsThatLookLikeVariablesComeBackAsConstants) {
  scratch.write("pizza.mln",
                "Likes(p, thing)\nHappy(p)\n0 Likes(x, \"pizza\") => Happy(x)\n0 Happy(x)\n"
                "!Likes(x, \"rain\") v !Happy(x).\n");
  scratch.write("pizza.db",
                "Likes(Anna,pizza)\nHappy(Anna)\nLikes(Bob,rain)\nLikes(Cid,pizza)\nHappy(Cid)\nLikes(Dee,snow)\n");
  const Outcome first = scratch.sherlog(
      "learn -m pizza.mln -t pizza.db --method dpll --discriminative Happy -o learned.mln --json first.json");
  ASSERT_EQ(first.code, 0) << first.err;
  const std::string text = scratch.read("learned.mln");
  EXPECT_THAT(text, HasSubstr("Likes(x, \"pizza\")"));
  EXPECT_THAT(text, HasSubstr("\"rain\""));
  // Learned again from there, nothing changes: the same objective at the same weights.
  const Outcome again = scratch.sherlog(
      "learn -m learned.mln -t pizza.db --method dpll --discriminative Happy -o again.mln --json again.json");
  ASSERT_EQ(again.code, 0) << again.err;
  EXPECT_NEAR(Json::parse(scratch.read("first.json"))["objective_with_prior"].get<double>(),
              Json::parse(scratch.read("again.json"))["objective_with_prior"].get<double>(), 1e-6);
  EXPECT_EQ(scratch.sherlog("infer -m learned.mln -e pizza.db -q Happy").code, 0);
}

TEST_F(Learning, TemplatesThatCompareTheirConstantsComeBack) {
  scratch.write("near.mln",
                "obj = {Cup, Bowl, Box}\nobject(o, obj!)\nnear(o, o)\n"
                "near(c, d) ^ object(c, +a) ^ object(d, +b) ^ a != b\n"
                "object(c, +a) ^ (a = Cup v near(c, c))\n");
  scratch.write("near.db", "object(A,Cup)\nobject(B,Bowl)\nobject(C,Box)\nnear(A,B)\nnear(B,C)\nnear(C,C)\n");
  const Outcome learned =
      scratch.sherlog("learn -m near.mln -t near.db --method cll --discriminative object -o learned.mln --json a.json");
  ASSERT_EQ(learned.code, 0) << learned.err;
  const std::string text = scratch.read("learned.mln");
  EXPECT_THAT(text, HasSubstr("near(c, d) ^ object(c, Cup) ^ object(d, Bowl)\n"));
  EXPECT_THAT(text, Not(HasSubstr("object(c, Cup) ^ object(d, Cup)")));  // never true
  const Outcome again = scratch.sherlog(
      "learn -m learned.mln -t near.db --method cll --discriminative object -o again.mln --json b.json");
  ASSERT_EQ(again.code, 0) << again.err;
  EXPECT_NEAR(Json::parse(scratch.read("a.json"))["objective"].get<double>(),
              Json::parse(scratch.read("b.json"))["objective"].get<double>(), 1e-6);
}

TEST_F(Learning, ErrorsOfNoWeightAreNoTrouble) {
  scratch.write("fixed.mln", "P(a)\n#fixweight\n1 P(x)\n");
  scratch.write("fixed.db", "P(A)\na = {A, B}\n");
  for (const char* arguments : {"-m fixed.mln -t fixed.db", "-m fixed.mln -t fixed.db --prior-l1 1e3"}) {
    EXPECT_EQ(scratch.sherlog(std::string("learn -o out.mln --standard-errors ") + arguments).code, 0) << arguments;
    EXPECT_TRUE(scratch.exists("out.mln"));
  }
}

TEST_F(Learning, NothingThatIsReadIsOverwritten) {
  scratch.write("p.mln", "P(a)\n1 P(x)\n");
  scratch.write("p.db", "P(A)\n");
  for (const char* arguments :
       {"learn -m p.mln -t p.db -o p.db", "learn -m p.mln -t p.db -o ./p.mln",
        "learn -m p.mln -t p.db -o o.mln --json o.mln", "infer -m p.mln -e p.db -q P --json p.db"}) {
    const Outcome outcome = scratch.sherlog(arguments);
    EXPECT_EQ(outcome.code, 2) << arguments;
    EXPECT_THAT(outcome.err, HasSubstr(".")) << arguments;
  }
  EXPECT_EQ(scratch.read("p.db"), "P(A)\n");
  EXPECT_EQ(scratch.read("p.mln"), "P(a)\n1 P(x)\n");
}

TEST_F(Learning, ACountThatNeverChangesIsNamedByEveryMethod) {
  scratch.write("count.mln", "is(o, cls!)\nBig(o)\n0 is(o, c)\n0 is(o, Cat) ^ Big(o)\n");
  scratch.write("count.db", "is(A,Cat)\nis(B,Dog)\nis(C,Cat)\nBig(A)\ncls = {Cat, Dog}\n");
  for (const char* method : {"pll", "dpll --discriminative is", "cll --discriminative is", "ll"}) {
    const Outcome outcome =
        scratch.sherlog(std::string("learn -m count.mln -t count.db -o c.mln --json c.json --method ") + method);
    ASSERT_EQ(outcome.code, 0) << outcome.err;
    const Json weights = Json::parse(scratch.read("c.json"))["weights"];
    ASSERT_EQ(weights.size(), 2u);
    EXPECT_EQ(weights[0].value("identified", true), false) << method;
    EXPECT_EQ(weights[1].value("identified", true), true) << method;
  }
}

TEST_F(Learning, ClosedPredicatesAreGiven) {
  scratch.write("closed.mln", "*Q(a)\nP(a)\n0 P(x)\n0 Q(x) => P(x)\n0 Q(x)\n");
  scratch.write("closed.db", "P(A)\nQ(A)\nQ(B)\na = {A, B, C}\n");
  for (const char* method : {"pll", "ll"}) {
    const Outcome outcome =
        scratch.sherlog(std::string("learn -m closed.mln -t closed.db -o c.mln --json c.json --method ") + method);
    ASSERT_EQ(outcome.code, 0) << outcome.err;
    EXPECT_EQ(Json::parse(scratch.read("c.json"))["weights"][2].value("identified", true), false) << method;
  }
}

TEST_F(Learning, TimeThatEndsTheSearchIsNoOptimum) {
  const Outcome outcome = scratch.sherlog("scenes generate --scenes 60 -o s.db");
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const std::string model = std::string(SHERLOG_SOURCE_DIR) + "/models/information_fusion/experiment/extended.mln";
  const Outcome cut =
      scratch.sherlog("learn -m " + model +
                      " -t s.db --method pll --prior-stdev 1000 --tolerance 1e-12 --max-iterations 1000000 "
                      "--max-seconds 1.5 -o w.mln --json w.json");
  ASSERT_EQ(cut.code, 4) << cut.err;
  const Json json = Json::parse(scratch.read("w.json"));
  EXPECT_EQ(json["termination"], "time_limit");
  EXPECT_EQ(json["converged"], false);
}

}  // namespace
}  // namespace sherlog::e2e
