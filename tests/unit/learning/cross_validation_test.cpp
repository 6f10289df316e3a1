// Cross-validation against its parts put together by hand: learning on some databases, asking about the others.
#include "learning/cross_validation.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <random>
#include <set>
#include <string>
#include <vector>

#include "learning/learned_model.h"
#include "learning/predict.h"
#include "tests/support/marginals.h"

namespace sherlog {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

TEST(Folds, DifferInSizeByOneAtMost) {
  for (const std::size_t databases : {2u, 5u, 10u, 50u, 53u}) {
    for (const std::uint32_t folds : {2u, 5u}) {
      if (folds > databases) continue;
      const std::vector<std::uint32_t> fold_of = deal_folds(databases, folds, 3);
      ASSERT_EQ(fold_of.size(), databases);
      std::vector<std::size_t> sizes(folds, 0);
      for (const std::uint32_t fold : fold_of) ++sizes.at(fold);
      EXPECT_LE(*std::ranges::max_element(sizes) - *std::ranges::min_element(sizes), 1u);
    }
  }
}

TEST(Folds, AreTheSeeds) {
  EXPECT_EQ(deal_folds(50, 5, 1), deal_folds(50, 5, 1));
  std::set<std::vector<std::uint32_t>> different;
  for (std::uint64_t seed = 0; seed < 20; ++seed) different.insert(deal_folds(50, 5, seed));
  EXPECT_EQ(different.size(), 20u);
}

// Dealt, not cut: over many seeds any two databases are together about as often as chance has it.
TEST(Folds, PutAnyTwoDatabasesTogetherAtRandom) {
  constexpr int kSeeds = 4000;
  int neighbours = 0, ends = 0;
  for (std::uint64_t seed = 0; seed < kSeeds; ++seed) {
    const std::vector<std::uint32_t> fold_of = deal_folds(10, 5, seed);
    neighbours += fold_of[0] == fold_of[1];
    ends += fold_of[0] == fold_of[9];
  }
  // 1 of the 9 others is in the same fold; five standard errors.
  const double expected = kSeeds / 9.0, error = 5 * std::sqrt(expected * 8 / 9);
  EXPECT_NEAR(neighbours, expected, error);
  EXPECT_NEAR(ends, expected, error);
}

constexpr const char* kModel =
    "kind = {A, B, C}\nk(thing, kind!)\nred(thing)\nbig(thing)\n"
    "0 k(x, +y) ^ red(x)\n0 k(x, +y) ^ big(x)\n0 k(x, +a) ^ k(y, +b) ^ x != y\n";

// Kinds lean to a colour and a size, and to company of their own.
std::string scene(std::mt19937_64& random) {
  static const char* const kKinds[] = {"A", "B", "C"};
  std::string text;
  const std::size_t theme = random() % 3;
  for (int i = 0; i < 3; ++i) {
    const std::size_t kind = random() % 3 == 0 ? random() % 3 : theme;
    const std::string thing = "T" + std::to_string(i);
    text += "k(" + thing + "," + kKinds[kind] + ")\n";
    if (random() % 10 < (kind == 0 ? 7u : 2u)) text += "red(" + thing + ")\n";
    if (random() % 10 < (kind == 1 ? 7u : 3u)) text += "big(" + thing + ")\n";
  }
  return text;
}

struct Data {
  std::optional<Model> model;
  std::vector<Evidence> databases;

