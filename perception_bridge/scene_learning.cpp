#include "perception_bridge/scene_learning.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "perception_bridge/annotation_types.h"
#include "perception_bridge/observe.h"
#include "perception_bridge/scene_tracker.h"
#include "perception_bridge/shipped_models.h"

namespace sherlog {
namespace {

constexpr const char* kSimilar = "similar";
constexpr const char* kProximity = "proximity";

// What was seen before, as the tracker would have it, and a scene of labelled clusters.
struct Step {
  std::vector<std::string> old_names, new_names;
  std::vector<Cluster> olds;
  Scene now;

  bool same(std::size_t o, std::size_t n) const { return old_names[o] == new_names[n]; }
};

std::vector<Step> steps_of(const std::vector<Scene>& recording) {
  std::vector<Step> steps;
  std::vector<std::string> names;
  std::vector<Cluster> looks;
  for (const Scene& scene : recording) {
    Step step{names, {}, looks, scene};
    step.now.clusters.clear();
    std::set<std::string> taken;
    for (const Cluster& cluster : scene.clusters) {
      const std::string name = true_object(cluster);
      if (name.empty() || !taken.insert(name).second) continue;
      step.new_names.push_back(name);
      step.now.clusters.push_back(cluster);
    }
    for (std::size_t n = 0; n < step.new_names.size(); ++n) {
      const auto known = std::ranges::find(names, step.new_names[n]);
      if (known == names.end()) {
        names.push_back(step.new_names[n]);
        looks.push_back(step.now.clusters[n]);
      } else {
        Cluster& look = looks[static_cast<std::size_t>(known - names.begin())];
        look = merged_look(look, step.now.clusters[n]);
      }
    }
    if (!step.olds.empty() && !step.new_names.empty()) steps.push_back(std::move(step));
  }
  return steps;
}

const PairRule* pair_rule(const EvidenceMapping& mapping, const char* predicate) {
  const auto found = std::ranges::find(mapping.pairs, predicate, &PairRule::predicate);
  return found == mapping.pairs.end() ? nullptr : &*found;
}

// Of the mapping's similarity, those that the pair rule reads.
std::vector<std::size_t> rules_of(const EvidenceMapping& mapping, const PairRule& pair) {
  std::vector<std::size_t> rules;
  for (std::size_t i = 0; i < mapping.similarity.rules.size(); ++i) {
    const std::string_view type = full_type_name(mapping.similarity.rules[i].type);
    const bool read = pair.types.empty() ||
                      std::ranges::any_of(pair.types, [&](const std::string& t) { return full_type_name(t) == type; });
    if (read) rules.push_back(i);
  }
  return rules;
}

// The spreads of what the pair rule reads, but for places.
std::string learn_looks(const std::vector<Step>& steps, LearnedScenes& out) {
  EvidenceMapping& mapping = out.mapping;
  std::vector<std::size_t> chosen;
  SimilarityConfig config;
  for (const std::size_t i : rules_of(mapping, *pair_rule(mapping, kSimilar))) {
    if (mapping.similarity.rules[i].distance == DistanceKind::kPosition) continue;
    chosen.push_back(i);
    config.rules.push_back(mapping.similarity.rules[i]);
  }
  std::vector<LabelledPair> pairs;
  for (const Step& step : steps) {
    for (std::size_t o = 0; o < step.olds.size(); ++o) {
      for (std::size_t n = 0; n < step.new_names.size(); ++n) {
        pairs.push_back(labelled_pair(config, step.olds[o], step.now.clusters[n], step.same(o, n)));
        ++(pairs.back().same ? out.same_pairs : out.other_pairs);
      }
    }
  }
  // Where one type tells the things of these recordings apart, the others would be worth nothing; elsewhere they are.
  constexpr double kPriorDeviation = 0.5;
  const SigmaLearning learned = learn_sigmas(config, pairs, kPriorDeviation);
  if (!learned.problem.empty()) return learned.problem;
  out.log_likelihood_before = learned.before;
  out.log_likelihood = learned.after;
  for (std::size_t i = 0; i < chosen.size(); ++i) mapping.similarity.rules[chosen[i]] = learned.config.rules[i];
  return {};
}

// How far two sightings of one thing are from each other, and the room (to the power of the dimensions) that there is.
struct Displacements {
  std::vector<double> distances;
  std::size_t dimensions = 0;
  double room = 1;
};

Displacements displacements_of(const std::vector<Step>& steps, const SimilarityRule& rule) {
  Displacements out;
  std::vector<double> least, most;
  for (const Step& step : steps) {
    for (std::size_t n = 0; n < step.new_names.size(); ++n) {
      const auto position = position_of(step.now.clusters[n]);
      if (!position) continue;
      if (least.empty()) least = most = position->coordinates;
      for (std::size_t a = 0; a < std::min(least.size(), position->coordinates.size()); ++a) {
        least[a] = std::min(least[a], position->coordinates[a]);
        most[a] = std::max(most[a], position->coordinates[a]);
      }
      for (std::size_t o = 0; o < step.olds.size(); ++o) {
        const auto distance =
            step.same(o, n) ? distance_between(rule, step.olds[o], step.now.clusters[n]) : std::nullopt;
        if (distance && std::isfinite(*distance)) out.distances.push_back(*distance);
      }
    }
  }
  // An axis along which nothing ever differs, as the height of a table, is still measured to a centimetre or so.
  constexpr double kLeastRoom = 0.01;
  for (std::size_t a = 0; a < least.size(); ++a) out.room *= std::max(most[a] - least[a], kLeastRoom);
  out.dimensions = least.size();
  return out;
}

// The spread of one measurement; nothing where no two sightings could be compared.
std::optional<double> learn_place(const Displacements& found) {
  if (found.distances.empty() || found.dimensions == 0) return std::nullopt;
  constexpr int kRounds = 200;
  // However exact the sensor: of a thing that something nearer covers partly, the middle is seen elsewhere.
  constexpr double kLeastSigma = 0.01;
  const auto k = static_cast<double>(found.dimensions);
  double sigma = 0.02, stayed = 0.8;
  for (int round = 0; round < kRounds; ++round) {
    const double variance = 2 * sigma * sigma;  // of the difference of two measurements
    double weight = 0, squares = 0;
    for (const double d : found.distances) {
      const double here = stayed * std::exp(-0.5 * d * d / variance) / std::pow(2 * M_PI * variance, k / 2);
      const double elsewhere = (1 - stayed) / found.room;
      const double share = here / (here + elsewhere);
      weight += share;
      squares += share * d * d;
    }
    stayed = std::clamp(weight / static_cast<double>(found.distances.size()), 0.01, 0.99);
    if (weight > 0) sigma = std::max(kLeastSigma, std::sqrt(squares / (2 * k * weight)));
  }
  return sigma;
}

// The most probable of what can have happened to a thing that is seen again.
const char* explanation_of(const PairGrade& grade, bool in_view) {
  const double s = grade.similar, p = grade.proximity;
  if (!in_view || s * (1 - p) >= std::max(s * p, (1 - s) * p)) return "move";
  return s >= 0.5 ? "stay" : "newview";
}

KnownStep known_step(const EvidenceMapping& mapping, const Step& step) {
  const std::size_t news = step.new_names.size();
  KnownStep known;
  known.in_view.assign(step.olds.size(), true);
  known.grades.resize(step.olds.size() * news);
  const auto index = [](const std::string& constant, const NamedDomain& domain) {
    return static_cast<std::size_t>(std::stoul(constant.substr(domain.prefix.size())));
  };
  for (const ObservedAtom& atom : observe_change(mapping, step.olds, step.now).atoms) {
    const std::size_t o = index(atom.arguments[0], mapping.old_clusters);
    if (atom.predicate == mapping.out_of_view) {
      known.in_view[o] = false;
      continue;
    }
    PairGrade& grade = known.grades[o * news + index(atom.arguments[1], mapping.new_clusters)];
    if (atom.predicate == kSimilar) grade.similar = atom.degree;
    if (atom.predicate == kProximity) grade.proximity = atom.degree;
  }
  for (std::size_t o = 0; o < step.olds.size(); ++o) {
    for (std::size_t n = 0; n < news; ++n) {
      known.truth.push_back(step.same(o, n) ? explanation_of(known.grades[o * news + n], known.in_view[o]) : "not");
    }
  }
  return known;
}

LearnedScenes refused(std::string message) {
  LearnedScenes out;
  out.termination = Termination::kRefused;
  out.message = std::move(message);
  return out;
}

}  // namespace

std::string true_object(const Cluster& cluster) {
  for (const Annotation* label : annotations_of(cluster.annotations, "rs.annotation.GroundTruth")) {
    if (const auto name = text_field(*label, "object"); !name.empty()) return std::string(name);
  }
  return {};
}

LearnedScenes learn_from_scenes(const SceneTraining& training, Monitor& monitor) {
  for (const char* predicate : {kSimilar, kProximity}) {
    if (pair_rule(training.mapping, predicate) != nullptr) continue;
    return refused(fmt::format("the mapping '{}' has no pair rule for '{}'", training.mapping.name, predicate));
  }
  std::vector<Step> steps;
  for (const std::vector<Scene>& recording : training.recordings) {
    for (Step& step : steps_of(recording)) steps.push_back(std::move(step));
  }
  LearnedScenes out;
  out.mapping = training.mapping;
  out.steps = steps.size();
  if (const std::string problem = learn_looks(steps, out); !problem.empty())
    return refused(fmt::format("nothing can be learned from {} labelled steps: {}", steps.size(), problem));
  for (const std::size_t i : rules_of(out.mapping, *pair_rule(out.mapping, kProximity))) {
    SimilarityRule& rule = out.mapping.similarity.rules[i];
    if (rule.distance != DistanceKind::kPosition) continue;
    rule.sigma = learn_place(displacements_of(steps, rule)).value_or(rule.sigma);
  }
  IdentityTrainingData data;
  for (const Step& step : steps) data.add(known_step(out.mapping, step));
  const LearnedWeights learned = learn_identity_weights(data, training.how, monitor);
  out.termination = learned.termination;
  out.message = learned.message;
  if (learned.termination != Termination::kCompleted) return out;
  out.weights = learned.weights;
  out.objective = learned.objective;
  out.iterations = learned.iterations;
  out.model = with_identity_weights(scenes_identity_model(), out.weights);
  return out;
}

}  // namespace sherlog
