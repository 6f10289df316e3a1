#include "learning/evaluation.h"

#include <algorithm>
#include <boost/math/distributions/students_t.hpp>
#include <cmath>
#include <limits>
#include <unordered_map>

namespace sherlog {
namespace {

void fill_label_scores(Evaluation& result) {
  std::size_t occurring = 0;
  for (std::size_t label = 0; label < result.labels.size(); ++label) {
    LabelScore& score = result.label_scores[label];
    for (std::size_t other = 0; other < result.labels.size(); ++other) {
      score.predicted_count += result.counts[label][other];
      score.true_count += result.counts[other][label];
    }
    score.right = result.counts[label][label];
    if (!score.occurs()) continue;
    ++occurring;
    const double right = static_cast<double>(score.right);
    if (score.predicted_count > 0) score.precision = right / static_cast<double>(score.predicted_count);
    if (score.true_count > 0) score.recall = right / static_cast<double>(score.true_count);
    score.f1 = 2.0 * right / static_cast<double>(score.predicted_count + score.true_count);
    result.macro_precision += score.precision;
    result.macro_recall += score.recall;
    result.macro_f1 += score.f1;
  }
  if (occurring == 0) return;
  for (double* mean : {&result.macro_precision, &result.macro_recall, &result.macro_f1}) {
    *mean /= static_cast<double>(occurring);
  }
}

// `bins` hold sums; makes them means and returns the calibration error.
double finish_bins(std::array<CalibrationBin, kCalibrationBins>& bins, std::size_t examples) {
  double error = 0.0;
  for (CalibrationBin& bin : bins) {
    if (bin.count == 0) continue;
    const double count = static_cast<double>(bin.count);
    bin.confidence /= count;
    bin.accuracy /= count;
    error += count / static_cast<double>(examples) * std::abs(bin.accuracy - bin.confidence);
  }
  return error;
}

bool is_valid(const Prediction& prediction, std::size_t labels) {
  return prediction.probabilities.size() == labels && prediction.truth < labels &&
         std::all_of(prediction.probabilities.begin(), prediction.probabilities.end(),
                     [](double p) { return std::isfinite(p); });
}

}  // namespace

std::uint32_t predicted_label(const Prediction& prediction) {
  std::uint32_t best = 0;
  for (std::uint32_t label = 1; label < prediction.probabilities.size(); ++label) {
    if (prediction.probabilities[label] > prediction.probabilities[best]) best = label;
  }
  return best;
}

double log_loss(const Prediction& prediction) {
  if (prediction.truth >= prediction.probabilities.size()) return -std::log(kSmallestProbability);
  return -std::log(std::clamp(prediction.probabilities[prediction.truth], kSmallestProbability, 1.0));
}

Evaluation evaluate(std::vector<std::string> labels, std::span<const Prediction> predictions) {
  Evaluation result;
  result.labels = std::move(labels);
  const std::size_t count = result.labels.size();
  result.counts.assign(count, std::vector<std::size_t>(count, 0));
  result.label_scores.resize(count);
  for (std::size_t bin = 0; bin < kCalibrationBins; ++bin) {
    result.bins[bin].lower = static_cast<double>(bin) / kCalibrationBins;
    result.bins[bin].upper = static_cast<double>(bin + 1) / kCalibrationBins;
  }
  std::size_t right = 0;
  for (const Prediction& prediction : predictions) {
    if (!is_valid(prediction, count)) continue;
    const std::uint32_t label = predicted_label(prediction);
    const double confidence = prediction.probabilities[label];
    const double scaled = std::clamp(confidence * kCalibrationBins, 0.0, kCalibrationBins - 1.0);
    CalibrationBin& bin = result.bins[static_cast<std::size_t>(scaled)];
    const bool is_right = label == prediction.truth;
    ++result.examples;
    ++result.counts[label][prediction.truth];
    right += is_right ? 1u : 0u;
    result.log_loss += log_loss(prediction);
    ++bin.count;
    bin.confidence += confidence;
    bin.accuracy += is_right ? 1.0 : 0.0;
  }
  if (result.examples == 0) return result;
  result.accuracy = static_cast<double>(right) / static_cast<double>(result.examples);
  result.log_loss /= static_cast<double>(result.examples);
  result.calibration_error = finish_bins(result.bins, result.examples);
  fill_label_scores(result);
  return result;
}

PairedDifference paired_by_group(std::span<const double> a, std::span<const double> b,
                                 std::span<const std::uint32_t> groups) {
  PairedDifference result;
  result.examples = std::min({a.size(), b.size(), groups.size()});
  if (result.examples > 0) {
    for (std::size_t i = 0; i < result.examples; ++i) result.mean += a[i] - b[i];
    result.mean /= static_cast<double>(result.examples);
  }
  // Sums of deviations by group, in order of appearance: the same bits whatever the hash.
  std::unordered_map<std::uint32_t, std::size_t> position;
  std::vector<double> sums;
  for (std::size_t i = 0; i < result.examples; ++i) {
    const auto [at, is_new] = position.try_emplace(groups[i], sums.size());
    if (is_new) sums.push_back(0.0);
    sums[at->second] += a[i] - b[i] - result.mean;
  }
  result.groups = sums.size();
  if (result.groups < 2) {
    result.standard_error = std::numeric_limits<double>::infinity();
    result.lower = -result.standard_error;
    result.upper = result.standard_error;
    return result;
  }
  double squares = 0.0;
  for (const double sum : sums) squares += sum * sum;
  const double group_count = static_cast<double>(result.groups);
  result.standard_error = std::sqrt(group_count / (group_count - 1.0) * squares) / static_cast<double>(result.examples);
  const double t = boost::math::quantile(boost::math::students_t(group_count - 1.0), 0.975);
  result.lower = result.mean - t * result.standard_error;
  result.upper = result.mean + t * result.standard_error;
  return result;
}

ExampleScores example_scores(std::span<const Prediction> predictions) {
  ExampleScores result;
  for (const Prediction& prediction : predictions) {
    result.accuracy.push_back(predicted_label(prediction) == prediction.truth ? 1.0 : 0.0);
    result.log_loss.push_back(log_loss(prediction));
    result.groups.push_back(prediction.database);
  }
  return result;
}

}  // namespace sherlog
