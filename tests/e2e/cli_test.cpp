// The command line as a user meets it: results, exit codes, files.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <string>

#include "tests/e2e/program.h"

namespace sherlog::e2e {
namespace {

using nlohmann::json;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

constexpr const char* kSmokers =
    "Smokes(person)\nCancer(person)\nFriends(person,person)\n"
    "1.5 Smokes(x) => Cancer(x)\n1.1 Friends(x,y) => (Smokes(x) <=> Smokes(y))\n";
constexpr const char* kFriends = "Friends(Anna,Bob)\nSmokes(Anna)\n";

class Cli : public testing::Test {
 protected:
  void SetUp() override {
    scratch.write("m.mln", kSmokers);
    scratch.write("e.db", kFriends);
    scratch.write("coin.mln", "Heads(coin)\nlog(3) Heads(x)\n");
    scratch.write("coin.db", "coin = {Penny}\n");
  }
  Outcome run(const std::string& arguments) const { return scratch.sherlog(arguments); }
  json infer(const std::string& arguments) const {
    const Outcome outcome = run("infer --json - " + arguments);
    EXPECT_EQ(outcome.code, 0) << outcome.err;
    return json::parse(outcome.out);
  }
  Scratch scratch;
};

TEST_F(Cli, HelpAndVersionAreResults) {
  EXPECT_EQ(run("--version").out, "sherlog 0.1.0\n");
  for (const char* command : {"", "check ", "ground ", "infer ", "explain ", "convert "}) {
    const Outcome outcome = run(std::string(command) + "--help");
    EXPECT_EQ(outcome.code, 0) << command;
    EXPECT_THAT(outcome.out, HasSubstr("--help"));
    EXPECT_THAT(outcome.err, IsEmpty());
  }
}

TEST_F(Cli, WrongUsageIsExit2AndSaysWhereHelpIs) {
  for (const char* arguments : {"",
                                "nonsense",
                                "infer",
                                "infer -m",
                                "infer -m m.mln --nonsense",
                                "infer -m m.mln -q Smokes --method nonsense",
                                "infer -m m.mln",
                                "infer -m m.mln -q Smokes --samples=-3",
                                "infer -m m.mln -q Smokes --max-memory 3X",
                                "infer -m m.mln -q Smokes --max-seconds=-1",
                                "infer -m m.mln -q Smokes --max-seconds=nan",
                                "infer -m m.mln -q Smokes --soft-evidence both",
                                "infer -m m.mln -q Smokes --chains 0",
                                "infer -m m.mln -q Smokes --samples 99999999999",
                                "infer -m m.mln -q Smokes --seed 18446744073709551616",
                                "explain -m m.mln 'Smokes(Anna)' --top=-1",
                                "--seed 3 infer -m m.mln -q Smokes",
                                "infer -m m.mln -q Smokes --json ''",
                                "infer -m - -e - -q Smokes",
                                "infer -m m.mln -q Smokes --json no/such/folder/x.json",
                                "infer -m m.mln -q Smokes --open-world=Smoke",
                                "ground -m m.mln --export nonsense",
                                "ground -m m.mln -o x",
                                "explain -m m.mln",
                                "convert -m m.mln --to nonsense",
                                "ground -m m.mln --export dot --json -"}) {
    const Outcome outcome = run(arguments);
    EXPECT_EQ(outcome.code, 2) << arguments << "\n" << outcome.err;
    EXPECT_THAT(outcome.out, IsEmpty()) << arguments;
    EXPECT_THAT(outcome.err, HasSubstr("error: ")) << arguments;
  }
}

TEST_F(Cli, InferAnswersAsJson) {
  const json result = infer("-m coin.mln -e coin.db -q Heads");
  EXPECT_EQ(result["schema"], "sherlog.infer/1");
  EXPECT_EQ(result["termination"], "completed");
  EXPECT_EQ(result["method"], "exact");
  EXPECT_EQ(result["network"]["atoms"], 1);
  ASSERT_EQ(result["marginals"].size(), 1u);
  EXPECT_EQ(result["marginals"][0]["atom"], "Heads(Penny)");
  EXPECT_NEAR(result["marginals"][0]["probability"], 0.75, 1e-12);         // odds e^log(3) = 3 to 1
  EXPECT_NEAR(result["log_partition"].get<double>(), std::log(4), 1e-12);  // e^log(3) + 1
  EXPECT_FALSE(result["marginals"][0].contains("mcse"));
  for (const char* part : {"parse", "ground", "infer", "total"}) EXPECT_TRUE(result["seconds"].contains(part));
}

TEST_F(Cli, InferPrintsATable) {
  const Outcome outcome = run("infer -m coin.mln -e coin.db -q Heads");
  EXPECT_EQ(outcome.code, 0);
  EXPECT_THAT(outcome.out, HasSubstr("Heads(Penny)     0.750000\n"));
  EXPECT_THAT(outcome.err, IsEmpty());
}

TEST_F(Cli, SamplingReportsItsErrorBars) {
  const json result = infer("-m coin.mln -e coin.db -q Heads --method mcsat --samples 4000 --seed 3");
  const json& marginal = result["marginals"][0];
  EXPECT_NEAR(marginal["probability"], 0.75, 0.05);
  for (const char* part : {"mcse", "ess", "rhat"}) EXPECT_TRUE(marginal.contains(part)) << part;
  EXPECT_TRUE(result["diagnostics"].contains("converged"));
}

TEST_F(Cli, SameSeedSameAnswerWhateverTheThreads) {
  const std::string arguments = "-m m.mln -e e.db -q Smokes,Cancer --method mcsat --samples 2000 --seed 5";
  EXPECT_EQ(infer(arguments + " --threads 1")["marginals"], infer(arguments + " --threads 3")["marginals"]);
}

TEST_F(Cli, MapNamesTheTrueAtoms) {
  const json result = infer("-m m.mln -e e.db -q Smokes,Cancer --method map");
  EXPECT_TRUE(result["map"]["optimal"]);
  EXPECT_EQ(result["map"]["gap"], 0.0);
  // All groundings hold: 2 of Smokes => Cancer, 4 of Friends(x,y) => ...: 2 * 1.5 + 4 * 1.1
  EXPECT_NEAR(result["map"]["log_score"], 7.4, 1e-9);
  EXPECT_FALSE(result.contains("marginals"));
  const Outcome text = run("infer -m m.mln -e e.db -q Smokes,Cancer --method map");
  EXPECT_THAT(text.out, HasSubstr("log score 7.400000 (proved optimal)"));
}

TEST_F(Cli, QueriesRepeatAndSplitAtCommasOutsideBrackets) {
  EXPECT_EQ(infer("-m m.mln -e e.db -q 'Smokes(Bob),Cancer(Anna)' -q 'Cancer(Bob)'")["marginals"].size(), 3u);
  EXPECT_EQ(infer("-m m.mln -e e.db -q 'Smokes(Bob) ^ Cancer(Bob), Smokes, Cancer'")["marginals"][0].count("formula"),
            1u);
}

TEST_F(Cli, ModelAndEvidenceComeFromStandardInput) {
  const Outcome model = scratch.shell("\"$S\" infer -m - -e coin.db -q Heads --json - < coin.mln");
  ASSERT_EQ(model.code, 0) << model.err;
  const Outcome evidence = scratch.shell("\"$S\" infer -m coin.mln -e - -q Heads --json - < coin.db");
  ASSERT_EQ(evidence.code, 0) << evidence.err;
  EXPECT_EQ(json::parse(model.out)["marginals"], json::parse(evidence.out)["marginals"]);
}

TEST_F(Cli, OpenWorldTakesItsValueByEqualSignOnly) {
  const json closed = infer("-m m.mln -e e.db -q 'Cancer(Bob)'");
  const json all = infer("-m m.mln -e e.db --open-world -q 'Cancer(Bob)'");
  const json one = infer("-m m.mln -e e.db --open-world=Smokes -q 'Cancer(Bob)'");
  EXPECT_EQ(closed["network"]["atoms"], 2);  // a queried predicate is open for all its atoms
  EXPECT_GT(one["network"]["atoms"], closed["network"]["atoms"]);
  EXPECT_GT(all["network"]["atoms"], one["network"]["atoms"]);
}

TEST_F(Cli, SeveralDatabasesAreAnsweredInOrder) {
  scratch.write("two.db", "coin = {Penny}\n---\ncoin = {Dime, Nickel}\n");
  const json result = infer("-m coin.mln -e two.db -q Heads");
  EXPECT_EQ(result["schema"], "sherlog.infer/1");
  ASSERT_EQ(result["databases"].size(), 2u);
  EXPECT_EQ(result["databases"][0]["marginals"].size(), 1u);
  EXPECT_EQ(result["databases"][1]["marginals"][1]["atom"], "Heads(Nickel)");
}

TEST_F(Cli, ConstantThatOneDatabaseLacksIsAnsweredInTheOthers) {
  scratch.write("two.db", "coin = {Penny}\n---\ncoin = {Penny, Nickel}\n");
  const Outcome outcome = run("infer -m coin.mln -e two.db -q 'Heads(Nickel)' --json -");
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("warning: 'Nickel' is no constant of domain 'coin' in database 1"));
  const json result = json::parse(outcome.out);
  EXPECT_EQ(result["databases"][0]["marginals"].size(), 0u);
  EXPECT_EQ(result["databases"][1]["marginals"].size(), 1u);
  // The predicate is asked about, so it is open everywhere: one coin with odds of 3 to 1, or two.
  EXPECT_NEAR(result["databases"][0]["log_partition"].get<double>(), std::log(4), 1e-12);
  EXPECT_NEAR(result["databases"][1]["log_partition"].get<double>(), std::log(16), 1e-12);
  EXPECT_EQ(run("ground -m coin.mln -e two.db -q 'Heads(Nickel)'").code, 0);
  EXPECT_EQ(run("infer -m coin.mln -e two.db -q 'Heads(Dime)'").code, 2);
}

// The limit ends the run while the text is read, while it is grounded, or later: there is a document in each case.
TEST_F(Cli, MemoryLimitIsReportedInTheDocument) {
  std::string grid = "Lit(cell)\nNext(cell,cell)\n0.8 Next(x,y) => (Lit(x) <=> Lit(y))\n";
  std::string cells;
  for (int i = 0; i < 30; ++i) {
    for (int j = 0; j < 30; ++j) {
      cells += "Next(C" + std::to_string(i) + "_" + std::to_string(j) + ",C" + std::to_string(i + 1) + "_" +
               std::to_string(j) + ")\n";
      cells += "Next(C" + std::to_string(i) + "_" + std::to_string(j) + ",C" + std::to_string(i) + "_" +
               std::to_string(j + 1) + ")\n";
    }
  }
  scratch.write("grid.mln", grid);
  scratch.write("grid.db", cells);
  std::string long_text;
  for (int i = 0; i < 400000; ++i) long_text += "Next(A" + std::to_string(i) + ",B)\n";
  scratch.write("long.db", long_text);
  for (const char* command :
       {"infer -q Lit --method mcsat", "infer -q Lit --method map", "ground -q Lit", "explain 'Lit(C3_3)'"}) {
    const Outcome outcome = run(std::string(command) + " -m grid.mln -e grid.db --max-memory 1M --json -");
    EXPECT_EQ(outcome.code, 4) << command << outcome.err;
    EXPECT_EQ(json::parse(outcome.out)["termination"], "memory_limit") << command;
    const Outcome text = run(std::string(command) + " -m grid.mln -e grid.db --max-memory 1M");
    EXPECT_EQ(text.code, 4) << command;
    EXPECT_THAT(text.err, HasSubstr("error: ")) << command;
  }
  for (const char* command : {"infer -q Lit --method mcsat", "ground", "explain 'Lit(B)'", "check"}) {
    const Outcome outcome = run(std::string(command) + " -m grid.mln -e long.db --max-memory 1M --json -");
    EXPECT_EQ(outcome.code, 4) << command << outcome.err;
    EXPECT_EQ(json::parse(outcome.out)["termination"], "memory_limit") << command;
    if (std::string(command).starts_with("infer")) {
      EXPECT_EQ(json::parse(outcome.out)["method"], "mcsat");
    }
  }
}

TEST_F(Cli, MethodIsNamedWhereGroundingAlreadyEnds) {
  scratch.write("hard.mln", "coin = {Penny}\nHeads(coin)\nHeads(x).\n");
  scratch.write("hard.db", "!Heads(Penny)\n");
  const Outcome outcome = run("infer -m hard.mln -e hard.db -q Heads --method map --json -");
  EXPECT_EQ(outcome.code, 3) << outcome.err;
  EXPECT_EQ(json::parse(outcome.out)["method"], "map");
}

TEST_F(Cli, ExactlyTheSamplesThatWereAskedForAreKept) {
  for (const char* samples : {"1", "3", "10", "4001"}) {
    const json result =
        infer("-m coin.mln -e coin.db -q Heads --method mcsat --chains 4 --samples " + std::string(samples));
    EXPECT_EQ(result["samples"].dump(), samples);
  }
  const json few = infer("-m coin.mln -e coin.db -q Heads --method mcsat --samples 4");
  EXPECT_FALSE(few["diagnostics"].contains("rhat_max")) << "one draw a chain tells nothing";
  EXPECT_FALSE(few["diagnostics"].contains("ess_min"));
  EXPECT_FALSE(few["diagnostics"]["converged"]);
}

TEST_F(Cli, WeightsThatAddUpToNoNumberAreRefused) {
  // Each atom's own weight is a number, and so is every marginal; log Z is none.
  scratch.write("huge.mln", "coin = {Penny, Nickel}\nHeads(coin)\n1e308 Heads(x)\n");
  for (const char* method : {"exact", "mcsat", "gibbs", "map"}) {
    const Outcome outcome = run("infer -m huge.mln -q Heads --method " + std::string(method));
    EXPECT_EQ(outcome.code, 2) << method;
    EXPECT_THAT(outcome.err, HasSubstr("add up to more than a number can hold")) << method;
  }
  for (const char* format : {"wcnf", "uai"}) {
    EXPECT_EQ(run("ground -m huge.mln -q Heads --export " + std::string(format)).code, 2) << format;
  }
  scratch.write("large.mln", "coin = {Penny}\nHeads(coin)\n1e300 Heads(x)\n");
  EXPECT_THAT(run("infer -m large.mln -q Heads --method exact").out, HasSubstr("log partition function 1e+300\n"));
}

TEST_F(Cli, UnknownCommandSuggests) {
  const Outcome near = run("infr -m m.mln");
  EXPECT_EQ(near.code, 2);
  EXPECT_THAT(near.err, HasSubstr("there is no command 'infr'; did you mean 'infer'?"));
  EXPECT_THAT(run("bogus").err, HasSubstr("the commands are check, ground, infer"));
}

TEST_F(Cli, NoEvidenceIsGoodEvidence) {
  scratch.write("known.mln", "coin = {Penny}\nHeads(coin)\nlog(3) Heads(x)\n");
  scratch.write("empty.db", "");
  EXPECT_EQ(infer("-m known.mln -q Heads")["marginals"], infer("-m known.mln -e empty.db -q Heads")["marginals"]);
}

TEST_F(Cli, ModelWithoutFormulasIsAnswered) {
  scratch.write("bare.mln", "coin = {Penny}\nHeads(coin)\n");
  const json result = infer("-m bare.mln -q Heads");
  EXPECT_NEAR(result["marginals"][0]["probability"], 0.5, 1e-12);
  EXPECT_NEAR(result["log_partition"].get<double>(), std::log(2), 1e-12);
}

TEST_F(Cli, ImpossibleWorldIsExit3AndNamesTheConflict) {
  scratch.write("hard.mln", "coin = {Penny}\nHeads(coin)\nTails(coin)\nHeads(x).\n!Heads(x) v Tails(x).\n!Tails(x).\n");
  const Outcome outcome = run("infer -m hard.mln -q Heads,Tails --json out.json");
  EXPECT_EQ(outcome.code, 3);
  EXPECT_THAT(outcome.err, HasSubstr("hard.mln:4:"));
  EXPECT_THAT(outcome.err, HasSubstr("hard.mln:5:"));
  EXPECT_THAT(outcome.err, HasSubstr("hard.mln:6:"));
  const json result = json::parse(scratch.read("out.json"));
  EXPECT_EQ(result["termination"], "no_possible_world");
  EXPECT_EQ(result["conflict"].size(), 3u);
  EXPECT_EQ(result["conflict"][0]["file"], "hard.mln");
  EXPECT_FALSE(result.contains("marginals"));
}

TEST_F(Cli, EvidenceInAConflictIsNamedWithItsLine) {
  scratch.write("hard.mln",
                "coin = {Penny}\nHeads(coin)\nFair(coin)\nBent(coin)\n"
                "Fair(x) => Heads(x).\nBent(x) => !Heads(x).\n");
  scratch.write("hard.db", "Fair(Penny)\nBent(Penny)\n");
  const Outcome outcome = run("infer -m hard.mln -e hard.db -q Heads");
  EXPECT_EQ(outcome.code, 3);
  EXPECT_THAT(outcome.err, HasSubstr("hard.db:1:"));
  EXPECT_THAT(outcome.err, HasSubstr("hard.db:2:"));
  EXPECT_THAT(outcome.out, IsEmpty());
}

TEST_F(Cli, HugeDomainProductIsRefusedBeforeMemoryRunsOut) {
  std::string model =
      "thing = {0, ..., 999}\nP(thing,thing)\nQ(thing,thing)\n"
      "1 P(a,b) v P(b,c) v Q(c,d) v Q(d,a)\n";
  scratch.write("huge.mln", model);
  const Outcome outcome = run("infer -m huge.mln -q P,Q --max-memory 500M --json out.json");
  EXPECT_EQ(outcome.code, 4) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("P("));
  EXPECT_EQ(json::parse(scratch.read("out.json"))["termination"], "memory_limit");
}

