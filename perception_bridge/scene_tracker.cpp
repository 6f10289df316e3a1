#include "perception_bridge/scene_tracker.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <chrono>

#include "perception_bridge/annotation_types.h"

namespace sherlog {
namespace {

constexpr double kWorthNaming = 0.01;

// As it was meant where it was said: what does not name its frame is in that of its cluster.
Annotation carried(const Cluster& from, const Cluster& to, Annotation annotation) {
  if (!annotation.frame && from.frame != to.frame) annotation.frame = from.frame;
  return annotation;
}

std::string lower(std::string text) {
  std::ranges::transform(text, text.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return text;
}

}  // namespace

Cluster merged_look(const Cluster& earlier, Cluster later) {
  const bool is_located = position_of(later).has_value();
  const auto replaced = [&](const Annotation& old_one, const std::vector<Annotation>& fresh) {
    return std::any_of(fresh.begin(), fresh.end(), [&](const Annotation& annotation) {
      return annotation.type == old_one.type && annotation.source == old_one.source;
    });
  };
  const std::vector<Annotation> fresh = later.annotations;
  for (const Annotation& annotation : earlier.annotations) {
    if (is_located && is_of_the_moment(annotation.type)) continue;  // whoever said it, and in whatever words
    if (!replaced(annotation, fresh)) later.annotations.push_back(carried(earlier, later, annotation));
  }
  if (is_located) return later;
  for (const ObjectHypothesis* points : annotations_of(earlier.hypotheses, "rs.scene.ClusterPoints"))
    later.hypotheses.push_back(carried(earlier, later, *points));
  return later;
}

SceneTracker::SceneTracker(AssociationQuestion question, TrackerOptions options)
    : question_(std::move(question)), options_(std::move(options)) {}

std::optional<SceneTracker> SceneTracker::make(Model model, EvidenceMapping mapping, InferenceOptions inference,
                                               TrackerOptions options, std::string& problem) {
  auto question = AssociationQuestion::make(std::move(model), std::move(mapping), std::move(inference), problem);
  if (!question) return std::nullopt;
  return SceneTracker(std::move(*question), std::move(options));
}

void SceneTracker::use_arbiter(TrackingArbiter arbiter) {
  arbiter_ = std::move(arbiter);
  for (const TrackedObject& object : objects_) arbiter_->resume(object.identity.id, object.cluster);
}

std::optional<ArbiterCounts> SceneTracker::arbiter_counts() const {
  return arbiter_ ? std::optional(arbiter_->counts()) : std::nullopt;
}

std::string SceneTracker::new_name() {
  for (;;) {
    std::string name = fmt::format("{}{}", options_.prefix, ++names_);
    const bool taken = std::any_of(objects_.begin(), objects_.end(),
                                   [&](const TrackedObject& object) { return object.identity.id == name; });
    if (!taken && !taken_.contains(lower(name))) return name;
  }
}

void SceneTracker::avoid(const std::vector<std::string>& names) {
  for (const std::string& name : names) taken_.insert(lower(name));
}

void SceneTracker::resume(Identity identity, Cluster cluster, double time) {
  last_time_ = std::max(last_time_.value_or(time), time);
  if (arbiter_) arbiter_->resume(identity.id, cluster);
  objects_.push_back({std::move(identity), std::move(cluster)});
}

TrackedObject* SceneTracker::find_object(const std::string& name) {
  for (TrackedObject& object : objects_) {
    if (object.identity.id == name) return &object;
  }
  return nullptr;
}

SceneTracker::Candidates SceneTracker::candidates_of(const Scene& scene) const {
  Candidates candidates;
  for (std::size_t i = 0; i < objects_.size(); ++i) {
    if (scene.timestamp - objects_[i].identity.last_seen > options_.forget_seconds) continue;
    candidates.objects.push_back(i);
    candidates.names.push_back(objects_[i].identity.id);
    candidates.looks.push_back(objects_[i].cluster);
  }
  candidates.out_of_view = out_of_view_of(candidates.looks, scene);
  return candidates;
}

// Nothing where the model has to be asked.
std::optional<SceneTracker::Finding> SceneTracker::arbitrate(const Scene& scene, const Candidates& candidates,
                                                             TrackingStep& step) const {
  if (!arbiter_) return std::nullopt;
  Judgement judgement = arbiter_->judge(scene, candidates.names, candidates.out_of_view);
  step.verdict = judgement.verdict;
  step.reason = judgement.reason;
  for (std::size_t n = 0; n < scene.clusters.size(); ++n) step.clusters[n].votes = std::move(judgement.votes[n]);
  if (judgement.verdict != Verdict::kAgreed) return std::nullopt;
  step.method = "arbiter";
  Finding finding;
  finding.probability.assign(judgement.probability.begin(), judgement.probability.end());
  finding.open.assign(scene.clusters.size(), false);
  finding.others.resize(scene.clusters.size());
  finding.resolution.association.resize(scene.clusters.size());
  for (const bool out_of_view : candidates.out_of_view) {
    finding.resolution.explanation.push_back(out_of_view ? ClusterExplanation::kHidden
                                                         : ClusterExplanation::kDisappear);
  }
  for (std::size_t n = 0; n < scene.clusters.size(); ++n) {
    if (const auto o = judgement.association[n]) {
      finding.resolution.association[n] = static_cast<std::uint32_t>(*o);
      finding.resolution.explanation[*o] = ClusterExplanation::kStay;
    }
  }
  return finding;
}

// Nothing where it has no answer; the step says why.
std::optional<SceneTracker::Finding> SceneTracker::ask_model(const Scene& scene, const Candidates& candidates,
                                                             TrackingStep& step, Monitor& monitor) const {
  AssociationQuestion::Answer answer = question_.ask(candidates.looks, scene, monitor);
  step.evidence = std::move(answer.evidence);
  step.termination = answer.termination;
  step.message = answer.message;
  step.method = answer.method;
  step.contradiction = answer.contradiction;
  if (answer.termination != Termination::kCompleted) return std::nullopt;
  const IdentityBelief& belief = answer.belief;
  Finding finding;
  finding.resolution = decide(belief, candidates.out_of_view);
  for (std::size_t n = 0; n < scene.clusters.size(); ++n) {
    const auto match = finding.resolution.association[n];
    const double probability = std::clamp(match ? belief.same(*match, n) : belief.appeared(n), 0.0, 1.0);
    finding.probability.push_back(answer.is_world ? std::nullopt : std::optional(probability));
    finding.others.emplace_back();
    double rival = match ? belief.appeared(n) : 0;
    for (std::size_t o = 0; o < candidates.objects.size(); ++o) {
      if (match && *match == o) continue;
      rival = std::max(rival, belief.same(o, n));
      if (belief.same(o, n) >= kWorthNaming) finding.others.back().push_back({candidates.names[o], belief.same(o, n)});
    }
    finding.open.push_back(rival > kWorthNaming && is_open(probability, rival));
  }
  return finding;
}

void SceneTracker::take_known(const Scene& scene, const Cluster& cluster, TrackedObject& object,
                              const std::string& explanation, std::optional<double> probability, bool open) {
  object.identity.last_seen = scene.timestamp;
  object.identity.sightings.push_back({scene.id, cluster.id, scene.timestamp, probability, explanation});
  // What is said of an object must not be said of a cluster that may be another one.
  object.cluster = open ? cluster : merged_look(object.cluster, cluster);
  if (open && arbiter_) arbiter_->forget(object.identity.id);
}

TrackedObject& SceneTracker::take_new(const Scene& scene, const Cluster& cluster, std::optional<double> probability) {
  TrackedObject object;
  object.identity.id = new_name();
  object.identity.last_seen = scene.timestamp;
  object.identity.was_seen = object.identity.in_view = true;
  object.identity.sightings.push_back({scene.id, cluster.id, scene.timestamp, probability, "appear"});
  object.cluster = cluster;
  return objects_.emplace_back(std::move(object));
}

void SceneTracker::mark_unseen(const Candidates& candidates, const Finding& finding, const std::vector<bool>& seen,
                               TrackingStep& step) {
  for (std::size_t o = 0; o < candidates.objects.size(); ++o) {
    Identity& identity = objects_[candidates.objects[o]].identity;
    const bool is_hidden = !seen[o] && finding.resolution.explanation[o] == ClusterExplanation::kHidden;
    identity.was_seen = seen[o];
    identity.in_view = seen[o] || !candidates.out_of_view[o];
    // What is hidden now may have disappeared before.
    if (!is_hidden) identity.disappeared = !seen[o];
    if (!seen[o]) (is_hidden ? step.hidden : step.disappeared).push_back(identity.id);
  }
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
  const Candidates candidates = candidates_of(scene);
  if (const std::uint64_t pairs = std::uint64_t{candidates.objects.size()} * scene.clusters.size();
      pairs > options_.most_pairs) {
    step.termination = Termination::kRefused;
    step.message = fmt::format("scene '{}' has {} clusters against {} objects: {} pairs, and the limit is {}", scene.id,
                               scene.clusters.size(), candidates.objects.size(), pairs, options_.most_pairs);
    return step;
  }
  step.clusters.resize(scene.clusters.size());
  auto finding = arbitrate(scene, candidates, step);
  if (!finding) finding = ask_model(scene, candidates, step, monitor);
  if (!finding) {
    step.clusters.clear();
    return step;
  }
  last_time_ = scene.timestamp;
  for (std::size_t i = 0; i < objects_.size(); ++i) {
    if (std::ranges::binary_search(candidates.objects, i)) continue;
    objects_[i].identity.was_seen = objects_[i].identity.in_view = false;  // nobody looks for what is forgotten
  }
  std::vector<bool> seen(candidates.objects.size(), false);
  std::vector<std::string> names;
  for (std::size_t n = 0; n < scene.clusters.size(); ++n) {
    const Cluster& cluster = scene.clusters[n];
    TrackingStep::ClusterBelief& entry = step.clusters[n];
    entry.cluster = cluster.id;
    entry.probability = finding->probability[n];
    entry.others = std::move(finding->others[n]);
    if (const auto match = finding->resolution.association[n]) {
      TrackedObject& object = objects_[candidates.objects[*match]];
      seen[*match] = true;
      entry.explanation = to_string(finding->resolution.explanation[*match]);
      entry.object = object.identity.id;
      take_known(scene, cluster, object, entry.explanation, entry.probability, finding->open[n]);
    } else {
      entry.explanation = "appear";
      entry.object = take_new(scene, cluster, entry.probability).identity.id;
    }
    names.push_back(entry.object);
  }
  mark_unseen(candidates, *finding, seen, step);
  if (arbiter_) arbiter_->settle(scene, names, *step.verdict);
  if (std::ranges::find(finding->open, true) != finding->open.end()) {
    OpenQuestion question{scene, {}, std::move(names), std::move(finding->open)};
    for (std::size_t o = 0; o < candidates.objects.size(); ++o)
      question.olds.push_back({candidates.names[o], candidates.looks[o], candidates.out_of_view[o]});
    questions_.push_back(std::move(question));
    if (questions_.size() > options_.most_questions) questions_.erase(questions_.begin());
  }
  reconsider(scene, step, monitor);
  step.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return step;
}

}  // namespace sherlog
