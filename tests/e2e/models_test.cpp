// The shipped models give the answers that stand beside them.
//
// Each models/<name>/expected*.json names a model, its evidence and a question, and the answer, worked out without this
// library (by enumeration, by forward-backward, ...). Adding such a file adds a test.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <vector>

#include "sherlog.h"

namespace sherlog {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

struct Case {
  fs::path file;
  Json expected;
};

void PrintTo(const Case& c, std::ostream* out) {
  *out << c.file.parent_path().filename().string() << "/" << c.file.filename().string();
}

std::vector<Case> cases() {
  std::vector<Case> found;
  for (const auto& entry : fs::recursive_directory_iterator(fs::path(SHERLOG_SOURCE_DIR) / "models")) {
    const std::string name = entry.path().filename().string();
    if (!name.starts_with("expected") || entry.path().extension() != ".json") continue;
    std::ifstream in(entry.path());
    found.push_back({entry.path(), Json::parse(in)});
  }
  std::sort(found.begin(), found.end(), [](const Case& a, const Case& b) { return a.file < b.file; });
  return found;
}

std::vector<std::string> strings(const Json& json) { return json.get<std::vector<std::string>>(); }

GroundingOptions grounding_options(const Json& expected, const Model& model) {
  GroundingOptions options;
  if (expected.value("soft_evidence", "virtual") == "jeffrey") options.soft_evidence = SoftEvidence::kJeffrey;
  for (const std::string& name : strings(expected.value("open_world", Json::array()))) {
    const auto predicate = model.find_predicate(name);
    EXPECT_TRUE(predicate) << name;
    if (predicate) options.open_world.push_back(*predicate);
  }
  return options;
}

std::string target_text(const GroundNetwork& network, const QueryTarget& target) {
  return target.is_formula ? target.formula_text : network.atom_text(target.literal.atom());
}

// The true ones among the queried atoms, by name.
std::set<std::string> true_atoms(const GroundNetwork& network, const MapSolution& map) {
  std::set<std::string> names;
  for (const QueryTarget& target : network.queries()) {
    if (target.is_formula) continue;
    const AtomId atom = target.literal.atom();
    if (map.values[network.variable_of(atom).index()] == network.value_of(atom)) names.insert(network.atom_text(atom));
  }
  return names;
}

InferenceResult run(const GroundNetwork& network, const std::string& method) {
  InferenceOptions options;
  options.method = method;
  options.threads = 2;
  Monitor monitor;
  return infer(network, options, monitor);
}

void expect_marginals(const Json& expected, const GroundNetwork& network, const std::string& method, double tolerance) {
  SCOPED_TRACE(method);
  const InferenceResult result = run(network, method);
  ASSERT_EQ(result.termination, Termination::kCompleted) << result.message;
  ASSERT_EQ(result.marginals.size(), network.queries().size());
  if (method == "exact" && expected.contains("log_partition")) {
    ASSERT_TRUE(result.log_partition);
    EXPECT_NEAR(*result.log_partition, expected["log_partition"].get<double>(), tolerance);
  }
  std::map<std::string, double> found;
  for (std::size_t i = 0; i < result.marginals.size(); ++i)
    found[target_text(network, network.queries()[i])] = result.marginals[i].probability;
  EXPECT_EQ(found.size(), expected["marginals"].size());
  for (const auto& [name, probability] : expected["marginals"].items()) {
    ASSERT_TRUE(found.contains(name)) << name;
    EXPECT_NEAR(found[name], probability.get<double>(), tolerance) << name;
  }
}

void expect_map(const Json& expected, const GroundNetwork& network) {
  const InferenceResult result = run(network, "map");
  ASSERT_EQ(result.termination, Termination::kCompleted) << result.message;
  ASSERT_TRUE(result.map);
  EXPECT_TRUE(result.map->optimal);
  EXPECT_NEAR(result.map->log_score, expected["log_score"].get<double>(), 1e-9);
  if (!expected.contains("true_atoms")) return;  // several worlds are equally probable
  const auto names = strings(expected["true_atoms"]);
  EXPECT_EQ(true_atoms(network, *result.map), std::set<std::string>(names.begin(), names.end()));
}

class ShippedModel : public testing::TestWithParam<Case> {};

TEST_P(ShippedModel, GivesTheAnswersBesideIt) {
  const Json& expected = GetParam().expected;
  const fs::path folder = GetParam().file.parent_path();
  Diagnostics diagnostics;
  const auto model = parse_model_file((folder / expected["model"].get<std::string>()).string(), diagnostics);
  ASSERT_TRUE(model) << diagnostics.render();
  std::vector<std::string> files;
  for (const std::string& name : strings(expected["evidence"])) files.push_back((folder / name).string());
  const auto evidence = parse_evidence_files(*model, files, diagnostics);
  ASSERT_TRUE(evidence) << diagnostics.render();
  ASSERT_EQ(evidence->size(), 1u);
  const auto query = parse_query(*model, evidence->front(), strings(expected["query"]), diagnostics);
  ASSERT_TRUE(query) << diagnostics.render();
  EXPECT_EQ(diagnostics.warning_count(), 0u) << diagnostics.render();

  Monitor monitor;
  const auto grounding = ground(*model, evidence->front(), *query, grounding_options(expected, *model), monitor);
  if (expected.value("termination", "completed") == "no_possible_world") {
    const Termination termination =
        grounding.network ? run(*grounding.network, "exact").termination : grounding.termination;
    EXPECT_EQ(termination, Termination::kNoPossibleWorld);
    return;
  }
  ASSERT_TRUE(grounding.network) << grounding.message;
  for (const auto& [method, tolerance] : expected["tolerance"].items())
    expect_marginals(expected, *grounding.network, method, tolerance.get<double>());
  if (expected.contains("map")) expect_map(expected["map"], *grounding.network);
}

std::string case_name(const testing::TestParamInfo<Case>& info) {
  std::string name = info.param.file.parent_path().filename().string() + "_" + info.param.file.stem().string();
  for (char& c : name)
    if (!std::isalnum(static_cast<unsigned char>(c))) c = '_';
  return name;
}

INSTANTIATE_TEST_SUITE_P(Models, ShippedModel, testing::ValuesIn(cases()), case_name);

// The templates of the fusion model stand for as many weights as its text says: 3 x 6 x 25, 4 x 25 and 25 x 25.
TEST(FusionTemplates, ExpandToOneWeightForEachChoiceOfConstants) {
  const fs::path folder = fs::path(SHERLOG_SOURCE_DIR) / "models" / "information_fusion";
  Diagnostics diagnostics;
  const auto model = parse_model_file((folder / "templates.mln").string(), diagnostics);
  ASSERT_TRUE(model) << diagnostics.render();
  ASSERT_EQ(model->formulas().size(), 7u);
  const auto expansions = [&](std::size_t formula) {
    std::size_t count = 1;
    for (const FormulaVariable& variable : model->formulas()[formula].variables)
      if (variable.plus) count *= model->domain(variable.domain).constants.size();
    return count;
  };
  EXPECT_EQ(expansions(0), 450u);
  EXPECT_EQ(expansions(5), 100u);
  EXPECT_EQ(expansions(6), 625u);
}

}  // namespace
}  // namespace sherlog