TEST_F(Cli, TimeLimitHandsOverWhatThereIs) {
  const Outcome outcome = run(
      "infer -m m.mln -e e.db -q Smokes,Cancer --method mcsat --samples 1000000000 --max-seconds 1 --json out.json");
  EXPECT_EQ(outcome.code, 4) << outcome.err;
  const json result = json::parse(scratch.read("out.json"));
  EXPECT_EQ(result["termination"], "time_limit");
  EXPECT_EQ(result["marginals"].size(), 3u);
  EXPECT_GT(result["samples"], 0);
  EXPECT_LT(result["samples"], 1000000000);
}

TEST_F(Cli, TimeLimitHoldsBeforeTheFirstDrawAsWell) {
  scratch.write("wide.mln", "n = {0, ..., 59}\nOn(n,n)\n0.5 On(a,b) ^ On(b,c) => On(a,c)\n");
  const Outcome outcome = scratch.shell(
      "timeout 60 \"$S\" infer -m wide.mln -q On --method mcsat --samples 1000000000 --max-seconds 3 --json out.json");
  EXPECT_EQ(outcome.code, 4) << outcome.err;
  ASSERT_TRUE(scratch.exists("out.json"));
  EXPECT_EQ(json::parse(scratch.read("out.json"))["termination"], "time_limit");
}

