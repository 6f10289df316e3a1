// What synthetic frames know: the truth beside what was perceived.
//
// Idea      A thing that was found is the object that most of its pixels show. Labels are annotations like others, which no
//           annotator, mapping or model reads unless it is told to learn from them.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "perception_bridge/scene_tracker.h"
#include "rgbd/objects/hypotheses.h"
#include "rgbd/pipeline/perception.h"
#include "rgbd/synthetic/sequences.h"

namespace sherlog::rgbd {

// Nothing where its pixels show no object.
const Entity* entity_of(const Hypothesis& thing, const TrueFrame& truth);

// rs.annotation.GroundTruth for every cluster of the scene that is an object: its name and class.
void add_labels(Perceived& perceived, const TrueFrame& truth);

// True names of the clusters of a scene; those that are no object are left out.
std::map<std::string, std::string> true_names(const Perceived& perceived, const TrueFrame& truth);

// Pixels of a thing that are enough for anybody; by an entity's place in the scene, whether it has so many.
inline constexpr std::size_t kEnoughPixels = 100;
std::vector<bool> can_be_seen(const TrueFrame& truth);

// What is believed of an object in the end, and what is true.
struct ObjectBelief {
  enum class Truth : std::uint8_t { kSeen, kCovered, kGone };
  std::string object;  // its true name
  Truth truth = Truth::kGone;
  std::string first, now;  // whom it was taken for at first, and in the last scene; no text: it was not found there
  bool has_disappeared = false;           // as is believed of `first`
  std::vector<std::string> explanations;  // of its sightings, one after the other
  // It is seen under the name that it had at first; or nothing of it can be seen, and it has not disappeared; or it is gone
  // and has disappeared.
  bool is_right = false;
};

// Follows a tracker from scene to scene, with the truth beside it.
class BeliefLog {
 public:
  void add(const Perceived& perceived, const TrueFrame& truth, const TrackingStep& step);
  // Of every object that was ever found, by name.
  std::vector<ObjectBelief> compare(const std::vector<TrackedObject>& objects) const;

 private:
  struct History {
    std::string first, now;
    std::vector<std::string> explanations;
  };
  std::map<std::string, History> histories_;  // by true name
  std::map<std::string, bool> there_;         // in the last scene: whether it can be seen
};

}  // namespace sherlog::rgbd
