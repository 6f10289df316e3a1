#include "rgbd/pipeline/truth.h"

#include <algorithm>

namespace sherlog::rgbd {

const Entity* entity_of(const Hypothesis& thing, const TrueFrame& truth) {
  std::map<std::size_t, std::size_t> votes;
  for (int y = 0; y < thing.roi.height; ++y) {
    for (int x = 0; x < thing.roi.width; ++x) {
      if (thing.mask(y, x) != 0) ++votes[truth.entities(y + thing.roi.y, x + thing.roi.x)];
    }
  }
  const auto most = std::ranges::max_element(votes, {}, [](const auto& vote) { return vote.second; });
  if (most == votes.end() || most->first == 0) return nullptr;
  const Entity& entity = truth.scene.entities[most->first - 1];
  return entity.kind == EntityKind::kObject ? &entity : nullptr;
}

void add_labels(Perceived& perceived, const TrueFrame& truth) {
  const auto* found = perceived.analysis.view<Hypotheses>("things");
  if (found == nullptr) return;
  for (std::size_t i = 0; i < std::min(found->things.size(), perceived.scene.clusters.size()); ++i) {
    const Entity* entity = entity_of(found->things[i], truth);
    if (entity == nullptr) continue;
    perceived.scene.clusters[i].annotations.push_back(
        make_annotation("rs.annotation.GroundTruth", "truth",
                        {{"object", Value(entity->name)},
                         {"classificationGT", Value(Value::Object{{"classname", Value(entity->object_class)}})}}));
  }
}

std::map<std::string, std::string> true_names(const Perceived& perceived, const TrueFrame& truth) {
  std::map<std::string, std::string> names;
  const auto* found = perceived.analysis.view<Hypotheses>("things");
  if (found == nullptr) return names;
  for (std::size_t i = 0; i < std::min(found->things.size(), perceived.scene.clusters.size()); ++i) {
    const Entity* entity = entity_of(found->things[i], truth);
    if (entity != nullptr) names[perceived.scene.clusters[i].id] = entity->name;
  }
  return names;
}

std::vector<bool> can_be_seen(const TrueFrame& truth) {
  std::vector<std::size_t> pixels(truth.scene.entities.size() + 1);
  for (const std::uint16_t entity : truth.entities) ++pixels[entity];
  std::vector<bool> seen;
  for (std::size_t i = 1; i < pixels.size(); ++i) seen.push_back(pixels[i] >= kEnoughPixels);
  return seen;
}

void BeliefLog::add(const Perceived& perceived, const TrueFrame& truth, const TrackingStep& step) {
  const auto names = true_names(perceived, truth);
  for (auto& [name, history] : histories_) history.now.clear();
  for (const TrackingStep::ClusterBelief& belief : step.clusters) {
    const auto name = names.find(belief.cluster);
    if (name == names.end()) continue;
    History& history = histories_[name->second];
    if (history.first.empty()) history.first = belief.object;
    history.now = belief.object;
    history.explanations.push_back(belief.explanation);
  }
  there_.clear();
  const std::vector<bool> seen = can_be_seen(truth);
  for (std::size_t i = 0; i < truth.scene.entities.size(); ++i) {
    const Entity& entity = truth.scene.entities[i];
    if (entity.kind == EntityKind::kObject) there_[entity.name] = seen[i];
  }
}

std::vector<ObjectBelief> BeliefLog::compare(const std::vector<TrackedObject>& objects) const {
  using Truth = ObjectBelief::Truth;
  std::vector<ObjectBelief> rows;
  for (const auto& [name, history] : histories_) {
    ObjectBelief row{.object = name, .first = history.first, .now = history.now, .explanations = history.explanations};
    const auto there = there_.find(name);
    row.truth = there == there_.end() ? Truth::kGone : there->second ? Truth::kSeen : Truth::kCovered;
    const auto object =
        std::ranges::find(objects, history.first, [](const TrackedObject& tracked) { return tracked.identity.id; });
    row.has_disappeared = object != objects.end() && object->identity.disappeared;
    const bool is_found = row.truth == Truth::kSeen || !row.now.empty();
    row.is_right = row.truth == Truth::kGone ? row.has_disappeared
                   : is_found                ? row.now == row.first
                                             : !row.has_disappeared;
    rows.push_back(std::move(row));
  }
  return rows;
}

}  // namespace sherlog::rgbd
