// Second thoughts: what a new scene says about the open questions of earlier ones.
//
// Idea      An object's sightings are a chain, and an open question is a link of it that could have been another one. If the
//           question is answered otherwise, each chain is cut at that scene and the ends change owners: all at a time, so that
//           two cups that were confused exchange everything since. An end that goes to no known object is a new object; an object
//           of which nothing is left was none.
#include <algorithm>
#include <map>

#include "perception_bridge/scene_tracker.h"

namespace sherlog {

// The question of an earlier scene, asked again.
struct SceneTracker::Answered {
  Resolution resolution;
  std::vector<std::optional<double>> probability;  // by cluster; nothing of the most probable world
  std::vector<bool> open;                          // by cluster
};

struct SceneTracker::Change {
  std::size_t cluster = 0;
  std::string was, is;  // `is` empty: a new object
  std::optional<double> probability;
  std::string explanation;
};

// What belongs to an object from a scene on.
struct SceneTracker::Tail {
  std::vector<Sighting> sightings;
  Cluster look;
  bool was_seen = false, in_view = false, disappeared = false;
};

namespace {

Value revision_record(const TrackingStep::Revision& revision, const std::string& decided_by) {
  Value::Object record = {{"scene", Value(revision.scene)},
                          {"cluster", Value(revision.cluster)},
                          {"was", Value(revision.was)},
                          {"is", Value(revision.is)},
                          {"decidedBy", Value(decided_by)}};
  if (revision.probability) record.emplace_back("probability", Value(*revision.probability));
  return Value(std::move(record));
}

void keep_record(Identity& identity, const Value& record) {
  for (auto& [key, value] : identity.other) {
    if (key != "revisions" || value.list() == nullptr) continue;
    value.list()->push_back(record);
    return;
  }
  identity.other.emplace_back("revisions", Value(Value::List{record}));
}

}  // namespace

// Completes the question's looks by what the scene shows of the same things, where it is clear that they are the same.
bool SceneTracker::gains(OpenQuestion& question, std::size_t position, const Scene& scene) {
  bool gained = false;
  for (std::size_t n = 0; n < question.objects.size(); ++n) {
    const TrackedObject* object = find_object(question.objects[n]);
    if (object == nullptr || object->identity.sightings.empty()) continue;
    if (object->identity.sightings.back().scene != scene.id) continue;
    const bool unclear_since = std::any_of(questions_.begin() + static_cast<std::ptrdiff_t>(position) + 1,
                                           questions_.end(), [&](const OpenQuestion& later) {
                                             for (std::size_t i = 0; i < later.objects.size(); ++i) {
                                               if (later.open[i] && later.objects[i] == question.objects[n])
                                                 return true;
                                             }
                                             return false;
                                           });
    if (unclear_since) continue;
    const std::string& seen_as = object->identity.sightings.back().cluster;
    const auto cluster = std::ranges::find(scene.clusters, seen_as, &Cluster::id);
    if (cluster != scene.clusters.end() && complete_look(question.scene.clusters[n], *cluster)) gained = true;
  }
  return gained;
}

std::vector<SceneTracker::Change> SceneTracker::changes_by(const OpenQuestion& question,
                                                           const Answered& answered) const {
  std::vector<Change> changes;
  for (std::size_t n = 0; n < question.objects.size(); ++n) {
    const auto match = answered.resolution.association[n];
    const std::string is = match ? question.olds[*match].object : "";
    const bool was_new = question.old_of(question.objects[n]) == nullptr;
    if (match ? is == question.objects[n] : was_new) continue;
    const std::string why(match ? to_string(answered.resolution.explanation[*match]) : "appear");
    changes.push_back({n, question.objects[n], is, answered.probability[n], why});
  }
  return changes;
}

// Whether every end of a chain finds a chain that is free from that scene on.
bool SceneTracker::possible(const OpenQuestion& question, const std::vector<Change>& changes) {
  for (const Change& change : changes) {
    const TrackedObject* source = find_object(change.was);
    if (source == nullptr) return false;
    const auto of_scene = [&](const Sighting& sighting) { return sighting.scene == question.scene.id; };
    if (std::ranges::none_of(source->identity.sightings, of_scene)) return false;
    if (change.is.empty()) continue;
    const TrackedObject* target = find_object(change.is);
    if (target == nullptr) return false;
    const bool is_cut = std::ranges::find(changes, change.is, &Change::was) != changes.end();
    if (!is_cut && target->identity.sightings.back().time >= question.scene.timestamp) return false;
  }
  return true;
}

SceneTracker::Tail SceneTracker::cut_tail(const OpenQuestion& question, const std::string& name, const Scene& scene,
                                          TrackingStep& step) {
  TrackedObject& object = *find_object(name);
  Identity& identity = object.identity;
  Tail tail;
  tail.look = std::move(object.cluster);
  tail.was_seen = identity.was_seen;
  tail.in_view = identity.in_view;
  tail.disappeared = identity.disappeared;
  const auto first = std::ranges::find(identity.sightings, question.scene.id, &Sighting::scene);
  tail.sightings.assign(first, identity.sightings.end());
  identity.sightings.erase(first, identity.sightings.end());
  if (const OpenQuestion::Old* old = question.old_of(name); old != nullptr && !identity.sightings.empty()) {
    // As if it had not been seen since.
    object.cluster = old->look;
    identity.last_seen = identity.sightings.back().time;
    identity.was_seen = false;
    identity.in_view = !out_of_view_of({&object.cluster, 1}, scene).front();
    identity.disappeared = !old->out_of_view || identity.in_view;
    std::erase(step.disappeared, name);
    std::erase(step.hidden, name);
    (identity.in_view ? step.disappeared : step.hidden).push_back(name);
  }
  return tail;
}

// The tail goes to the object of the change, which is made where there is none.
void SceneTracker::hand_over(const OpenQuestion& question, Change& change, Tail tail, const Scene& scene,
                             TrackingStep& step) {
  if (change.is.empty()) {
    TrackedObject fresh;
    fresh.identity.id = change.is = new_name();
    objects_.push_back(std::move(fresh));
  }
  TrackedObject& object = *find_object(change.is);
  Identity& identity = object.identity;
  tail.sightings.front().probability = change.probability;
  tail.sightings.front().explanation = change.explanation;
  identity.sightings.insert(identity.sightings.end(), tail.sightings.begin(), tail.sightings.end());
  identity.last_seen = identity.sightings.back().time;
  identity.was_seen = tail.was_seen;
  identity.in_view = tail.in_view;
  identity.disappeared = tail.disappeared;
  const OpenQuestion::Old* old = question.old_of(change.is);
  object.cluster = old == nullptr ? std::move(tail.look) : merged_look(old->look, std::move(tail.look));
  std::erase(step.disappeared, change.is);
  std::erase(step.hidden, change.is);
  if (identity.sightings.back().scene != scene.id)
    (identity.in_view ? step.disappeared : step.hidden).push_back(change.is);
}

// In what came after the question, and in its records.
void SceneTracker::rename_since(std::size_t position, const std::vector<Change>& changes, TrackingStep& step) {
  std::map<std::string, std::string> now_called;
  for (const Change& change : changes) now_called[change.was] = change.is;
  const auto rename = [&](std::string& name) {
    if (const auto other = now_called.find(name); other != now_called.end()) name = other->second;
  };
  for (TrackingStep::ClusterBelief& entry : step.clusters) {
    rename(entry.object);
    for (TrackingStep::Candidate& other : entry.others) rename(other.object);
  }
  for (std::size_t later = position + 1; later < questions_.size(); ++later) {
    for (OpenQuestion::Old& old : questions_[later].olds) rename(old.object);
    for (std::string& name : questions_[later].objects) rename(name);
  }
}

void SceneTracker::revise(std::size_t position, std::vector<Change> changes, const Scene& scene, TrackingStep& step) {
  OpenQuestion& question = questions_[position];
  std::vector<Tail> tails;
  tails.reserve(changes.size());
  for (const Change& change : changes) tails.push_back(cut_tail(question, change.was, scene, step));
  for (std::size_t i = 0; i < changes.size(); ++i) {
    hand_over(question, changes[i], std::move(tails[i]), scene, step);
    question.objects[changes[i].cluster] = changes[i].is;
  }
  for (const Change& change : changes) {
    step.revisions.push_back(
        {question.scene.id, question.scene.clusters[change.cluster].id, change.was, change.is, change.probability});
    const Value record = revision_record(step.revisions.back(), scene.id);
    for (const std::string& name : {change.is, change.was}) keep_record(find_object(name)->identity, record);
  }
  rename_since(position, changes, step);
  for (const Change& change : changes) {
    if (!find_object(change.was)->identity.sightings.empty()) continue;
    removed_.push_back(change.was);
    std::erase(step.disappeared, change.was);
    std::erase(step.hidden, change.was);
    if (arbiter_) arbiter_->forget(change.was);
  }
  std::erase_if(objects_, [](const TrackedObject& object) { return object.identity.sightings.empty(); });
  for (const Change& change : changes) {
    for (const std::string& name : {change.was, change.is}) relearn(name);
  }
}

// The trackers forget what they saw of it under other assumptions.
void SceneTracker::relearn(const std::string& name) {
  const TrackedObject* object = find_object(name);
  if (!arbiter_ || object == nullptr) return;
  arbiter_->forget(name);
  arbiter_->resume(name, object->cluster);
}

// What is clear now: the object has again what was known of it before.
void SceneTracker::settle(OpenQuestion& question, const Answered& answered) {
  for (std::size_t n = 0; n < question.objects.size(); ++n) {
    if (!question.open[n] || answered.open[n]) continue;
    question.open[n] = false;
    TrackedObject* object = find_object(question.objects[n]);
    if (object == nullptr) continue;
    for (Sighting& sighting : object->identity.sightings) {
      if (sighting.scene != question.scene.id) continue;
      sighting.probability = answered.probability[n];
      const auto match = answered.resolution.association[n];
      sighting.explanation = match ? to_string(answered.resolution.explanation[*match]) : "appear";
    }
    if (const OpenQuestion::Old* old = question.old_of(question.objects[n]))
      object->cluster = merged_look(old->look, std::move(object->cluster));
    relearn(question.objects[n]);
  }
}

void SceneTracker::reconsider(const Scene& scene, TrackingStep& step, Monitor& monitor) {
  for (std::size_t position = 0; position < questions_.size(); ++position) {
    OpenQuestion& question = questions_[position];
    if (question.scene.id == scene.id) continue;
    const std::vector<Cluster> known = question.scene.clusters;
    if (!gains(question, position, scene)) continue;
    const std::vector<Cluster> olds = question.old_looks();
    const AssociationQuestion::Answer answer = question_.ask(olds, question.scene, monitor);
    if (answer.termination != Termination::kCompleted) {
      question.scene.clusters = known;  // for the next time
      continue;
    }
    Answered answered;
    answered.resolution = decide(answer.belief, question.out_of_view());
    bool clear = true;
    for (std::size_t n = 0; n < question.objects.size(); ++n) {
      const auto match = answered.resolution.association[n];
      double rival = match ? answer.belief.appeared(n) : 0;
      for (std::size_t o = 0; o < olds.size(); ++o) {
        if (!match || *match != o) rival = std::max(rival, answer.belief.same(o, n));
      }
      const double probability =
          std::clamp(match ? answer.belief.same(*match, n) : answer.belief.appeared(n), 0.0, 1.0);
      answered.probability.push_back(answer.is_world ? std::nullopt : std::optional(probability));
      answered.open.push_back(is_open(probability, rival));
    }
    const std::vector<Change> changes = changes_by(question, answered);
    for (const Change& change : changes)
      clear = clear && !answered.open[change.cluster] && change.probability.value_or(1) >= options_.settled;
    if (!clear || !possible(question, changes)) continue;
    if (!changes.empty()) revise(position, changes, scene, step);
    settle(question, answered);
  }
  std::erase_if(questions_, [](const OpenQuestion& question) {
    return std::ranges::find(question.open, true) == question.open.end();
  });
}

}  // namespace sherlog
