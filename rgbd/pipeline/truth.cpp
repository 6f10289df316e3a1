#include "rgbd/pipeline/truth.h"

#include <algorithm>
#include <map>

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

}  // namespace sherlog::rgbd
