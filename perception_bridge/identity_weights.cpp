#include "perception_bridge/identity_weights.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>

#include "learning/learn.h"
#include "mln/evidence.h"
#include "mln/parser.h"
#include "perception_bridge/shipped_models.h"

namespace sherlog {
namespace {

constexpr double kLeastOdds = -20, kMostOdds = 43, kStep = 0.125;  // what nine bits of learning.mln hold
constexpr std::size_t kBits = 9;

void write_bits(std::string& text, const char* predicate, std::size_t o, std::size_t n, double grade) {
  const double odds = std::clamp(std::log(grade / (1 - grade)), kLeastOdds, kMostOdds);
  const auto number = static_cast<std::uint32_t>(std::lround((odds - kLeastOdds) / kStep));
  for (std::size_t bit = 0; bit < kBits; ++bit) {
    if ((number >> bit & 1u) != 0)
      fmt::format_to(std::back_inserter(text), "{}(O{},N{},B{})\n", predicate, o + 1, n + 1, bit);
  }
}

LearnedWeights failed(Termination termination, std::string message) {
  LearnedWeights out;
  out.termination = termination;
  out.message = std::move(message);
  return out;
}

}  // namespace

void IdentityTrainingData::add(const KnownStep& step) {
  if (step.in_view.empty() || step.grades.empty()) return;
  ++steps_;
  if (!text_.empty()) text_ += "---\n";
  const auto out = std::back_inserter(text_);
  const std::size_t news = step.grades.size() / step.in_view.size();
  for (std::size_t o = 0; o < step.in_view.size(); ++o) {
    if (step.in_view[o]) fmt::format_to(out, "seesPlace(O{})\n", o + 1);
    for (std::size_t n = 0; n < news; ++n) {
      const std::size_t pair = o * news + n;
      fmt::format_to(out, "is(O{},N{},{})\n", o + 1, n + 1, step.truth[pair]);
      write_bits(text_, "similarOdds", o, n, step.grades[pair].similar);
      write_bits(text_, "proximityOdds", o, n, step.grades[pair].proximity);
    }
  }
}

LearnedWeights learn_identity_weights(const IdentityTrainingData& data, const WeightLearning& how, Monitor& monitor) {
  Diagnostics diagnostics;
  const auto model = parse_model(identity_learning_model(), "learning.mln", diagnostics);
  if (!model) return failed(Termination::kRefused, "learning.mln is not a model");
  const auto databases = parse_evidence(*model, data.text(), "training", diagnostics);
  if (!databases) return failed(Termination::kRefused, "the training data is not evidence");
  LearningOptions options;
  options.method = how.method;
  options.threads = how.threads;
  options.max_seconds = how.max_seconds;
  options.discriminative.push_back(*model->find_predicate("is"));
  const LearningResult learned = learn(*model, *databases, options, monitor);
  LearnedWeights out;
  if (learned.termination != Termination::kCompleted || learned.weights.size() < out.weights.size()) {
    return failed(learned.termination, "learning: " + learned.message);
  }
  const std::size_t first = learned.weights.size() - out.weights.size();
  for (std::size_t i = 0; i < out.weights.size(); ++i) out.weights[i] = learned.weights[first + i].weight;
  out.objective = learned.objective.value_or(0);
  out.iterations = learned.iterations;
  return out;
}

std::string with_identity_weights(std::string_view model, const IdentityWeights& weights) {
  std::vector<std::string> lines;
  for (std::size_t begin = 0; begin < model.size();) {
    const std::size_t end = std::min(model.find('\n', begin), model.size());
    lines.emplace_back(model.substr(begin, end - begin));
    begin = end + 1;
  }
  std::string text;
  for (std::size_t i = 0; i < lines.size(); ++i) {
    if (i + weights.size() >= lines.size()) {
      lines[i] = fmt::format("{}{}", weights[i + weights.size() - lines.size()], lines[i].substr(lines[i].find(' ')));
    }
    text += lines[i] + "\n";
  }
  return text;
}

}  // namespace sherlog