TEST_F(Cli, InterruptHandsOverWhatThereIs) {
  for (const std::string signal : {"INT", "TERM"}) {
    SCOPED_TRACE(signal);
    const Outcome outcome =
        scratch.shell("\"$S\" infer -m m.mln -e e.db -q Smokes,Cancer --method mcsat --samples 1000000000 --json " +
                      signal + ".json & p=$!; sleep 2; kill -" + signal + " $p; wait $p");
    EXPECT_EQ(outcome.code, 130) << outcome.err;
    const json result = json::parse(scratch.read(signal + ".json"));
    EXPECT_EQ(result["termination"], "interrupted");
    EXPECT_EQ(result["marginals"].size(), 3u);
  }
}

TEST_F(Cli, RefusedMethodSaysWhatToUse) {
  scratch.write("locked.mln", "coin = {A, B, C}\nP(coin)\nP(x) <=> P(y).\n");
  const Outcome outcome = run("infer -m locked.mln -q P --method gibbs");
  EXPECT_EQ(outcome.code, 2) << outcome.out;
  EXPECT_THAT(outcome.err, testing::AnyOf(HasSubstr("mcsat"), HasSubstr("exact")));
}

TEST_F(Cli, JsonToStandardOutputIsAlone) {
  const Outcome outcome = run("infer -m coin.mln -e coin.db -q Heads --json -");
  EXPECT_EQ(json::parse(outcome.out)["schema"], "sherlog.infer/1");  // parses as a whole
}

