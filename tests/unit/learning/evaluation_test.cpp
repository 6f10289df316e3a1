#include "learning/evaluation.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include "tests/unit/learning/table3.h"

namespace sherlog {
namespace {

Prediction prediction(std::vector<double> probabilities, std::uint32_t truth) {
  Prediction result;
  result.probabilities = std::move(probabilities);
  result.truth = truth;
  return result;
}

TEST(Evaluation, PublishedMatrixHas34Of131Right) {
  const Evaluation evaluation = evaluate(published_labels(), published_predictions());
  EXPECT_EQ(evaluation.examples, 131u);
  EXPECT_DOUBLE_EQ(evaluation.accuracy, 34.0 / 131.0);
  // The means over 26 labels, worked out by hand in a few lines of Python.
  EXPECT_NEAR(evaluation.macro_precision, 0.2923793705170223, 1e-12);
  EXPECT_NEAR(evaluation.macro_recall, 0.2498291489807327, 1e-12);
  EXPECT_NEAR(evaluation.macro_f1, 0.24629387706310782, 1e-12);
  // "ketchup": 4 of 7 found; "tea": never predicted.
  EXPECT_EQ(evaluation.label_scores[13].right, 4u);
  EXPECT_EQ(evaluation.label_scores[13].true_count, 7u);
  EXPECT_EQ(evaluation.label_scores[24].predicted_count, 0u);
  EXPECT_EQ(evaluation.label_scores[24].precision, 0.0);
}

TEST(Evaluation, SmallMatrixByHand) {
  // Truths a a b; predictions a b b.
  const std::vector<Prediction> predictions{prediction({0.7, 0.2, 0.1}, 0), prediction({0.3, 0.5, 0.2}, 0),
                                            prediction({0.1, 0.85, 0.05}, 1)};
  const Evaluation evaluation = evaluate({"a", "b", "c"}, predictions);
  EXPECT_EQ(evaluation.counts, (std::vector<std::vector<std::size_t>>{{1, 0, 0}, {1, 1, 0}, {0, 0, 0}}));
  EXPECT_DOUBLE_EQ(evaluation.accuracy, 2.0 / 3.0);
  // c occurs nowhere and is left out: precision (1/1 + 1/2) / 2, recall (1/2 + 1/1) / 2, F1 (2/3 + 2/3) / 2.
  EXPECT_DOUBLE_EQ(evaluation.macro_precision, 0.75);
  EXPECT_DOUBLE_EQ(evaluation.macro_recall, 0.75);
  EXPECT_DOUBLE_EQ(evaluation.macro_f1, 2.0 / 3.0);
  EXPECT_NEAR(evaluation.log_loss, -(std::log(0.7) + std::log(0.3) + std::log(0.85)) / 3.0, 1e-15);
  // Each in a bin of its own: |1 - 0.7|, |0 - 0.5|, |1 - 0.85|.
  EXPECT_NEAR(evaluation.calibration_error, (0.3 + 0.5 + 0.15) / 3.0, 1e-12);
  EXPECT_EQ(evaluation.bins[5].count, 1u);
  EXPECT_EQ(evaluation.bins[5].accuracy, 0.0);
  EXPECT_DOUBLE_EQ(evaluation.bins[8].confidence, 0.85);
}

TEST(Evaluation, LabelThatIsOnlyPredictedCountsAsZero) {
  const std::vector<Prediction> predictions{prediction({0.9, 0.1}, 0), prediction({0.2, 0.8}, 0)};
  const Evaluation evaluation = evaluate({"a", "b"}, predictions);
  EXPECT_DOUBLE_EQ(evaluation.macro_recall, 0.25);    // (1/2 + 0) / 2
  EXPECT_DOUBLE_EQ(evaluation.macro_precision, 0.5);  // (1/1 + 0/1) / 2
  EXPECT_DOUBLE_EQ(evaluation.macro_f1, 1.0 / 3.0);   // (2/3 + 0) / 2
}

TEST(Evaluation, FirstOfEqualsIsPredicted) {
  EXPECT_EQ(predicted_label(prediction({0.2, 0.4, 0.4}, 0)), 1u);
  EXPECT_EQ(predicted_label(prediction({0.25, 0.25, 0.25, 0.25}, 0)), 0u);
}

TEST(Evaluation, ImpossibleTruthCostsAFiniteLoss) {
  EXPECT_DOUBLE_EQ(log_loss(prediction({1.0, 0.0}, 1)), -std::log(1e-15));
  EXPECT_EQ(log_loss(prediction({1.0, 0.0}, 0)), 0.0);
}

TEST(Evaluation, CertaintyIsInTheLastBin) {
  const std::vector<Prediction> predictions{prediction({1.0, 0.0}, 0), prediction({0.9, 0.1}, 0)};
  const Evaluation evaluation = evaluate({"a", "b"}, predictions);
  EXPECT_EQ(evaluation.bins.back().count, 2u);
  EXPECT_NEAR(evaluation.calibration_error, 0.05, 1e-12);  // 1 - mean(1, 0.9)
}

TEST(Evaluation, ProbabilitiesThatMeanWhatTheySayAreCalibrated) {
  std::mt19937_64 random(5);
  std::vector<Prediction> predictions;
  for (int i = 0; i < 20000; ++i) {
    const double p = static_cast<double>(random() >> 11) * 0x1p-53;
    const double draw = static_cast<double>(random() >> 11) * 0x1p-53;
    predictions.push_back(prediction({p, 1 - p}, draw < p ? 0u : 1u));
  }
  EXPECT_LT(evaluate({"a", "b"}, predictions).calibration_error, 0.015);
  for (Prediction& p : predictions) p.probabilities = {p.probabilities[0] > 0.5 ? 0.99 : 0.01, 0.0};
  for (Prediction& p : predictions) p.probabilities[1] = 1 - p.probabilities[0];
  EXPECT_GT(evaluate({"a", "b"}, predictions).calibration_error, 0.2);
}

TEST(Evaluation, NothingToEvaluateIsAllZero) {
  const Evaluation evaluation = evaluate({"a", "b"}, {});
  EXPECT_EQ(evaluation.examples, 0u);
  EXPECT_EQ(evaluation.accuracy, 0.0);
  EXPECT_EQ(evaluation.macro_f1, 0.0);
  EXPECT_EQ(evaluation.calibration_error, 0.0);
}

TEST(Evaluation, WhatIsNoPredictionIsLeftOut) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const std::vector<Prediction> predictions{prediction({0.9, 0.1}, 0), prediction({0.9}, 0), prediction({0.9, 0.1}, 2),
                                            prediction({nan, 0.1}, 0)};
  EXPECT_EQ(evaluate({"a", "b"}, predictions).examples, 1u);
}

TEST(PairedDifference, SumsDeviationsByGroup) {
  // Differences 1 0 | 0 0 | 1 1 in three groups: mean 1/2, sums of deviations 0, -1, 1.
  const std::vector<double> a{1, 1, 0, 1, 1, 1}, b{0, 1, 0, 1, 0, 0};
  const std::vector<std::uint32_t> groups{7, 7, 3, 3, 5, 5};
  const PairedDifference difference = paired_by_group(a, b, groups);
  EXPECT_DOUBLE_EQ(difference.mean, 0.5);
  EXPECT_EQ(difference.groups, 3u);
  const double error = std::sqrt(3.0 / 2.0 * 2.0) / 6.0;
  EXPECT_NEAR(difference.standard_error, error, 1e-15);
  EXPECT_NEAR(difference.upper, 0.5 + 4.302652729911275 * error, 1e-9);  // Student's t, 2 degrees of freedom
  EXPECT_NEAR(difference.lower, 0.5 - 4.302652729911275 * error, 1e-9);
}

TEST(PairedDifference, RepeatingTheSameScenesAddsNoCertainty) {
  std::mt19937_64 random(3);
  std::vector<double> a, b;
  std::vector<std::uint32_t> groups;
  for (std::uint32_t i = 0; i < 60; ++i) {
    a.push_back(random() % 3 == 0 ? 0.0 : 1.0);
    b.push_back(random() % 2 == 0 ? 0.0 : 1.0);
    groups.push_back(i / 3);
  }
  const PairedDifference once = paired_by_group(a, b, groups);
  std::vector<double> a10, b10;
  std::vector<std::uint32_t> groups10;
  for (int i = 0; i < 10; ++i) {
    a10.insert(a10.end(), a.begin(), a.end());
    b10.insert(b10.end(), b.begin(), b.end());
    groups10.insert(groups10.end(), groups.begin(), groups.end());
  }
  const PairedDifference ten = paired_by_group(a10, b10, groups10);
  EXPECT_NEAR(ten.mean, once.mean, 1e-12);
  EXPECT_NEAR(ten.standard_error, once.standard_error, 1e-12);
}

TEST(PairedDifference, IntervalCoversTheTruthInScenesThatVaryTogether) {
  // Four objects a scene share a shift; an error that ignores it would cover far less than 95 %.
  std::mt19937_64 random(11);
  std::normal_distribution<double> normal;
  int covered = 0;
  constexpr int kTrials = 600;
  for (int trial = 0; trial < kTrials; ++trial) {
    std::vector<double> a, b;
    std::vector<std::uint32_t> groups;
    for (std::uint32_t scene = 0; scene < 30; ++scene) {
      const double shift = normal(random);
      for (int i = 0; i < 4; ++i) {
        a.push_back(0.2 + shift + normal(random));
        b.push_back(0.0);
        groups.push_back(scene);
      }
    }
    const PairedDifference difference = paired_by_group(a, b, groups);
    covered += difference.lower <= 0.2 && 0.2 <= difference.upper ? 1 : 0;
  }
  EXPECT_NEAR(covered / static_cast<double>(kTrials), 0.95, 0.04);
}

TEST(PairedDifference, OneGroupSaysNothingAboutTheError) {
  const std::vector<double> a{1, 0}, b{0, 0};
  const std::vector<std::uint32_t> groups{1, 1};
  const PairedDifference difference = paired_by_group(a, b, groups);
  EXPECT_DOUBLE_EQ(difference.mean, 0.5);
  EXPECT_TRUE(std::isinf(difference.upper));
  EXPECT_TRUE(std::isinf(difference.lower));
}

TEST(ExampleScores, AreByExample) {
  std::vector<Prediction> predictions{prediction({0.8, 0.2}, 0), prediction({0.8, 0.2}, 1)};
  predictions[1].database = 4;
  const ExampleScores scores = example_scores(predictions);
  EXPECT_EQ(scores.accuracy, (std::vector<double>{1, 0}));
  EXPECT_EQ(scores.groups, (std::vector<std::uint32_t>{0, 4}));
  EXPECT_DOUBLE_EQ(scores.log_loss[1], -std::log(0.2));
}

}  // namespace
}  // namespace sherlog
