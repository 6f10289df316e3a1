// Exact answers against figures that others worked out, on models and data that do not belong to this project.
//
// Runs where the environment variable SHERLOG_DATA names the folder with golden/, bench/ and the models they speak of;
// skipped, with a message, where it does not.
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "sherlog.h"

namespace sherlog {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

// The folder, or empty.
fs::path data_folder() {
  const char* folder = std::getenv("SHERLOG_DATA");
  return folder ? fs::path(folder) : fs::path();
}

#define SKIP_WITHOUT_DATA() \
  if (data_folder().empty()) GTEST_SKIP() << "set SHERLOG_DATA to the folder with golden/ and bench/"

struct Answer {
  double log_partition = 0.0;
  double map_score = 0.0;
  std::map<std::string, double> marginals;
};

struct Question {
  fs::path model, evidence;
  std::string query;
  bool open_world = false;
  bool ask_map = false;
  std::string method = "exact";
};

void answer(const Question& question, Answer& out) {
  Diagnostics diagnostics;
  const auto model = parse_model_file((data_folder() / question.model).string(), diagnostics);
  ASSERT_TRUE(model) << diagnostics.render();
  const auto evidence = parse_evidence_files(*model, {(data_folder() / question.evidence).string()}, diagnostics);
  ASSERT_TRUE(evidence) << diagnostics.render();
  const auto query = parse_query(*model, evidence->front(), {question.query}, diagnostics);
  ASSERT_TRUE(query) << diagnostics.render();
  Monitor monitor;
  GroundingOptions grounding_options;
  grounding_options.open_world_all = question.open_world;
  const auto grounding = ground(*model, evidence->front(), *query, grounding_options, monitor);
  ASSERT_TRUE(grounding.network) << grounding.message;
  InferenceOptions options;
  options.method = question.method;
  const InferenceResult result = infer(*grounding.network, options, monitor);
  ASSERT_EQ(result.termination, Termination::kCompleted) << result.message;
  ASSERT_EQ(result.log_partition.has_value(), question.method == "exact");
  out.log_partition = result.log_partition.value_or(0.0);
  for (std::size_t i = 0; i < result.marginals.size(); ++i)
    out.marginals[grounding.network->atom_text(grounding.network->queries()[i].literal.atom())] =
        result.marginals[i].probability;
  if (!question.ask_map) return;
  options.method = "map";
  const InferenceResult best = infer(*grounding.network, options, monitor);
  ASSERT_TRUE(best.map) << best.message;
  EXPECT_TRUE(best.map->optimal);
  out.map_score = best.map->log_score;
}

// golden/*.json: two independent enumerations that agree to 4e-15.
class Golden : public testing::TestWithParam<std::string> {};

TEST_P(Golden, ExactMeetsTheEnumeration) {
  SKIP_WITHOUT_DATA();
  std::ifstream in(data_folder() / "golden" / (GetParam() + ".json"));
  ASSERT_TRUE(in) << GetParam();
  const Json expected = Json::parse(in);
  Answer found;
  // "open": every predicate; else only what is queried.
  answer({expected["model"].get<std::string>(), expected["evidence"].get<std::string>(),
          expected["query"].get<std::string>(), expected["world"] == "open", true},
         found);
  if (HasFatalFailure()) return;
  // Their models drop predicates that no formula uses, ours count log 2 for each open atom of those; every predicate of
  // these models stands in a formula or is closed, so log Z has to agree.
  EXPECT_NEAR(found.log_partition, expected["log_partition"].get<double>(), 1e-9);
  EXPECT_NEAR(found.map_score, expected["map_score"].get<double>(), 1e-9);
  std::size_t listed = 0;
  for (const auto& [atom, value] : expected["marginals"].items()) {
    const double probability = value.get<double>();
    if (found.marginals.contains(atom)) {
      ++listed;
      EXPECT_NEAR(found.marginals[atom], probability, 1e-9) << atom;
    } else {
      // They list atoms that the evidence or a block decides; we leave those out.
      EXPECT_TRUE(probability == 0.0 || probability == 1.0) << atom << " " << probability;
    }
  }
  EXPECT_EQ(listed, found.marginals.size()) << "an atom that the figures do not have";
}

INSTANTIATE_TEST_SUITE_P(Files, Golden,
                         testing::Values("alarm-kreator-q1", "alarm-noisyor-q1", "objrec-test", "smokers-small",
                                         "smokers-test-cwFriends", "tweety-kreator-q1", "tweety-noisyor-q1",
                                         "vegetarians-1-2", "vegetarians-2-2"),
                         [](const auto& parameter) {
                           std::string name = parameter.param;
                           for (char& c : name)
                             if (c == '-') c = '_';
                           return name;
                         });

// bench/: "atom probability" in each line, ten digits.
std::map<std::string, double> read_table(const fs::path& file) {
  std::map<std::string, double> table;
  std::ifstream in(data_folder() / file);
  EXPECT_TRUE(in) << file;
  std::string atom;
  double probability = 0.0;
  while (in >> atom >> probability) table[atom] = probability;
  return table;
}

void expect_table(const Question& question, const fs::path& file, double tolerance = 1e-9) {
  SCOPED_TRACE(question.model.string() + " " + question.evidence.string());
  Answer found;
  answer(question, found);
  if (testing::Test::HasFatalFailure()) return;
  const auto expected = read_table(file);
  EXPECT_EQ(found.marginals.size(), expected.size());
  for (const auto& [atom, probability] : expected) {
    ASSERT_TRUE(found.marginals.contains(atom)) << atom;
    EXPECT_NEAR(found.marginals[atom], probability, tolerance) << atom;
  }
}

TEST(BenchSmokers, TenPeopleByExact) {
  SKIP_WITHOUT_DATA();
  expect_table({"bench/smokers/smokers.mln", "bench/smokers/smokers_10.db", "Smokes,Cancer"},
               "bench/smokers/exact_10.txt");
  // An equivalence is broken where exactly one of its two clauses is: the same distribution.
  expect_table({"bench/smokers/smokers_formula.mln", "bench/smokers/smokers_10.db", "Smokes,Cancer"},
               "bench/smokers/exact_10.txt");
  expect_table({"bench/smokers/smokers_soft.mln", "bench/smokers/smokers_10.db", "Smokes,Cancer"},
               "bench/smokers/exact_soft_10.txt");
}

// Whole formulas, disjoint clauses with a block, and clauses with exactly-one as hard formulas are one distribution.
const char* const kSpellings[] = {"er_formula", "er_cl", "er_cl_nofun"};

Question table1(const std::string& spelling, const std::string& size, const std::string& method) {
  const std::string evidence = "bench/table1/er_" + size + (spelling == "er_formula" ? "_f.db" : ".db");
  return {"bench/table1/" + spelling + ".mln", evidence, "is,appear,disappear,hidden", false, false, method};
}

TEST(BenchTable1, ThreeSpellingsHaveTheExactMarginals) {
  SKIP_WITHOUT_DATA();
  for (const char* spelling : kSpellings) {
    expect_table(table1(spelling, "3", "exact"), "bench/table1/exact_3.txt");
    expect_table(table1(spelling, "6", "exact"), "bench/table1/exact_6.txt");
  }
}

TEST(BenchTable1, ThreeSpellingsAreSampledAlike) {
  SKIP_WITHOUT_DATA();
  for (const char* spelling : kSpellings)
    expect_table(table1(spelling, "6", "mcsat"), "bench/table1/exact_6.txt", 0.02);
}

}  // namespace
}  // namespace sherlog
