// Weights from labelled scenes: what does a box on the table say about what is in it?
//
// Two short scenes are the data. The program learns one weight for each shape and kind, says what the data could not tell,
// and prints the learned model as a text that parse_model (or the command line) reads back.
#include <cstdio>

#include "sherlog.h"

namespace {

constexpr const char* kModel = R"(
kind = {Cereal, Bowl}
object(thing, kind!)
shape(thing, form)
0 shape(x, +s) ^ object(x, +k)
)";
constexpr const char* kScenes = R"(
shape(T1, Box)
shape(T2, Round)
object(T1, Cereal)
object(T2, Bowl)
---
shape(T1, Box)
object(T1, Cereal)
)";

}  // namespace

int main() {
  using namespace sherlog;
  Diagnostics diagnostics;
  const auto model = parse_model(kModel, "kinds.mln", diagnostics);
  const auto scenes = model ? parse_evidence(*model, kScenes, "scenes.db", diagnostics) : std::nullopt;
  if (!scenes) return std::fputs(diagnostics.render().c_str(), stderr), 2;

  // What is to be predicted, and how firmly weights are believed to be near 0.
  LearningOptions options;
  options.method = "cll";
  options.discriminative = {*model->find_predicate("object")};
  options.prior.stdev = 1.0;

  Monitor monitor;
  const LearningResult result = learn(*model, *scenes, options, monitor);
  if (!result.objective) return std::fprintf(stderr, "%s\n", result.message.c_str()), 2;
  for (const std::string& warning : result.warnings) std::printf("warning: %s\n", warning.c_str());

  const WeightTable table(*result.model);
  std::vector<double> weights;
  for (const LearnedWeight& learned : result.weights) weights.push_back(learned.weight);
  std::printf("objective %.4f\n\n%s", *result.objective,
              learned_model_text(*result.model, table, weights, "learned from two scenes").c_str());
  return 0;
}
