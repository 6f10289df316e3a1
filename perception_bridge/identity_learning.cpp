#include "perception_bridge/identity_learning.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <iterator>

#include "mln/evidence.h"
#include "perception_bridge/shipped_models.h"

namespace sherlog {
namespace {

constexpr double kLeastOdds = -20, kMostOdds = 43, kStep = 0.125;  // what nine bits of learning.mln hold
constexpr std::size_t kBits = 9;

// Mean squares of what differs between the two looks at an object that stayed where and what it was.
struct Differences {
  double color = 0, position = 0;
  std::uint64_t colors = 0, positions = 0;

  void add(const FourTablesTrial& trial) {
    for (std::size_t n = 0; n < trial.new_clusters.size(); ++n) {
      if (!trial.truth.association[n]) continue;
      const std::uint32_t o = *trial.truth.association[n];
      if (trial.truth.explanation[o] != ClusterExplanation::kStay) continue;
      const Observation &old = trial.old_clusters[o], &now = trial.new_clusters[n];
      for (std::size_t c = 0; c < old.color.size(); ++c) {
        // At the ends of the range a measurement says less than its noise.
        if (!inside(old.color[c], 1) || !inside(now.color[c], 1)) continue;
        color += (old.color[c] - now.color[c]) * (old.color[c] - now.color[c]);
        ++colors;
      }
      const Position size = {trial.config.table_width, trial.config.table_depth};
      for (std::size_t a = 0; a < size.size(); ++a) {
        if (!inside(old.position[a], size[a]) || !inside(now.position[a], size[a])) continue;
        position += (old.position[a] - now.position[a]) * (old.position[a] - now.position[a]);
        ++positions;
      }
    }
  }
  static bool inside(double x, double most) { return x > 0 && x < most; }
};

void write_bits(std::string& text, const char* predicate, std::size_t o, std::size_t n, double grade) {
  const double odds = std::clamp(std::log(grade / (1 - grade)), kLeastOdds, kMostOdds);
  const auto number = static_cast<std::uint32_t>(std::lround((odds - kLeastOdds) / kStep));
  for (std::size_t bit = 0; bit < kBits; ++bit) {
    if ((number >> bit & 1u) != 0)
      fmt::format_to(std::back_inserter(text), "{}(O{},N{},B{})\n", predicate, o + 1, n + 1, bit);
  }
}

std::string training_database(const FourTablesTrial& trial, const Grading& grading) {
  std::string text;
  const auto out = std::back_inserter(text);
  for (std::size_t o = 0; o < trial.old_clusters.size(); ++o) {
    const Observation& old = trial.old_clusters[o];
    if (old.place_in_view) fmt::format_to(out, "seesPlace(O{})\n", o + 1);
    for (std::size_t n = 0; n < trial.new_clusters.size(); ++n) {
      const bool same = trial.truth.association[n] == static_cast<std::uint32_t>(o);
      fmt::format_to(out, "is(O{},N{},{})\n", o + 1, n + 1, same ? to_string(trial.truth.explanation[o]) : "not");
      const PairGrade grade = grade_pair(old, trial.new_clusters[n], trial, grading);
      write_bits(text, "similarOdds", o, n, grade.similar);
      write_bits(text, "proximityOdds", o, n, grade.proximity);
    }
  }
  return text;
}

LearnedIdentity failed(Termination termination, std::string message) {
  LearnedIdentity out;
  out.termination = termination;
  out.message = std::move(message);
  return out;
}

}  // namespace

std::string with_identity_weights(std::string_view model, const std::array<double, 6>& weights) {
  // The weighted formulas are the last six lines.
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

LearnedIdentity learn_identity(const IdentityTraining& training, Monitor& monitor) {
  const auto start = std::chrono::steady_clock::now();
  if (training.actions.empty() || training.trials == 0)
    return failed(Termination::kRefused, "there are no training trials");
  std::vector<FourTablesTrial> trials;
  Differences differences;
  for (std::uint64_t number = 0; number < training.trials; ++number) {
    FourTablesConfig config = training.config;
    config.actions = training.actions[number % training.actions.size()];
    trials.push_back(simulate_four_tables(config, training.seed, number));
    differences.add(trials.back());
  }
  if (differences.colors == 0 || differences.positions == 0) {
    return failed(Termination::kRefused, "no object stayed in any training trial: the sigmas cannot be estimated");
  }
  LearnedIdentity out;
  out.grading.kind = Grading::Kind::kOdds;
  out.grading.sigma_color = std::sqrt(differences.color / static_cast<double>(differences.colors) / 2);
  out.grading.sigma_position = std::sqrt(differences.position / static_cast<double>(differences.positions) / 2);

  Diagnostics diagnostics;
  const auto model = parse_model(identity_learning_model(), "learning.mln", diagnostics);
  if (!model) return failed(Termination::kRefused, "learning.mln is not a model");
  std::string text;
  for (const FourTablesTrial& trial : trials) {
    if (trial.new_clusters.empty() || trial.old_clusters.empty()) continue;  // they say nothing about pairs
    if (!text.empty()) text += "---\n";
    text += training_database(trial, out.grading);
  }
  const auto databases = parse_evidence(*model, text, "training", diagnostics);
  if (!databases) return failed(Termination::kRefused, "the training data is not evidence");
  LearningOptions options;
  options.method = training.method;
  options.threads = training.threads;
  options.max_seconds = training.max_seconds;
  options.discriminative.push_back(*model->find_predicate("is"));
  const LearningResult learned = learn(*model, *databases, options, monitor);
  if (learned.termination != Termination::kCompleted || learned.weights.size() < out.weights.size()) {
    return failed(learned.termination, "learning: " + learned.message);
  }
  const std::size_t first = learned.weights.size() - out.weights.size();
  for (std::size_t i = 0; i < out.weights.size(); ++i) out.weights[i] = learned.weights[first + i].weight;
  out.objective = learned.objective.value_or(0);
  out.iterations = learned.iterations;
  out.model = with_identity_weights(learned_identity_model(), out.weights);
  out.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return out;
}

}  // namespace sherlog
