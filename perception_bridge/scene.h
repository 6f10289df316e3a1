// What a robot saw: a scene of clusters, each with hypotheses and annotations; and their JSON.
//
// Idea      Values without logic. JSON is RoboSherlock's: a cluster is an object designator, its annotations stand under their
//           full type names, always in lists; keys that are not known stay with the value they were in.
//             {"id": "s1", "timestamp": 12.5, "identifiables": [{"id": "c0", "rs.annotation.Shape": [{"shape": "box"}]}]}
// Input     one JSON document for each scene; seconds, metres, radians; probabilities in [0, 1]
// Output    the same document again: scene_to_json(scene_from_json(x)) equals x, and the other way round
// Errors    sentences that name the cluster, the type and the field; a type that is not in the table is a warning
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "perception_bridge/value.h"

namespace sherlog {

// The longest time stamp: seconds up to the year 5138. What is above it was meant in milliseconds or nanoseconds.
inline constexpr double kLatestTime = 1e11;

struct Annotation {
  std::string type;  // as it was written: "rs.annotation.Shape"
  std::optional<std::string> id, source, frame;
  std::optional<double> timestamp;   // seconds
  std::optional<double> confidence;  // in [0, 1]
  Value::Object fields;              // all other keys, known or not

  friend bool operator==(const Annotation&, const Annotation&);
};

// A part of the data in which there may be a thing: rs.scene.ImageROI, rs.scene.ClusterPoints, ...
using ObjectHypothesis = Annotation;

struct Cluster {
  std::string id;  // unique in its scene
  std::optional<std::string> source, frame;
  std::optional<double> timestamp, confidence;
  std::vector<ObjectHypothesis> hypotheses;
  std::vector<Annotation> annotations;
  Value::Object other;  // keys that are not known
  // The document says `frame` of the scene and not of this cluster: written back there only.
  bool has_frame_of_scene = false;

  friend bool operator==(const Cluster&, const Cluster&);
};

struct Scene {
  std::string id;
  double timestamp = 0;  // seconds
  std::optional<std::string> source, frame;
  std::vector<Annotation> annotations;  // about the whole scene
  std::vector<Cluster> clusters;
  bool calls_them_clusters = false;  // the key is "clusters" and not "identifiables"
  bool has_clusters_key = true;      // false: an empty scene that does not even say so
  Value::Object other;

  friend bool operator==(const Scene&, const Scene&);
};

// Annotations of that type or one below it.
std::vector<const Annotation*> annotations_of(const std::vector<Annotation>& annotations, std::string_view type);
// The text at a field, or "".
std::string_view text_field(const Annotation& annotation, std::string_view field);

// Where the cluster is: the centre of its pose in the world, else in its camera's frame; else of its location; else of its
// points. Nothing where no annotation says it.
struct ScenePosition {
  std::vector<double> coordinates;    // metres: 2 or 3
  std::string frame;                  // empty: not said
  std::vector<double> rotation = {};  // of a pose: the quaternion x, y, z, w; else empty
};
std::optional<ScenePosition> position_of(const Cluster& cluster);
// The name of the place: of a TFLocation, else of a location.
std::string place_of(const std::vector<Annotation>& annotations);

struct SceneLimits {
  std::size_t max_clusters = 5000;       // of a scene
  std::size_t max_annotations = 10'000;  // of a cluster, or of the scene itself
};

struct SceneMessages {
  std::vector<std::string> errors, warnings;
};

std::optional<Scene> scene_from_json(const Value& document, SceneMessages& messages, const SceneLimits& limits = {});
std::optional<Cluster> designator_from_json(const Value& document, SceneMessages& messages,
                                            const SceneLimits& limits = {});
// Whether a line is an object designator and no scene: it has no list of clusters, and something that is said of a thing.
bool is_designator(const Value& document);
// A cluster that does not say its frame is in that of its scene. Done for every scene that is read.
void take_frame_of_scene(Scene& scene);
Value scene_to_json(const Scene& scene);
Value designator_to_json(const Cluster& cluster);

// The same rules for a scene that was made by a program.
std::vector<std::string> validate(const Scene& scene, const SceneLimits& limits = {});

}  // namespace sherlog