TEST_F(Cli, JsonFileIsThereWholeOrNotAtAll) {
  scratch.write("out.json", "old");
  EXPECT_EQ(run("infer -m coin.mln -e coin.db -q Nonsense --json out.json").code, 2);
  EXPECT_EQ(scratch.read("out.json"), "old");
  const std::size_t files = scratch.file_count();
  EXPECT_EQ(run("infer -m coin.mln -e coin.db -q Heads --json out.json").code, 0);
  EXPECT_EQ(scratch.file_count(), files) << "a temporary file was left behind";
  EXPECT_EQ(json::parse(scratch.read("out.json"))["termination"], "completed");
}

TEST_F(Cli, ReaderThatGoesAwayIsNoFailure) {
  const Outcome outcome = scratch.shell(
      "{ sleep 0.3; \"$S\" infer -m coin.mln -e coin.db -q Heads --json out.json; echo $? >code; } | true; sleep 1");
  EXPECT_THAT(outcome.err, IsEmpty());
  EXPECT_EQ(scratch.read("code"), "0\n");
  EXPECT_EQ(json::parse(scratch.read("out.json"))["termination"], "completed");
}

TEST_F(Cli, ClosedOrFullStandardOutputIsAnError) {
  for (const char* arguments : {"--help", "--version", "infer --help"}) {
    const Outcome outcome = scratch.shell(std::string("\"$S\" ") + arguments + " >/dev/full");
    EXPECT_EQ(outcome.code, 1) << arguments;
    EXPECT_THAT(outcome.err, HasSubstr("standard output")) << arguments;
  }
  for (const char* redirect : {">&-", ">/dev/full"}) {
    const Outcome outcome =
        scratch.shell(std::string("\"$S\" infer -m coin.mln -e coin.db -q Heads --json out.json ") + redirect);
    EXPECT_EQ(outcome.code, 1) << redirect;
    EXPECT_THAT(outcome.err, HasSubstr("standard output")) << redirect;
    EXPECT_EQ(json::parse(scratch.read("out.json"))["termination"], "completed") << redirect;
  }
}