  explicit Data(const std::string& text, const std::string& model_text = kModel) {
    Diagnostics diagnostics;
    model = parse_model(model_text, "m.mln", diagnostics);
    EXPECT_TRUE(model) << diagnostics.render();
    auto read = parse_evidence(*model, text, "t.db", diagnostics);
    EXPECT_TRUE(read) << diagnostics.render();
    databases = std::move(*read);
  }
  PredicateId target(const char* name = "k") const { return *model->find_predicate(name); }
};

std::string scenes(std::size_t count, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::string text;
  for (std::size_t i = 0; i < count; ++i) text += (i > 0 ? "---\n" : "") + scene(random);
  return text;
}

CrossValidationOptions options_for(const Data& data, std::uint32_t folds, const char* method = "cll") {
  CrossValidationOptions options;
  options.target = data.target();
  options.folds = folds;
  options.learning.method = method;
  options.learning.threads = 1;
  options.learning.prior.stdev = 1.0;
  return options;
}

CrossValidationResult run(const Data& data, const CrossValidationOptions& options) {
  Monitor monitor;
  return cross_validate(*data.model, data.databases, options, monitor);
}

// The marginals of the target in a database by way of the front door: a learned model as text, and evidence without it.
std::map<std::string, double> marginals(const std::string& model_text, const std::string& scene_text) {
  std::string evidence = "thing = {T0, T1, T2}\n";
  for (std::size_t begin = 0; begin < scene_text.size();) {
    const std::size_t end = scene_text.find('\n', begin);
    if (!scene_text.substr(begin).starts_with("k(")) evidence += scene_text.substr(begin, end - begin + 1);
    begin = end + 1;
  }
  return exact_marginals(model_text, evidence, {"k"});
}

TEST(CrossValidation, PredictsWhatTheModelLearnedFromTheOtherFoldsSays) {
  std::mt19937_64 random(11);
  std::vector<std::string> texts;
  std::string all;
  for (int i = 0; i < 6; ++i) {
    texts.push_back(scene(random));
    all += (i > 0 ? "---\n" : "") + texts.back();
  }
  const Data data(all);
  const CrossValidationOptions options = options_for(data, 3);
  const CrossValidationResult result = run(data, options);
  ASSERT_EQ(result.termination, Termination::kCompleted) << result.message;
  EXPECT_THAT(result.labels, ElementsAre("A", "B", "C"));
  const std::vector<std::uint32_t> fold_of = deal_folds(6, 3, options.seed);
  std::size_t next = 0;
  for (std::uint32_t d = 0; d < 6; ++d) {
    std::vector<Evidence> others;
    for (std::uint32_t other = 0; other < 6; ++other) {
      if (fold_of[other] != fold_of[d]) others.push_back(data.databases[other]);
    }
    LearningOptions learning = options.learning;
    learning.discriminative = {options.target};
    Monitor monitor;
    const LearningResult learned = learn(*data.model, others, learning, monitor);
    ASSERT_EQ(learned.termination, Termination::kCompleted) << learned.message;
    std::vector<double> weights;
    for (const LearnedWeight& weight : learned.weights) weights.push_back(weight.weight);
    const WeightTable table(*learned.model);
    const auto expected = marginals(learned_model_text(*learned.model, table, weights, ""), texts[d]);
    for (int thing = 0; thing < 3; ++thing, ++next) {
      const Prediction& prediction = result.predictions.at(next);
      EXPECT_EQ(prediction.database, d);
      EXPECT_EQ(prediction.example, "T" + std::to_string(thing));
      for (std::size_t label = 0; label < 3; ++label) {
        const std::string atom = "k(" + prediction.example + "," + result.labels[label] + ")";
        EXPECT_NEAR(prediction.probabilities[label], expected.at(atom), 1e-6) << d << " " << atom;
        EXPECT_EQ(prediction.truth == label, texts[d].find(atom) != std::string::npos);
      }
    }
  }
  EXPECT_EQ(next, result.predictions.size());
}

TEST(CrossValidation, LabelsOfAPredicateWithoutAMarkAreFalseAndTrue) {
  const Data data(scenes(6, 5));
  CrossValidationOptions options = options_for(data, 2);
  options.target = data.target("red");
  const CrossValidationResult result = run(data, options);
  ASSERT_EQ(result.termination, Termination::kCompleted) << result.message;
  EXPECT_THAT(result.labels, ElementsAre("false", "true"));
  EXPECT_EQ(result.evaluation.examples, 18u);
  for (const Prediction& prediction : result.predictions) {
    EXPECT_NEAR(prediction.probabilities[0] + prediction.probabilities[1], 1.0, 1e-12);
  }
}

TEST(CrossValidation, NoValueIsALabelWhereABlockMayBeEmpty) {
  const Data data("m(T1,A)\np(T2)\n---\nm(T1,B)\n---\nm(T1,A)\np(T2)\n",
                  "m(thing, mark?)\np(thing)\n0 m(x, +y)\n0 m(x, +y) ^ p(x)\n");
  CrossValidationOptions options = options_for(data, 3);
  options.target = data.target("m");
  const CrossValidationResult result = run(data, options);
  ASSERT_EQ(result.termination, Termination::kCompleted) << result.message;
  EXPECT_THAT(result.labels, ElementsAre("A", "B", "none"));
  ASSERT_EQ(result.predictions.size(), 5u);
  EXPECT_EQ(result.predictions[1].truth, 2u);  // T2 of the first database
  for (const Prediction& prediction : result.predictions) {
    double sum = 0.0;
    for (const double p : prediction.probabilities) sum += p;
    EXPECT_NEAR(sum, 1.0, 1e-9);
  }
}

std::vector<TuningGroup> tuning_groups() {
  return {{{FormulaId(0), FormulaId(1)}, {0.05, 0.5, 3.0}}, {{FormulaId(2)}, {2.0, 0.3, 0.02}}};
}

LearningOptions with_stdevs(LearningOptions learning, const std::vector<TuningGroup>& groups,
                            const std::vector<double>& stdevs) {
  for (std::size_t g = 0; g < groups.size(); ++g) {
    for (const FormulaId formula : groups[g].formulas) {
      Prior prior = learning.prior;
      prior.stdev = stdevs[g];
      learning.formula_priors.emplace_back(formula, prior);
    }
  }
  return learning;
}

// The slow twin of the choice: an ordinary cross-validation of the training databases for each candidate, to the end.
TEST(Tuning, ChoosesTheSmallestLossOfAnInnerCrossValidation) {
  const Data data(scenes(15, 23));
  CrossValidationOptions options = options_for(data, 3);
  options.tuning = tuning_groups();
  options.tuning_folds = 3;
  const CrossValidationResult result = run(data, options);
  ASSERT_EQ(result.termination, Termination::kCompleted) << result.message;
  const std::vector<std::uint32_t> fold_of = deal_folds(15, 3, options.seed);
  for (std::uint32_t fold = 0; fold < 3; ++fold) {
    std::vector<Evidence> train;
    for (std::size_t d = 0; d < 15; ++d) {
      if (fold_of[d] != fold) train.push_back(data.databases[d]);
    }
    std::vector<double> chosen = {options.tuning[0].stdevs[0], options.tuning[1].stdevs[0]};
    for (std::size_t g = 0; g < 2; ++g) {
      double best = std::numeric_limits<double>::infinity(), loss_of_best = best;
      for (const double stdev : options.tuning[g].stdevs) {
        std::vector<double> candidate = chosen;
        candidate[g] = stdev;
        CrossValidationOptions inner = options_for(data, 3);
        inner.learning = with_stdevs(inner.learning, options.tuning, candidate);
        Monitor monitor;
        const double loss = cross_validate(*data.model, train, inner, monitor).evaluation.log_loss;
        if (loss < loss_of_best) loss_of_best = loss, best = stdev;
      }
      chosen[g] = best;
    }
    EXPECT_EQ(result.folds.at(fold).stdevs, chosen) << fold;
  }
}

TEST(Tuning, ChoiceMayBeHandedOn) {
  const Data data(scenes(9, 29));
  CrossValidationOptions options = options_for(data, 3);
  options.tuning = tuning_groups();
  const CrossValidationResult searched = run(data, options);
  ASSERT_EQ(searched.termination, Termination::kCompleted) << searched.message;
  for (const FoldResult& fold : searched.folds) options.chosen_stdevs.push_back(fold.stdevs);
  const CrossValidationResult given = run(data, options);
  ASSERT_EQ(given.predictions.size(), searched.predictions.size());
  for (std::size_t i = 0; i < given.predictions.size(); ++i) {
    EXPECT_EQ(given.predictions[i].probabilities, searched.predictions[i].probabilities);
  }
  // A part of it too: what is left open is searched as before.
  for (std::vector<double>& row : options.chosen_stdevs) row.pop_back();
  const CrossValidationResult rest = run(data, options);
  for (std::size_t f = 0; f < rest.folds.size(); ++f) EXPECT_EQ(rest.folds[f].stdevs, searched.folds[f].stdevs);
  // In part: the second group is searched as before.
  for (std::vector<double>& chosen : options.chosen_stdevs) chosen.resize(1);
  const CrossValidationResult in_part = run(data, options);
  ASSERT_EQ(in_part.folds.size(), searched.folds.size());
  for (std::size_t f = 0; f < in_part.folds.size(); ++f) EXPECT_EQ(in_part.folds[f].stdevs, searched.folds[f].stdevs);
  // It is the choice that counts: another one gives other answers, and is reported as it was given.
  options.chosen_stdevs.assign(3, {0.01, 0.01});
  const CrossValidationResult other = run(data, options);
  EXPECT_NE(other.predictions[0].probabilities, searched.predictions[0].probabilities);
  EXPECT_THAT(other.folds[0].stdevs, ElementsAre(0.01, 0.01));
}

TEST(Tuning, TestDatabasesHaveNoPartInIt) {
  const std::string text = scenes(9, 31);
  const Data data(text);
  CrossValidationOptions options = options_for(data, 3);
  options.tuning = tuning_groups();
  const std::vector<std::uint32_t> fold_of = deal_folds(9, 3, options.seed);
  options.fold_of = fold_of;
  const CrossValidationResult before = run(data, options);
  // Every label of the first fold's databases becomes another one.
  std::string changed;
  std::size_t database = 0;
  for (std::size_t begin = 0; begin < text.size();) {
    const std::size_t end = text.find('\n', begin);
    std::string line = text.substr(begin, end - begin + 1);
    if (line == "---\n") ++database;
    if (fold_of[database] == 0 && line.starts_with("k(")) line[5] = static_cast<char>('A' + (line[5] - 'A' + 1) % 3);
    changed += line;
    begin = end + 1;
  }
  ASSERT_NE(changed, text);
  const CrossValidationResult after = run(Data(changed), options);
  EXPECT_EQ(before.folds.at(0).stdevs, after.folds.at(0).stdevs);
  for (std::size_t i = 0; i < before.predictions.size(); ++i) {
    if (fold_of[before.predictions[i].database] != 0) continue;
    EXPECT_EQ(before.predictions[i].probabilities, after.predictions[i].probabilities);
    EXPECT_NE(before.predictions[i].truth, after.predictions[i].truth);
  }
}

TEST(Tuning, BadChoicesAreRefused) {
  const Data data(scenes(6, 37));
  const auto message = [&](const auto& change) {
    CrossValidationOptions options = options_for(data, 3);
    options.tuning = tuning_groups();
    change(options);
    const CrossValidationResult result = run(data, options);
    EXPECT_EQ(result.termination, Termination::kRefused);
    EXPECT_TRUE(result.predictions.empty());
    return result.message;
  };
  EXPECT_THAT(message([](auto& o) { o.tuning[0].stdevs = {1.0, 0.0}; }), HasSubstr("above 0"));
  EXPECT_THAT(message([](auto& o) { o.tuning[0].stdevs = {-1.0}; }), HasSubstr("above 0"));
  EXPECT_THAT(message([](auto& o) { o.tuning[1].stdevs.clear(); }), HasSubstr("standard deviations to choose from"));
  EXPECT_THAT(message([](auto& o) { o.chosen_stdevs = {{1.0, 1.0}}; }), HasSubstr("one row for each fold"));
  EXPECT_THAT(message([](auto& o) { o.chosen_stdevs.assign(3, {1.0, 1.0, 1.0}); }), HasSubstr("one row for each fold"));
  EXPECT_THAT(message([](auto& o) { o.tuning_method = "guess"; }), HasSubstr("'guess'"));
}

}  // namespace
}  // namespace sherlog
