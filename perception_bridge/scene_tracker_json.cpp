// The tracker's documents: what one scene did, and what it needs to go on later.
#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <map>

#include "perception_bridge/scene_tracker.h"

namespace sherlog {

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
    Value::Object cluster = {
        {"cluster", Value(entry.cluster)}, {"object", Value(entry.object)}, {"explanation", Value(entry.explanation)}};
    if (entry.probability) cluster.emplace_back("probability", Value(*entry.probability));
    cluster.emplace_back("others", Value(std::move(others)));
    if (step.verdict) {
      Value::Object votes;
      for (const auto& [tracker, track] : entry.votes) votes.emplace_back(tracker, track ? Value(*track) : Value());
      cluster.emplace_back("votes", Value(std::move(votes)));
    }
    clusters.emplace_back(std::move(cluster));
  }
  Value::Object document = {{"method", Value(step.method)}};
  if (step.verdict) document.emplace_back("verdict", Value(std::string(to_string(*step.verdict))));
  if (!step.reason.empty()) document.emplace_back("reason", Value(step.reason));
  document.emplace_back("clusters", Value(std::move(clusters)));
  document.emplace_back("disappeared", names(step.disappeared));
  document.emplace_back("hidden", names(step.hidden));
  if (!step.revisions.empty()) {
    Value::List revisions;
    for (const TrackingStep::Revision& revision : step.revisions) {
      Value::Object entry = {{"scene", Value(revision.scene)},
                             {"cluster", Value(revision.cluster)},
                             {"was", Value(revision.was)},
                             {"is", Value(revision.is)}};
      if (revision.probability) entry.emplace_back("probability", Value(*revision.probability));
      revisions.emplace_back(std::move(entry));
    }
    document.emplace_back("revisions", Value(std::move(revisions)));
  }
  return Value(std::move(document));
}

Value SceneTracker::state() const {
  Value::List objects, questions;
  for (const TrackedObject& object : objects_) {
    objects.emplace_back(
        Value::Object{{"id", Value(object.identity.id)}, {"look", designator_to_json(object.cluster)}});
  }
  for (const OpenQuestion& question : questions_) questions.push_back(question_to_json(question));
  Value::Object document = {
      {"names", Value(names_)}, {"objects", Value(std::move(objects))}, {"questions", Value(std::move(questions))}};
  if (last_time_) document.emplace_back("lastTime", Value(*last_time_));
  return Value(std::move(document));
}

bool SceneTracker::restore(const Value& state, std::string& problem) {
  const Value* objects = state.find("objects");
  const Value* questions = state.find("questions");
  const Value* names = state.find("names");
  const Value* time = state.find("lastTime");
  const std::int64_t count = names == nullptr ? -1 : names->whole_number().value_or(-1);
  if (objects == nullptr || objects->list() == nullptr || questions == nullptr || questions->list() == nullptr ||
      count < 0) {
    problem = "the tracker's state is not as it was written";
    return false;
  }
  std::vector<std::pair<std::string, Cluster>> looks;
  SceneMessages messages;
  constexpr SceneLimits kNoLimits{std::numeric_limits<std::size_t>::max(), std::numeric_limits<std::size_t>::max()};
  for (const Value& item : *objects->list()) {
    const Value* id = item.find("id");
    const Value* document = item.find("look");
    auto look = document == nullptr ? std::nullopt : designator_from_json(*document, messages, kNoLimits);
    if (id == nullptr || id->text() == nullptr || !look) {
      problem = "an object in the tracker's state is not as it was written";
      return false;
    }
    looks.emplace_back(*id->text(), std::move(*look));
  }
  std::vector<OpenQuestion> open;
  for (const Value& item : *questions->list()) {
    auto question = question_from_json(item, problem);
    if (!question) return false;
    open.push_back(std::move(*question));
  }
  for (auto& [id, look] : looks) {
    TrackedObject* object = find_object(id);
    if (object == nullptr) continue;  // somebody took it out of the store
    object->cluster = std::move(look);
    relearn(id);
  }
  std::map<std::string, std::size_t> place;
  for (const auto& [id, look] : looks) place.emplace(id, place.size());
  const auto position_in_state = [&](const TrackedObject& object) {
    const auto found = place.find(object.identity.id);
    return found == place.end() ? place.size() : found->second;
  };
  std::ranges::stable_sort(objects_, {}, position_in_state);  // those that came since are the last
  questions_ = std::move(open);
  names_ = std::max(names_, static_cast<std::uint64_t>(count));
  if (time != nullptr && time->number()) last_time_ = std::max(last_time_.value_or(*time->number()), *time->number());
  return true;
}

}  // namespace sherlog
