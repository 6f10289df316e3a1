// Optima that others found: golden/learning.json of the folder that the environment variable SHERLOG_DATA names; skipped,
// with a message, where it is not set.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <numeric>
#include <string>
#include <vector>

#include "learning/learn.h"
#include "learning/learned_model.h"
#include "learning/methods.h"

namespace sherlog {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

// A formula's conjuncts in alphabetical order, without spaces, brackets and names of variables: the authors' program writes
// (?c1=/=?c2) and the members of an unordered pair in its own order.
std::string canonical(const std::string& text) {
  std::vector<std::string> parts{""};
  for (const char c : text) {
    if (c == '^') {
      parts.emplace_back();
    } else if (std::string_view(" ()?\"'").find(c) == std::string_view::npos) {
      parts.back() += c;
    }
  }
  for (std::string& part : parts) {
    for (const std::string variable : {"c1,", "c2,"}) {
      const std::size_t at = part.find(variable);
      if (at != std::string::npos) part.erase(at + 1, 1);
    }
    if (part.starts_with("c1")) part.clear();  // c1 != c2
  }
  std::ranges::sort(parts);
  std::string result;
  for (const std::string& part : parts) result += part + '^';
  return result;
}

struct Case {
  std::optional<Model> model;
  std::vector<Evidence> databases;
  LearningOptions options;

  void read(const fs::path& folder, const Json& expected) {
    Diagnostics diagnostics;
    model = parse_model_file((folder / expected["model"]).string(), diagnostics);
    ASSERT_TRUE(model) << diagnostics.render();
    auto data = parse_evidence_files(*model, {(folder / expected["data"]).string()}, diagnostics);
    ASSERT_TRUE(data) << diagnostics.render();
    databases = std::move(*data);
    options.method = expected["method"];
    if (expected.contains("discriminative")) {
      for (const std::string name : expected["discriminative"]) {
        options.discriminative.push_back(*model->find_predicate(name));
      }
    }
    options.prior.stdev = expected["prior_stdev"].is_null() ? std::numeric_limits<double>::infinity()
                                                            : expected["prior_stdev"].get<double>();
  }
};

double value_at_zero(const Case& c) {
  Monitor monitor;
  const StopCondition stop(monitor);
  const TrainingSet set(*c.model, c.databases);
  const PreparedOrProblem made = find_learning_method(c.options.method)->prepare(set, c.options, false, stop);
  EXPECT_TRUE(made.data) << made.problem.message;
  std::vector<std::uint32_t> all(set.databases.size());
  std::iota(all.begin(), all.end(), 0u);
  std::vector<double> zero(set.weights.size(), 0.0), gradient(zero);
  return made.data->objective(all)->evaluate(zero, gradient);
}

std::map<std::string, double> by_formula(const Model& model, const std::vector<double>& weights) {
  const WeightTable table(model);
  std::map<std::string, double> result;
  for (std::size_t w = 0; w < table.size(); ++w) {
    const bool fresh = result.emplace(canonical(weight_text(model, table, w)), weights[w]).second;
    EXPECT_TRUE(fresh) << weight_text(model, table, w);
  }
  return result;
}

void compare(const fs::path& folder, const Json& expected) {
  Case c;
  c.read(folder, expected);
  if (testing::Test::HasFatalFailure()) return;
  Monitor monitor;
  const LearningResult found = learn(*c.model, c.databases, c.options, monitor);
  ASSERT_EQ(found.termination, Termination::kCompleted) << found.message;
  EXPECT_TRUE(found.converged) << found.reason;
  if (expected.contains("objective")) {
    EXPECT_NEAR(*found.objective, expected["objective"].get<double>(), 1e-6);
  }
  if (expected.contains("objective_with_prior")) {
    EXPECT_NEAR(*found.objective_with_prior, expected["objective_with_prior"].get<double>(), 1e-6);
  }
  if (expected.contains("formulas")) {
    EXPECT_EQ(found.weights.size(), expected["formulas"].get<std::size_t>());
  }
  if (expected.contains("pll_at_zero")) {
    EXPECT_NEAR(value_at_zero(c), expected["pll_at_zero"].get<double>(), 1e-6);
  }
  std::vector<double> weights;
  for (const LearnedWeight& weight : found.weights) weights.push_back(weight.weight);
  const std::map<std::string, double> ours = by_formula(*found.model, weights);
  if (expected.contains("weights")) {  // five or six digits
    for (const auto& [formula, weight] : expected["weights"].items()) {
      ASSERT_TRUE(ours.contains(canonical(formula))) << formula;
      EXPECT_NEAR(ours.at(canonical(formula)), weight.get<double>(), 1e-5) << formula;
    }
  }
  if (!expected.contains("weights_file")) return;
  Diagnostics diagnostics;
  const auto published = parse_model_file((folder / expected["weights_file"]).string(), diagnostics);
  ASSERT_TRUE(published) << diagnostics.render();
  std::vector<double> theirs;
  for (const Formula& formula : published->formulas()) theirs.push_back(formula.weight);
  std::size_t listed = 0;
  for (const auto& [formula, weight] : by_formula(*published, theirs)) {
    ASSERT_TRUE(ours.contains(formula)) << formula;
    EXPECT_NEAR(ours.at(formula), weight, 1e-3) << formula;
    ++listed;
  }
  EXPECT_GT(listed, 2000u);
  // What they left out has weight 0.
  const double sum_of_rest = std::accumulate(
      ours.begin(), ours.end(), 0.0, [&](double sum, const auto& entry) { return sum + std::abs(entry.second); });
  const double sum_of_theirs =
      std::accumulate(theirs.begin(), theirs.end(), 0.0, [](double sum, double w) { return sum + std::abs(w); });
  EXPECT_NEAR(sum_of_rest, sum_of_theirs, 1e-3 * static_cast<double>(ours.size()));
}

TEST(GoldenLearning, FindsTheOptimaOfOthers) {
  const char* folder = std::getenv("SHERLOG_DATA");
  if (folder == nullptr) GTEST_SKIP() << "set SHERLOG_DATA to the folder with golden/learning.json";
  std::ifstream in(fs::path(folder) / "golden" / "learning.json");
  ASSERT_TRUE(in);
  const Json expected = Json::parse(in);
  ASSERT_FALSE(expected["cases"].empty());
  for (const Json& one : expected["cases"]) {
    SCOPED_TRACE(one.dump());
    compare(folder, one);
  }
}

}  // namespace
}  // namespace sherlog