TEST_F(Cli, QuietDropsWarningsAndKeepsErrors) {
  scratch.write("warn.mln", "Heads(coin)\nUnused(coin)\nlog(3) Heads(x)\n");
  EXPECT_THAT(run("check -m warn.mln").err, HasSubstr("warning: "));
  EXPECT_THAT(run("check -m warn.mln --quiet").err, IsEmpty());
  EXPECT_THAT(run("check -m missing.mln --quiet").err, HasSubstr("error: "));
}

TEST_F(Cli, PlainTextWithoutATerminal) {
  const Outcome outcome = scratch.shell("TERM=xterm \"$S\" check -m missing.mln");
  EXPECT_THAT(outcome.err, Not(HasSubstr("\x1b")));
}

TEST_F(Cli, CheckSaysWhereAndHow) {
  scratch.write("bad.mln", "on(thing,thing)\n\n1.5 on(x,y,z) => on(y,x)\n");
  const Outcome outcome = run("check -m bad.mln --json out.json");
  EXPECT_EQ(outcome.code, 2);
  EXPECT_THAT(outcome.err, HasSubstr("bad.mln:3:5: error: "));
  EXPECT_THAT(outcome.err, HasSubstr("3 | 1.5 on(x,y,z) => on(y,x)"));
  const json result = json::parse(scratch.read("out.json"));
  EXPECT_EQ(result["schema"], "sherlog.check/1");
  EXPECT_FALSE(result["ok"]);
  EXPECT_EQ(result["diagnostics"][0]["line"], 3);
  EXPECT_EQ(run("check -m m.mln -e e.db").code, 0);
}

