// sherlog track: simulate and evaluate, from the command line; what is dumped is checked by its own reading of the definitions.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>
#include <string>

#include "tests/e2e/program.h"

namespace sherlog::e2e {
namespace {

using testing::HasSubstr;
using testing::Not;
using Json = nlohmann::json;

std::vector<Json> lines_of(const std::string& text) {
  std::vector<Json> lines;
  std::istringstream in(text);
  for (std::string line; std::getline(in, line);) lines.push_back(Json::parse(line));
  return lines;
}

bool inside(const Json& view, const Json& observation) {
  if (view["table"] != observation["table"]) return false;
  for (std::size_t a = 0; a < 2; ++a) {
    const double x = observation["position"][a].get<double>();
    if (x < view["min"][a].get<double>() || x > view["max"][a].get<double>()) return false;
  }
  return true;
}

// What the actions say about each object: moved, changed.
std::map<int, std::pair<bool, bool>> histories(const Json& trial) {
  std::map<int, std::pair<bool, bool>> out;
  for (const Json& action : trial["actions"]) {
    auto& [moved, changed] = out[action["object"].get<int>()];
    moved = moved || action["kind"] == "move" || action["kind"] == "put";
    changed = changed || action["kind"] == "change";
  }
  return out;
}

Json truth_of(const Json& trial) {
  Json truth = {{"association", Json::object()}, {"explanation", Json::object()}};
  std::map<int, std::string> new_of;
  std::set<int> known;
  for (const Json& n : trial["new"]) new_of[n["object"].get<int>()] = n["id"];
  for (const Json& o : trial["old"]) known.insert(o["object"].get<int>());
  auto history = histories(trial);
  for (const Json& n : trial["new"]) {
    truth["association"][n["id"].get<std::string>()] = nullptr;
    if (!known.contains(n["object"].get<int>())) truth["explanation"][n["id"].get<std::string>()] = "appear";
  }
  for (const Json& o : trial["old"]) {
    const int object = o["object"].get<int>();
    const std::string id = o["id"];
    if (new_of.contains(object)) {
      truth["association"][new_of[object]] = id;
      truth["explanation"][id] = history[object].first ? "move" : history[object].second ? "newview" : "stay";
    } else {
      truth["explanation"][id] = inside(trial["view"], o) ? "disappear" : "hidden";
    }
  }
  return truth;
}

TEST(TrackSimulate, DumpsTrialsWhoseTruthIsThatOfTheActions) {
  const Scratch scratch;
  const Outcome outcome = scratch.sherlog(
      "track simulate --trials 60 --noise 0.1 --actions 5 --seed 9 --model paper --dump dump.jsonl --json out.json "
      "--quiet");
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const std::vector<Json> trials = lines_of(scratch.read("dump.jsonl"));
  ASSERT_EQ(trials.size(), 60u);
  std::size_t associated = 0, clusters = 0;
  for (std::size_t i = 0; i < trials.size(); ++i) {
    const Json& trial = trials[i];
    SCOPED_TRACE(i);
    EXPECT_EQ(trial["trial"], i);
    EXPECT_EQ(trial["seed"], 9);
    EXPECT_EQ(trial["objects"], 15);
    EXPECT_EQ(trial["noise"], 0.1);
    for (const Json& o : trial["old"]) EXPECT_EQ(o["out_of_view"], !inside(trial["view"], o));
    EXPECT_EQ(trial["truth"], truth_of(trial));
    EXPECT_GE(trial["result"]["seconds"].get<double>(), 0);
    for (const auto& [id, partner] : trial["truth"]["association"].items()) {
      ++clusters;
      associated += trial["result"]["association"][id] == partner ? 1u : 0u;
    }
    for (const auto& [id, why] : trial["result"]["explanation"].items()) {
      if (why == "disappear") {
        for (const Json& o : trial["old"]) EXPECT_FALSE(o["id"] == id && o["out_of_view"].get<bool>());
      }
    }
  }
  const Json json = Json::parse(scratch.read("out.json"));
  EXPECT_EQ(json["schema"], "sherlog.track.simulate/1");
  EXPECT_EQ(json["termination"], "completed");
  EXPECT_EQ(json["association"]["right"], associated);
  EXPECT_EQ(json["association"]["total"], clusters);
  EXPECT_EQ(json["disappeared_out_of_view"], 0);
  EXPECT_EQ(json["config"]["tables"], 4);
}

TEST(TrackSimulate, TheSameForAnyNumberOfThreadsAndOtherwiseForAnotherSeed) {
  const Scratch scratch;
  const auto rates = [&](const std::string& options) {
    const Outcome outcome = scratch.sherlog("track simulate --trials 100 --json - " + options);
    EXPECT_EQ(outcome.code, 0) << outcome.err;
    Json json = Json::parse(outcome.out);
    json.erase("seconds");
    return json;
  };
  EXPECT_EQ(rates("--threads 1"), rates("--threads 3"));
  EXPECT_NE(rates("--seed 1")["association"], rates("--seed 2")["association"]);
}

TEST(TrackSimulate, TakesTheWorldFromAFileAndOptionsOverIt) {
  const Scratch scratch;
  scratch.write("world.json", R"({"tables": 2, "objects": 6, "noise": 0.2})");
  const Outcome outcome =
      scratch.sherlog("track simulate --config world.json --noise 0.05 --trials 20 --matcher hungarian --json -");
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const Json config = Json::parse(outcome.out)["config"];
  EXPECT_EQ(config["tables"], 2);
  EXPECT_EQ(config["objects"], 6);
  EXPECT_EQ(config["noise"], 0.05);
}

TEST(TrackSimulate, AnyModelFileWithTheSamePredicatesCanBeUsed) {
  const Scratch scratch;
  const std::string table1 = std::string(SHERLOG_SOURCE_DIR) + "/models/identity_resolution/table1.mln";
  scratch.write("mine.mln", "#include \"" + table1 + "\"\n1.5 is(o, n, stay)\n");
  EXPECT_EQ(scratch.sherlog("track simulate --model mine.mln --trials 20").code, 0);
  scratch.write("small.mln", "similar(a, b)\n1 similar(x, y)\n");
  const Outcome lacking = scratch.sherlog("track simulate --model small.mln --trials 20");
  EXPECT_EQ(lacking.code, 2);
  EXPECT_THAT(lacking.err, HasSubstr("does not declare 'is'"));
}

TEST(TrackSimulate, BadInputIsExit2BeforeAnyWork) {
  const Scratch scratch;
  scratch.write("typo.json", R"({"nois": 0.2})");
  scratch.write("broken.json", "{");
  for (const auto& [options, message] : std::map<std::string, std::string>{
           {"--noise -1", "'noise' is -1"},
           {"--noise nan", "'noise' is nan"},
           {"--trials 0", "at least 1"},
           {"--trials x", "--trials"},
           {"--objects 100000", "--objects"},
           {"--matcher best", "none of mln, generative"},
           {"--config typo.json", "unknown parameter 'nois'"},
           {"--config broken.json", "broken.json"},
           {"--config none.json", "none.json"},
           {"--model none.mln", "none.mln"},
           {"--method magic", "unknown method 'magic'"},
           {"--dump missing/x.jsonl", "missing/x.jsonl"},
           {"--dump - --json -", "standard output"},
       }) {
    const Outcome outcome = scratch.sherlog("track simulate " + options);
    EXPECT_EQ(outcome.code, 2) << options;
    EXPECT_THAT(outcome.err, HasSubstr(message)) << options;
    EXPECT_EQ(outcome.out, "") << options;
  }
  EXPECT_EQ(scratch.sherlog("track").code, 2);
}

TEST(TrackSimulate, ATimeLimitHandsOverWhatWasFound) {
  const Scratch scratch;
  const Outcome outcome =
      scratch.sherlog("track simulate --trials 100000 --model paper --max-seconds 0.3 --dump d.jsonl --json - --quiet");
  EXPECT_EQ(outcome.code, 4);
  const Json json = Json::parse(outcome.out);
  EXPECT_EQ(json["termination"], "time_limit");
  EXPECT_EQ(lines_of(scratch.read("d.jsonl")).size(), json["trials"]);
  EXPECT_LT(json["trials"].get<int>(), 100000);
}

// What the figures rest on is learned first: a limit that falls into it is a limit as any other.
TEST(TrackEvaluate, LimitsWhileItLearnsAreLimits) {
  const Scratch scratch;
  for (const std::string command : {"simulate", "evaluate", "learn -o m.mln"}) {
    const std::string line = "track " + command + " --training-trials 1000000 --json -";
    const Outcome late = scratch.sherlog(line + " --max-seconds 0.05");
    EXPECT_EQ(late.code, 4) << late.err;
    EXPECT_EQ(Json::parse(late.out, nullptr, false)["termination"], "time_limit") << late.out;
    const Outcome interrupted = scratch.shell("timeout --preserve-status -s INT 0.5 \"$S\" " + line);
    EXPECT_EQ(interrupted.code, 130) << interrupted.err;
    EXPECT_EQ(Json::parse(interrupted.out, nullptr, false)["termination"], "interrupted") << interrupted.out;
  }
  EXPECT_EQ(scratch.file_count(), 0u);
}

TEST(TrackEvaluate, NothingToCountIsNoRate) {
  const Scratch scratch;
  const Outcome outcome = scratch.sherlog("track evaluate --actions 0 --objects 0 --trials 3 --matchers nearest");
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, Not(HasSubstr("+-")));
}

TEST(TrackEvaluate, WritesItsFiguresAndShowsThem) {
  const Scratch scratch;
  const Outcome outcome = scratch.sherlog(
      "track evaluate --trials 40 --noise 0.05,0.1 --actions 1,3 --matchers paper,generative --csv f.csv --svg f.svg "
      "--html f.html --json f.json");
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("Association of new clusters (10a)"));
  const std::string csv = scratch.read("f.csv");
  EXPECT_THAT(csv, HasSubstr("by,matcher,measure,noise,x,trials,right,total,rate,low95,high95\n"));
  EXPECT_THAT(csv, HasSubstr("actions,generative,explanation,0.1,3,40,"));
  EXPECT_THAT(csv, HasSubstr("problem_size,paper,association,0.05,"));
  EXPECT_THAT(scratch.read("f.html"), HasSubstr("<svg"));
  const Json json = Json::parse(scratch.read("f.json"));
  EXPECT_EQ(json["schema"], "sherlog.track.evaluate/1");
  ASSERT_EQ(json["cells"].size(), 4u);
  for (const Json& cell : json["cells"]) EXPECT_EQ(cell["trials"], 40);
  const Outcome bad = scratch.sherlog("track evaluate --noise 0.05,-1 --trials 2");
  EXPECT_EQ(bad.code, 2);
  EXPECT_EQ(scratch.sherlog("track evaluate --matchers paper,nobody --trials 2 --noise 0.1").code, 2);
}

}  // namespace
}  // namespace sherlog::e2e
