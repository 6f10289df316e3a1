#include "perception_bridge/scene_tracker.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <chrono>

#include "perception_bridge/identity_belief.h"
#include "perception_bridge/observe.h"
#include "perception_bridge/view.h"

namespace sherlog {
namespace {

constexpr double kWorthNaming = 0.01;
constexpr std::array<const char*, 4> kAnswers = {"is", "appear", "disappear", "hidden"};
constexpr std::array<const char*, 3> kSame = {"stay", "move", "newview"};

// Position by constant; `count` for constants that are none of the clusters.
std::vector<std::size_t> positions(const Model& model, const Evidence& evidence, DomainId domain,
                                   const std::string& prefix, std::size_t count) {
  std::vector<std::size_t> by_constant(evidence.domain_size(model, domain), count);
  for (std::size_t i = 0; i < count; ++i) {
    if (const auto c = evidence.find_constant(model, domain, fmt::format("{}{}", prefix, i))) by_constant[*c] = i;
  }
  return by_constant;
}

IdentityBelief belief_of(const StandingQuestion& question, const StandingQuestion::Answer& answer,
                         const EvidenceMapping& mapping, std::size_t olds, std::size_t news) {
  IdentityBelief belief(olds, news);
  const Model& model = question.model();
  const PredicateId is = *model.find_predicate("is");
  const auto& domains = model.predicate(is).domains;
  const auto old_position = positions(model, *answer.evidence, domains[0], mapping.old_clusters.prefix, olds);
  const auto new_position = positions(model, *answer.evidence, domains[1], mapping.new_clusters.prefix, news);
  for (const StandingQuestion::Atom& atom : answer.atoms) {
    if (atom.predicate != is) continue;
    const std::size_t o = old_position[atom.arguments[0]], n = new_position[atom.arguments[1]];
    if (o >= olds || n >= news) continue;
    for (std::size_t k = 0; k < kSame.size(); ++k) {
      if (model.domain(domains[2]).find(kSame[k]) == atom.arguments[2]) belief.pair(o, n)[k] = atom.probability;
    }
  }
  return belief;
}

// New annotations replace old ones of the same type and source, others stay.
Cluster merged(const Cluster& before, Cluster now) {
  const auto replaced = [&](const Annotation& old_one, const std::vector<Annotation>& fresh) {
    return std::any_of(fresh.begin(), fresh.end(), [&](const Annotation& annotation) {
      return annotation.type == old_one.type && annotation.source == old_one.source;
    });
  };
  const std::vector<Annotation> fresh = now.annotations;
  for (const Annotation& annotation : before.annotations) {
    if (!replaced(annotation, fresh)) now.annotations.push_back(annotation);
  }
  return now;
}

}  // namespace

SceneTracker::SceneTracker(StandingQuestion question, EvidenceMapping mapping, TrackerOptions options)
    : question_(std::make_unique<StandingQuestion>(std::move(question))),
      mapping_(std::move(mapping)),
      options_(std::move(options)) {}

std::optional<SceneTracker> SceneTracker::make(Model model, EvidenceMapping mapping, InferenceOptions inference,
                                               TrackerOptions options, std::string& problem) {
  std::vector<std::string> needed(kAnswers.begin(), kAnswers.end());
  std::vector<std::string> given;
  for (const PairRule& rule : mapping.pairs) given.push_back(rule.predicate);
  if (!mapping.out_of_view.empty()) given.push_back(mapping.out_of_view);
  needed.insert(needed.end(), given.begin(), given.end());
  for (const std::string& name : needed) {
    if (model.find_predicate(name)) continue;
    problem = fmt::format("the model does not declare '{}'", name);
    return std::nullopt;
  }
  if (mapping.pairs.empty()) {
    problem = fmt::format("the mapping '{}' has no rule for pairs of clusters", mapping.name);
    return std::nullopt;
  }
  const auto& domains = model.predicate(*model.find_predicate("is")).domains;
  const bool good = domains.size() == 3 && std::all_of(kSame.begin(), kSame.end(), [&](const char* word) {
                      return model.domain(domains[2]).find(word).has_value();
                    });
  if (!good) {
    problem =
        "'is' must have three arguments: old cluster, new cluster, and an explanation that is stay, move or newview";
    return std::nullopt;
  }
  std::vector<std::string> open;
  for (const Predicate& predicate : model.predicates()) {
    if (std::find(given.begin(), given.end(), predicate.name) == given.end()) open.push_back(predicate.name);
  }
  StandingQuestion question(std::move(model), {kAnswers.begin(), kAnswers.end()}, std::move(open),
                            std::move(inference));
  return SceneTracker(std::move(question), std::move(mapping), std::move(options));
}

std::string SceneTracker::new_name() {
  for (;;) {
    std::string name = fmt::format("{}{}", options_.prefix, ++names_);
    const bool taken = std::any_of(objects_.begin(), objects_.end(),
                                   [&](const TrackedObject& object) { return object.identity.id == name; });
    if (!taken) return name;
  }
}

void SceneTracker::resume(Identity identity, Cluster cluster, double time) {
  last_time_ = std::max(last_time_.value_or(time), time);
  objects_.push_back({std::move(identity), std::move(cluster)});
}

void SceneTracker::take_new(const Scene& scene, const Cluster& cluster, double probability, TrackingStep& step) {
  TrackedObject object;
  object.identity.id = new_name();
  object.identity.last_seen = scene.timestamp;
  object.identity.was_seen = object.identity.in_view = true;
  object.identity.sightings.push_back({scene.id, cluster.id, scene.timestamp, probability, "appear"});
  object.cluster = cluster;
  step.clusters.push_back({cluster.id, object.identity.id, "appear", probability, {}});
  objects_.push_back(std::move(object));
}

TrackingStep SceneTracker::feed(const Scene& scene, Monitor& monitor) {
  const auto start = std::chrono::steady_clock::now();
  TrackingStep step;
  step.scene = scene.id;
  if (last_time_ && scene.timestamp < *last_time_) {
    step.termination = Termination::kRefused;
    step.message =
        fmt::format("scene '{}' at {} is older than the last one, at {}", scene.id, scene.timestamp, *last_time_);
    return step;
  }
  std::vector<std::size_t> candidates;
  std::vector<Cluster> olds;
  std::vector<bool> out_of_view;
  const SceneView view = view_of(scene);
  for (std::size_t i = 0; i < objects_.size(); ++i) {
    if (scene.timestamp - objects_[i].identity.last_seen > options_.forget_seconds) continue;
    candidates.push_back(i);
    olds.push_back(objects_[i].cluster);
    const auto position = position_of(objects_[i].cluster);
    out_of_view.push_back(position && !sees(view, *position));
  }
  step.evidence = evidence_text(observe_change(mapping_, olds, scene));
  const StandingQuestion::Answer answer = question_->ask(step.evidence, monitor);
  step.termination = answer.termination;
  step.message = answer.message;
  step.method = answer.method;
  if (answer.termination != Termination::kCompleted) return step;
  const IdentityBelief belief = belief_of(*question_, answer, mapping_, olds.size(), scene.clusters.size());
  const Resolution resolution = decide(belief, out_of_view);

  last_time_ = scene.timestamp;
  std::vector<bool> seen(olds.size(), false);
  for (std::size_t n = 0; n < scene.clusters.size(); ++n) {
    const Cluster& cluster = scene.clusters[n];
    const auto match = resolution.association[n];
    if (match) {
      TrackedObject& object = objects_[candidates[*match]];
      seen[*match] = true;
      const std::string explanation(to_string(resolution.explanation[*match]));
      const double probability = std::clamp(belief.same(*match, n), 0.0, 1.0);
      object.identity.last_seen = scene.timestamp;
      object.identity.sightings.push_back({scene.id, cluster.id, scene.timestamp, probability, explanation});
      object.cluster = merged(object.cluster, cluster);
      step.clusters.push_back({cluster.id, object.identity.id, explanation, probability, {}});
    } else {
      take_new(scene, cluster, std::clamp(belief.appeared(n), 0.0, 1.0), step);
    }
    for (std::size_t o = 0; o < olds.size(); ++o) {
      if ((match && *match == o) || belief.same(o, n) < kWorthNaming) continue;
      step.clusters.back().others.push_back({objects_[candidates[o]].identity.id, belief.same(o, n)});
    }
  }
  for (std::size_t o = 0; o < olds.size(); ++o) {
    Identity& identity = objects_[candidates[o]].identity;
    identity.was_seen = seen[o];
    identity.in_view = seen[o] || !out_of_view[o];
    // What is hidden now may have disappeared before.
    if (seen[o] || !out_of_view[o]) identity.disappeared = !seen[o];
    if (!seen[o]) (out_of_view[o] ? step.hidden : step.disappeared).push_back(identity.id);
  }
  step.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return step;
}

Value step_to_json(const TrackingStep& step) {
  const auto names = [](const std::vector<std::string>& list) {
    Value::List values;
    for (const std::string& name : list) values.emplace_back(name);
    return Value(std::move(values));
  };
  Value::List clusters;
  for (const TrackingStep::ClusterBelief& entry : step.clusters) {
    Value::List others;
    for (const TrackingStep::Candidate& other : entry.others) {
      others.emplace_back(Value::Object{{"object", Value(other.object)}, {"probability", Value(other.probability)}});
    }
    clusters.emplace_back(Value::Object{{"cluster", Value(entry.cluster)},
                                        {"object", Value(entry.object)},
                                        {"explanation", Value(entry.explanation)},
                                        {"probability", Value(entry.probability)},
                                        {"others", Value(std::move(others))}});
  }
  return Value(Value::Object{{"method", Value(step.method)},
                             {"clusters", Value(std::move(clusters))},
                             {"disappeared", names(step.disappeared)},
                             {"hidden", names(step.hidden)}});
}

}  // namespace sherlog