TEST_F(Cli, GroundReportsSizesAndExports) {
  const Outcome outcome = run("ground -m m.mln -e e.db -q Smokes,Cancer --json out.json");
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  const json result = json::parse(scratch.read("out.json"));
  EXPECT_EQ(result["schema"], "sherlog.ground/1");
  EXPECT_EQ(result["network"]["groundings"], 6.0);  // 2 + 4
  EXPECT_EQ(result["formulas"].size(), 2u);
  for (const auto& [format, start] :
       {std::pair{"wcnf", "c "}, {"uai", "MARKOV\n"}, {"graphml", "<?xml"}, {"dot", "graph"}}) {
    const std::string file = std::string("net.") + format;
    EXPECT_EQ(run(std::string("ground -m m.mln -e e.db -q Smokes --export ") + format + " -o " + file).code, 0);
    EXPECT_THAT(scratch.read(file), testing::StartsWith(start)) << format;
    EXPECT_THAT(run(std::string("ground -m m.mln -e e.db -q Smokes --export ") + format).out,
                testing::Eq(scratch.read(file)));
  }
}

TEST_F(Cli, ExplainRanksGroundFormulas) {
  const Outcome outcome = run("explain -m m.mln -e e.db 'Smokes(Bob)' --json out.json");
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  const json result = json::parse(scratch.read("out.json"));
  EXPECT_EQ(result["schema"], "sherlog.explain/1");
  ASSERT_FALSE(result["contributions"].empty());
  // Cancer is closed and not stated, so smoking costs Bob 1.5; his friend's habit gives 1.1.
  EXPECT_NEAR(result["log_odds"], 1.1 - 1.5, 1e-9);
  EXPECT_NEAR(result["contributions"][0]["log_odds"], -1.5, 1e-9);
  EXPECT_THAT(result["contributions"][0]["place"], HasSubstr("m.mln:4:"));
  EXPECT_THAT(run("explain -m m.mln -e e.db 'Smokes(Anna)'").out, HasSubstr("the evidence decides it"));
  EXPECT_EQ(run("explain -m m.mln -e e.db Smokes,Cancer").code, 2);
  EXPECT_EQ(run("explain -m m.mln -e e.db 'Smokes(Nobody)'").code, 2);
}

