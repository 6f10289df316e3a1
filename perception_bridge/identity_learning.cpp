#include "perception_bridge/identity_learning.h"

#include <algorithm>
#include <chrono>
#include <cmath>

#include "perception_bridge/shipped_models.h"

namespace sherlog {
namespace {

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

KnownStep known_step(const FourTablesTrial& trial, const Grading& grading) {
  KnownStep step;
  for (std::size_t o = 0; o < trial.old_clusters.size(); ++o) {
    step.in_view.push_back(trial.old_clusters[o].place_in_view);
    for (std::size_t n = 0; n < trial.new_clusters.size(); ++n) {
      const bool same = trial.truth.association[n] == static_cast<std::uint32_t>(o);
      step.truth.push_back(same ? to_string(trial.truth.explanation[o]) : "not");
      step.grades.push_back(grade_pair(trial.old_clusters[o], trial.new_clusters[n], trial, grading));
    }
  }
  return step;
}

LearnedIdentity failed(Termination termination, std::string message) {
  LearnedIdentity out;
  out.termination = termination;
  out.message = std::move(message);
  return out;
}

}  // namespace

LearnedIdentity learn_identity(const IdentityTraining& training, Monitor& monitor) {
  const auto start = std::chrono::steady_clock::now();
  if (training.actions.empty() || training.trials == 0)
    return failed(Termination::kRefused, "there are no training trials");
  std::vector<FourTablesTrial> trials;
  Differences differences;
  const auto limit = [&] {
    const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    return monitor.interrupted()                ? Termination::kInterrupted
           : seconds > training.how.max_seconds ? Termination::kTimeLimit
                                                : Termination::kCompleted;
  };
  for (std::uint64_t number = 0; number < training.trials; ++number) {
    if (const Termination reached = limit(); reached != Termination::kCompleted)
      return failed(reached, "learning: the training trials were not all made");
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

  IdentityTrainingData data;
  for (const FourTablesTrial& trial : trials) {
    if (const Termination reached = limit(); reached != Termination::kCompleted)
      return failed(reached, "learning: the training trials were not all graded");
    data.add(known_step(trial, out.grading));
  }
  WeightLearning how = training.how;
  how.max_seconds -= std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  how.max_seconds = std::max(how.max_seconds, 0.0);
  const LearnedWeights learned = learn_identity_weights(data, how, monitor);
  if (learned.termination != Termination::kCompleted) return failed(learned.termination, learned.message);
  out.weights = learned.weights;
  out.objective = learned.objective;
  out.iterations = learned.iterations;
  out.model = with_identity_weights(learned_identity_model(), out.weights);
  out.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return out;
}

}  // namespace sherlog
