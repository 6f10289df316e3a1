// How good predicted class probabilities are: confusion matrix, accuracy, precision and recall, log-loss, calibration.
//
// Idea      Everything is computed from the list of predictions; nothing here knows where they came from.
//           The predicted label is the one of largest probability, the first of equals.
//           Precision, recall and F1 of a label are averaged with equal weight over the labels that occur as truth or as
//           prediction. One that is undefined counts as 0: the precision of a label that was never predicted, the recall of
//           one that never was true. F1 is 2 tp / (2 tp + fp + fn), which is defined for all of these labels.
//           Log-loss is the mean of -ln p(truth) in nats; p below 1e-15 counts as 1e-15, so that one impossible truth
//           costs 34.5 nats and not everything.
//           Calibration: the predictions fall into ten equal bins by the probability of the predicted label. In each, the
//           mean probability is compared with the share that was right; the error is the mean of the absolute
//           differences, weighted by the number of predictions.
//           Two classifiers are compared on the same examples. Objects of one scene are not independent, so the standard
//           error is the cluster-robust one: what a scene's differences deviate from the mean is summed before it is
//           squared. Several runs over the same scenes (other folds) may stand in one list: they share their scene's group.
// Source    Naeini, Cooper & Hauskrecht, AAAI 2015 (expected calibration error); Liang & Zeger, Biometrika 73, 1986, and
//           Cameron & Miller, J. Human Resources 50, 2015, section VI (cluster-robust error, Student's t with one degree of
//           freedom less than there are clusters).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace sherlog {

// What a model says about one example, and what it is.
struct Prediction {
  std::uint32_t database = 0;         // the scene, in the order of the data
  std::string example;                // within the scene, e.g. "c1"
  std::vector<double> probabilities;  // by label
  std::uint32_t truth = 0;            // a label
};

inline constexpr double kSmallestProbability = 1e-15;  // in the logarithm of log-loss

// The first label of largest probability.
std::uint32_t predicted_label(const Prediction& prediction);
// -ln of the probability of the truth, nats. A truth that is no label has probability 0.
double log_loss(const Prediction& prediction);

// The predictions whose label got a probability in [lower, upper); 1 is in the last bin.
struct CalibrationBin {
  double lower = 0.0, upper = 0.0;
  std::size_t count = 0;
  double confidence = 0.0;  // mean probability of the predicted label; 0 where the bin is empty
  double accuracy = 0.0;    // share that was right; 0 where the bin is empty
};
inline constexpr std::size_t kCalibrationBins = 10;

struct LabelScore {
  std::size_t true_count = 0;                      // examples that are it
  std::size_t predicted_count = 0;                 // examples that were taken for it
  std::size_t right = 0;                           // both
  double precision = 0.0, recall = 0.0, f1 = 0.0;  // 0 where undefined
  bool occurs() const { return true_count + predicted_count > 0; }
};

struct Evaluation {
  std::vector<std::string> labels;
  std::vector<std::vector<std::size_t>> counts;  // [predicted][true]
  std::vector<LabelScore> label_scores;          // by label
  std::size_t examples = 0;
  // All 0 where there are no examples.
  double accuracy = 0.0;
  double macro_precision = 0.0, macro_recall = 0.0, macro_f1 = 0.0;
  double log_loss = 0.0;
  double calibration_error = 0.0;
  std::array<CalibrationBin, kCalibrationBins> bins;
};

// Requires  each prediction has one probability a label, all finite, and its truth is a label. Those that break it are
//           left out, and `examples` says how many were not.
Evaluation evaluate(std::vector<std::string> labels, std::span<const Prediction> predictions);

// Mean of a - b over the examples, with a 95 % interval. The interval is infinite where there are fewer than two groups.
struct PairedDifference {
  double mean = 0.0;
  double standard_error = 0.0;
  double lower = 0.0, upper = 0.0;
  std::size_t examples = 0;
  std::size_t groups = 0;
};

// `a`, `b`: a score for each example (see example_scores), `groups`: the scene of each. All of one length: what one of them
// has beyond the shortest is left out.
PairedDifference paired_by_group(std::span<const double> a, std::span<const double> b,
                                 std::span<const std::uint32_t> groups);

// The scores that are worth comparing, by example.
struct ExampleScores {
  std::vector<double> accuracy;  // 1 where right, else 0
  std::vector<double> log_loss;
  std::vector<std::uint32_t> groups;  // the database
};
ExampleScores example_scores(std::span<const Prediction> predictions);

}  // namespace sherlog