TEST_F(Cli, ConvertReadsWithTheOtherSystemsPrecedence) {
  scratch.write("mix.mln", "a = {A}\nP(a)\nQ(a)\nR(a)\n1 P(?x) ^ Q(?x) v R(?x)\n");
  const Outcome outcome = run("convert -m mix.mln --from pracmln --to sherlog");
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("P(?x) ^ (Q(?x) v R(?x))"));
  for (const char* dialect : {"alchemy", "pracmln", "tuffy", "sherlog"}) {
    EXPECT_EQ(run(std::string("convert -m m.mln -o out.mln --to ") + dialect).code, 0) << dialect;
    EXPECT_THAT(scratch.read("out.mln"), HasSubstr("Smokes")) << dialect;
    const Outcome document = run(std::string("convert -m m.mln --json - --to ") + dialect);
    EXPECT_EQ(document.code, 0) << document.err;
    EXPECT_EQ(Json::parse(document.out)["text"], scratch.read("out.mln")) << dialect;
  }
}

// --- bad input: a message with its place, exit 2, no output, nothing half done ----------------------------------------

struct Bad {
  const char* name;
  std::string model;
  std::string evidence;
  const char* message;  // part of what is said
};

void PrintTo(const Bad& bad, std::ostream* out) { *out << bad.name; }

class BadInput : public testing::TestWithParam<Bad> {};

TEST_P(BadInput, IsRefusedWithAMessage) {
  const Scratch scratch;
  scratch.write("m.mln", GetParam().model);
  scratch.write("e.db", GetParam().evidence);
  const Outcome outcome = scratch.sherlog("infer -m m.mln -e e.db -q P --json out.json");
  EXPECT_EQ(outcome.code, 2) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr(GetParam().message));
  EXPECT_THAT(outcome.err, HasSubstr("error: "));
  EXPECT_THAT(outcome.out, IsEmpty());
  EXPECT_FALSE(scratch.exists("out.json"));
}

const std::string kBlock = "thing = {A, B}\nvalue = {U, V}\nP(thing,value!)\n1 P(x,U)\n";
const std::string kPlain = "thing = {A, B}\nP(thing)\n1 P(x)\n";

