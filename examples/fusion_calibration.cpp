// Are the fusion model's probabilities what they say? A model is learned from synthetic scenes. Then the labels of fresh
// scenes are drawn from that model's own joint distribution, given what the annotators said, and the marginals that the
// engine computes are held against them: of the answers given with 70 %, 70 % should be right.
//
//   fusion_calibration [TRAINING_SCENES [TEST_SCENES]]
//
// A joint draw comes from marginals alone, by the chain rule: draw one object's label from its marginal, state it as
// evidence, ask for the next.
#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <random>
#include <string>
#include <vector>

#include "learning/evaluation.h"
#include "learning/learn.h"
#include "learning/learned_model.h"
#include "perception_bridge/kitchen_generator.h"
#include "sherlog.h"

namespace {

using namespace sherlog;

struct Marginals {
  std::vector<std::string> labels;
  std::vector<std::vector<double>> probabilities;  // by object and label
};

// P(object(c, label) | scene) for the objects c1, c2, ... of a scene.
std::optional<Marginals> ask(const Model& model, const std::string& scene, std::size_t objects,
                             Diagnostics& diagnostics) {
  const auto databases = parse_evidence(model, scene, "scene.db", diagnostics);
  if (!databases) return std::nullopt;
  const auto query = parse_query(model, databases->front(), {"object"}, diagnostics);
  if (!query) return std::nullopt;
  Monitor monitor;
  const auto grounded = ground(model, databases->front(), *query, {}, monitor);
  if (!grounded.network) return std::nullopt;
  const InferenceResult result = infer(*grounded.network, {}, monitor);
  if (result.termination != Termination::kCompleted) return std::nullopt;
  Marginals out;
  out.probabilities.resize(objects);
  for (std::size_t i = 0; i < result.marginals.size(); ++i) {
    // object(c3,Milk)
    const std::string atom = grounded.network->literal_text(grounded.network->queries()[i].literal);
    const std::size_t open = atom.find('('), comma = atom.find(',');
    const auto object = static_cast<std::size_t>(std::atoi(atom.c_str() + open + 2)) - 1;
    if (object == 0) out.labels.push_back(atom.substr(comma + 1, atom.size() - comma - 2));
    out.probabilities[object].push_back(result.marginals[i].probability);
  }
  return out;
}

std::optional<Model> learned_model(const KitchenConfig& kitchen, std::uint64_t scenes, Diagnostics& diagnostics) {
  const auto model = parse_model_file("models/information_fusion/experiment/extended.mln", diagnostics);
  if (!model) return std::nullopt;
  const auto training = parse_evidence(*model, kitchen_text(kitchen, 1, scenes), "training.db", diagnostics);
  if (!training) return std::nullopt;
  LearningOptions options;
  options.method = "dpll";
  options.discriminative = {*model->find_predicate("object")};
  options.prior.stdev = 3.0;
  Prior pairs;
  pairs.stdev = 0.5;
  options.formula_priors = {{FormulaId(static_cast<std::uint32_t>(model->formulas().size() - 1)), pairs}};
  Monitor monitor;
  const LearningResult result = learn(*model, *training, options, monitor);
  if (!result.model || result.weights.empty()) return std::nullopt;
  std::vector<double> weights;
  for (const LearnedWeight& weight : result.weights) weights.push_back(weight.weight);
  const WeightTable table(*result.model);
  return parse_model(learned_model_text(*result.model, table, weights, "learned"), "learned.mln", diagnostics);
}

void print_bins(const char* title, const Evaluation& evaluation) {
  std::printf("%s: %zu objects, accuracy %.4f, log-loss %.4f, calibration error %.4f\n", title, evaluation.examples,
              evaluation.accuracy, evaluation.log_loss, evaluation.calibration_error);
  for (const CalibrationBin& bin : evaluation.bins) {
    if (bin.count == 0) continue;
    std::printf("  said %.1f-%.1f: %5zu objects, mean %.3f, right %.3f\n", bin.lower, bin.upper, bin.count,
                bin.confidence, bin.accuracy);
  }
}

}  // namespace

int main(int argc, char** argv) {
  const int train = argc > 1 ? std::atoi(argv[1]) : 60, test = argc > 2 ? std::atoi(argv[2]) : 40;
  if (train < 1 || test < 1) return std::fprintf(stderr, "usage: %s [TRAINING_SCENES [TEST_SCENES]]\n", argv[0]), 2;
  KitchenConfig kitchen = default_kitchen();
  kitchen.object_counts = {0, 0, 1, 2, 2, 1};
  Diagnostics diagnostics;
  const auto model = learned_model(kitchen, static_cast<std::uint64_t>(train), diagnostics);
  if (!model) return std::fputs(diagnostics.render().c_str(), stderr), 2;

  std::mt19937_64 random(7);
  std::vector<std::string> labels;
  std::vector<Prediction> by_model, by_kitchen;  // with the labels that the model drew; with the true ones
  for (std::uint32_t s = 0; s < static_cast<std::uint32_t>(test); ++s) {
    const KitchenScene scene = generate_kitchen_scene(kitchen, 2, s);
    KitchenTextOptions unlabelled;
    unlabelled.labels = false;
    std::string text = kitchen_scene_text(kitchen, scene, unlabelled);
    std::vector<Prediction> predictions;
    for (std::size_t object = 0; object < scene.objects.size(); ++object) {
      const auto asked = ask(*model, text, scene.objects.size(), diagnostics);
      if (!asked) return std::fputs(diagnostics.render().c_str(), stderr), 2;
      if (object == 0) {
        labels = asked->labels;
        for (std::size_t o = 0; o < scene.objects.size(); ++o) {
          predictions.push_back({s, fmt::format("c{}", o + 1), asked->probabilities[o], 0});
        }
      }
      const std::vector<double>& now = asked->probabilities[object];
      std::discrete_distribution<std::uint32_t> draw(now.begin(), now.end());
      predictions[object].truth = draw(random);
      text += fmt::format("object(c{},{})\n", object + 1, labels[predictions[object].truth]);
    }
    by_model.insert(by_model.end(), predictions.begin(), predictions.end());
    for (std::size_t object = 0; object < scene.objects.size(); ++object) {
      // A class that training never showed is no label: log-loss counts it as impossible, calibration as wrong.
      const auto found =
          std::find(labels.begin(), labels.end(), kitchen.classes[scene.objects[object].object_class].name);
      if (found == labels.end()) continue;
      predictions[object].truth = static_cast<std::uint32_t>(found - labels.begin());
      by_kitchen.push_back(predictions[object]);
    }
  }
  print_bins("labels drawn from the model", evaluate(labels, by_model));
  print_bins("labels of the generator", evaluate(labels, by_kitchen));
  return 0;
}
