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

constexpr double kLeastOdds = -40, kMostOdds = 87, kStep = 0.125;  // what ten bits of learning.mln hold
constexpr std::size_t kBits = 10;

double log_odds(double grade) { return std::log(grade / (1 - grade)); }

void write_choice(std::string& text, std::size_t n, const std::string& choice, double odds) {
  const auto out = std::back_inserter(text);
  fmt::format_to(out, "free(N{},{})\n", n + 1, choice);
  const auto number =
      static_cast<std::uint32_t>(std::lround((std::clamp(odds, kLeastOdds, kMostOdds) - kLeastOdds) / kStep));
  for (std::size_t bit = 0; bit < kBits; ++bit) {
    if ((number >> bit & 1u) != 0) fmt::format_to(out, "odds(N{},{},B{})\n", n + 1, choice, bit);
  }
}

// How a choice of the old cluster is called: Cstay3, Cmove3, Cnewview3.
std::string choice_of(std::string_view kind, std::size_t o) { return fmt::format("C{}{}", kind, o + 1); }

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
  const std::size_t olds = step.in_view.size(), news = step.grades.size() / olds;
  std::vector<std::size_t> owner(olds, news);  // the new cluster that is it
  for (std::size_t o = 0; o < olds; ++o) {
    for (std::size_t n = 0; n < news; ++n) {
      if (step.truth[o * news + n] != "not") owner[o] = n;
    }
    for (const char* kind : {"stay", "move", "newview"}) {
      const std::string choice = choice_of(kind, o);
      fmt::format_to(out, "kind({},{})\n{}({})\n", choice, kind, step.in_view[o] ? "placeInView" : "placeOutOfView",
                     choice);
    }
  }
  for (std::size_t n = 0; n < news; ++n) {
    std::string truth = "None";
    write_choice(text_, n, "None", 0);
    for (std::size_t o = 0; o < olds; ++o) {
      if (owner[o] != news && owner[o] != n) continue;
      const std::size_t pair = o * news + n;
      const double similar = log_odds(step.grades[pair].similar), close = log_odds(step.grades[pair].proximity);
      if (owner[o] == n) truth = choice_of(step.truth[pair], o);
      write_choice(text_, n, choice_of("move", o), similar);
      // What is out of view is not seen again at its place; in simulated data the edge of the view is not exact.
      if (!step.in_view[o] && step.truth[pair] != "stay" && step.truth[pair] != "newview") continue;
      write_choice(text_, n, choice_of("stay", o), similar + close);
      write_choice(text_, n, choice_of("newview", o), close);
    }
    fmt::format_to(out, "was(N{},{})\n", n + 1, truth);
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
  options.discriminative.push_back(*model->find_predicate("was"));
  const LearningResult learned = learn(*model, *databases, options, monitor);
  LearnedWeights out;
  if (learned.termination != Termination::kCompleted || learned.weights.size() < out.weights.size()) {
    return failed(learned.termination, "learning: " + learned.message);
  }
  const std::size_t first = learned.weights.size() - out.weights.size();
  for (std::size_t i = 0; i < out.weights.size(); ++i) out.weights[i] = learned.weights[first + i].weight;
  out.weights[4] *= -1, out.weights[5] *= -1;
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