INSTANTIATE_TEST_SUITE_P(
    Of, BadInput,
    testing::Values(Bad{"OpenBracket", "P(thing)\n1 P(x\n", "", "m.mln:"},
                    Bad{"LoneOperator", "P(thing)\n1 ^ P(x)\n", "", "m.mln:2:"},
                    Bad{"UnclosedQuote", "P(thing)\n1 P(\"A)\n", "", "m.mln:2:"},
                    Bad{"UnclosedComment", "P(thing)\n/* never ends\n", "", "m.mln:2:"},
                    Bad{"StrayCharacter", "P(thing)\n1 P(x) $ P(x)\n", "", "m.mln:2:"},
                    Bad{"UnknownPredicate", "P(thing)\n1 P(x) => Qq(x,x)\n", "", "'Qq'"},
                    Bad{"Arity", "P(thing)\n1 P(x,y)\n", "", "m.mln:2:"},
                    Bad{"TwoDomains", "P(thing)\nQ(other)\n1 P(x) => Q(x)\n", "", "m.mln:3:"},
                    Bad{"WeightAndFullStop", "P(thing)\n1 P(x).\n", "", "m.mln:2:"},
                    Bad{"InfiniteWeight", "P(thing)\n1e999 P(x)\n", "", "m.mln:2:"},
                    Bad{"NanWeight", "P(thing)\nlog(-1) P(x)\n", "", "m.mln:2:"},
                    Bad{"MissingInclude", "#include \"nowhere.mln\"\nP(thing)\n1 P(x)\n", "", "nowhere.mln"},
                    Bad{"IncludeCycle", "#include \"m.mln\"\nP(thing)\n1 P(x)\n", "", "m.mln:1:"},
                    Bad{"NotUtf8", "P(thing)\n1 P(\xff\xfe)\n", "", "m.mln"},
                    Bad{"Binary", std::string("P(thing)\n1 P(x)\n\0\0\x01", 20), "", "m.mln"},
                    Bad{"DeepNesting",
                        "P(thing)\n1 " + std::string(100000, '(') + "P(x)" + std::string(100000, ')') + "\n", "",
                        "m.mln:2:"},
                    Bad{"DeepNegation", "P(thing)\n1 " + std::string(100000, '!') + "P(x)\n", "", "m.mln:2:"},
                    Bad{"EvidenceUnknownPredicate", kPlain, "Q(A)\n", "e.db:1:"},
                    Bad{"EvidenceArity", kPlain, "P(A,B)\n", "e.db:1:"},
                    Bad{"EvidenceContradiction", kPlain, "P(A)\n!P(A)\n", "e.db:1:"},
                    Bad{"EvidenceSyntax", kPlain, "P(A\n", "e.db:1:"},
                    Bad{"DegreeAboveOne", kPlain, "1.5 P(A)\n", "e.db:1:"},
                    Bad{"DegreeBelowZero", kPlain, "-0.5 P(A)\n", "e.db:1:"},
                    Bad{"TwoValuesInABlock", kBlock, "P(A,U)\nP(A,V)\n", "e.db:"},
                    Bad{"AllValuesDenied", kBlock, "!P(A,U)\n!P(A,V)\n", "e.db:"}),
    [](const auto& tested) { return std::string(tested.param.name); });

TEST_F(Cli, MissingFileAndFolderAreSaid) {
  EXPECT_THAT(run("check -m nowhere.mln").err, HasSubstr("nowhere.mln"));
  EXPECT_EQ(run("check -m nowhere.mln").code, 2);
  EXPECT_EQ(run("check -m .").code, 2);
  EXPECT_EQ(run("infer -m m.mln -e . -q Smokes").code, 2);
}

TEST_F(Cli, QueryOfAnUnknownPredicateSuggests) {
  const Outcome outcome = run("infer -m m.mln -e e.db -q Smoke");
  EXPECT_EQ(outcome.code, 2);
  EXPECT_THAT(outcome.err, HasSubstr("'Smokes'"));
}

TEST_F(Cli, UnknownPredicatesInEvidenceCanBeIgnored) {
  scratch.write("more.db", "coin = {Penny}\nShiny(Penny)\n");
  EXPECT_EQ(run("infer -m coin.mln -e more.db -q Heads").code, 2);
  EXPECT_EQ(run("infer -m coin.mln -e more.db -q Heads --ignore-unknown-predicates").code, 0);
}

TEST_F(Cli, WindowsTextIsReadLikeAnyOther) {
  scratch.write("crlf.mln", "\xef\xbb\xbfHeads(coin)\r\nlog(3) Heads(x)\r\n");
  scratch.write("crlf.db",
                "\xef\xbb\xbf"
                "coin = {Penny}\r\n");
  EXPECT_EQ(infer("-m crlf.mln -e crlf.db -q Heads")["marginals"],
            infer("-m coin.mln -e coin.db -q Heads")["marginals"]);
}

TEST_F(Cli, VeryLongNamesAreNames) {
  const std::string name(10000, 'a');
  scratch.write("long.db", "coin = {X" + name + "}\n");
  EXPECT_EQ(infer("-m coin.mln -e long.db -q Heads")["marginals"][0]["atom"], "Heads(X" + name + ")");
}

TEST_F(Cli, OneLineOfAHundredMegabytesEndsInOrder) {
  scratch.shell("head -c 100000000 /dev/zero | tr '\\0' '(' > big.mln");
  const Outcome outcome = run("check -m big.mln");
  EXPECT_EQ(outcome.code, 2);
  EXPECT_THAT(outcome.err, HasSubstr("big.mln"));
  EXPECT_LT(outcome.err.size(), 20000u);
}

}  // namespace
}  // namespace sherlog::e2e
