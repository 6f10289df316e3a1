#include "perception_bridge/scene.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <unordered_set>

#include "perception_bridge/annotation_types.h"

namespace sherlog {
namespace {

constexpr std::size_t kMostMessages = 20;

// --- checks, for what is read and what is made ---

std::string time_problem(double time) {
  if (!std::isfinite(time) || time < 0)
    return fmt::format("'timestamp' {} is not a number of seconds of at least 0", time);
  if (time > kLatestTime) return fmt::format("'timestamp' {} is too large for seconds", time);
  return {};
}

void check_time(const std::optional<double>& time, const std::string& where, std::vector<std::string>& errors) {
  if (!time) return;
  if (const std::string problem = time_problem(*time); !problem.empty()) errors.push_back(where + problem);
}

void check_confidence(const std::optional<double>& confidence, const std::string& where,
                      std::vector<std::string>& errors) {
  if (confidence && !(*confidence >= 0 && *confidence <= 1)) {
    errors.push_back(fmt::format("{}'confidence' {} is not in [0, 1]", where, *confidence));
  }
}

void check_annotation(const Annotation& annotation, const std::string& where, SceneMessages& messages) {
  const std::string here = fmt::format("{}{}: ", where, annotation.type);
  check_time(annotation.timestamp, here, messages.errors);
  check_confidence(annotation.confidence, here, messages.errors);
  const AnnotationType* type = find_annotation_type(annotation.type);
  if (type == nullptr) {
    messages.warnings.push_back(
        fmt::format("{}'{}' is not an annotation type that is known; it is kept as it is", where, annotation.type));
    return;
  }
  for (const std::string& problem : check_fields(*type, annotation.fields)) messages.errors.push_back(here + problem);
}

void check_annotations(const std::vector<Annotation>& annotations, const std::string& where, const SceneLimits& limits,
                       SceneMessages& messages) {
  if (annotations.size() > limits.max_annotations) {
    messages.errors.push_back(
        fmt::format("{}{} annotations; the limit is {}", where, annotations.size(), limits.max_annotations));
    return;
  }
  for (const Annotation& annotation : annotations) {
    if (messages.errors.size() >= kMostMessages) return;
    check_annotation(annotation, where, messages);
  }
}

void check_cluster(const Cluster& cluster, const SceneLimits& limits, SceneMessages& messages) {
  const std::string where = fmt::format("cluster '{}': ", cluster.id);
  if (cluster.id.empty()) messages.errors.emplace_back("a cluster's 'id' is empty");
  check_time(cluster.timestamp, where, messages.errors);
  check_confidence(cluster.confidence, where, messages.errors);
  check_annotations(cluster.hypotheses, where, limits, messages);
  check_annotations(cluster.annotations, where, limits, messages);
}

std::string too_many_clusters(const std::string& id, std::size_t count, const SceneLimits& limits) {
  return fmt::format("scene '{}' has {} clusters; the limit is {}", id, count, limits.max_clusters);
}

void check_scene(const Scene& scene, const SceneLimits& limits, SceneMessages& messages) {
  if (scene.id.empty()) messages.errors.emplace_back("the scene's 'id' is empty");
  check_time(scene.timestamp, "", messages.errors);
  if (scene.clusters.size() > limits.max_clusters) {
    messages.errors.push_back(too_many_clusters(scene.id, scene.clusters.size(), limits));
    return;
  }
  check_annotations(scene.annotations, "", limits, messages);
  std::unordered_set<std::string_view> ids;
  for (const Cluster& cluster : scene.clusters) {
    if (messages.errors.size() >= kMostMessages) return;
    if (!ids.insert(cluster.id).second) {
      messages.errors.push_back(fmt::format("two clusters have the id '{}'", cluster.id));
    }
    check_cluster(cluster, limits, messages);
  }
}

// --- reading ---

// Takes the value of a key where it is what it should be; else says so.
class KeyReader {
 public:
  KeyReader(std::string where, std::vector<std::string>& errors) : where_(std::move(where)), errors_(errors) {}

  void text(const std::string& key, const Value& value, std::optional<std::string>& target) {
    if (const std::string* text = value.text()) {
      target = *text;
    } else {
      wrong(key, value, "a text");
    }
  }
  void number(const std::string& key, const Value& value, std::optional<double>& target) {
    target = value.number();
    if (!target) wrong(key, value, "a number");
  }
  void wrong(const std::string& key, const Value& value, std::string_view wanted) {
    errors_.push_back(fmt::format("{}'{}' is {}, not {}", where_, key, value.kind(), wanted));
  }

 private:
  std::string where_;
  std::vector<std::string>& errors_;
};

Annotation read_annotation(const std::string& type, const Value::Object& object, const std::string& where,
                           SceneMessages& messages) {
  Annotation annotation;
  annotation.type = type;
  KeyReader reader(where + type + ": ", messages.errors);
  for (const auto& [key, value] : object) {
    if (key == "id") {
      reader.text(key, value, annotation.id);
    } else if (key == "source") {
      reader.text(key, value, annotation.source);
    } else if (key == "frame") {
      reader.text(key, value, annotation.frame);
    } else if (key == "timestamp") {
      reader.number(key, value, annotation.timestamp);
    } else if (key == "confidence") {
      reader.number(key, value, annotation.confidence);
    } else {
      annotation.fields.emplace_back(key, value);
    }
  }
  return annotation;
}

bool is_list_of_objects(const Value& value) {
  const Value::List* list = value.list();
  return list != nullptr && !list->empty() &&
         std::all_of(list->begin(), list->end(), [](const Value& item) { return item.object() != nullptr; });
}

// Whether the key names a list of annotations. A name with dots may be a type that only its author knows.
bool names_a_type(const std::string& key) {
  return find_annotation_type(key) != nullptr || key.find(".annotation.") != std::string::npos ||
         key.find(".scene.") != std::string::npos;
}

// What is said of whole scenes; where something is, is said of scenes and of things.
bool is_of_scenes(std::string_view type) {
  constexpr std::array<std::string_view, 8> kTypes = {
      "sherlog.annotation.Context",
      "sherlog.annotation.ViewFrustum",
      "sherlog.annotation.ViewBox",
      "rs.annotation.LoggingInformation",
      "rs.annotation.ClusterSimilaritiesMatrix",
      "rs.annotation.ClusterDistancesMatrix",
      "rs.annotation.TFLocation",
      "rs.annotation.LocationAnnotation",
  };
  return std::find(kTypes.begin(), kTypes.end(), full_type_name(type)) != kTypes.end();
}

// True where the key was a list of annotations, which now stand in `annotations` (or `hypotheses`).
bool read_annotations(const std::string& key, const Value& value, const std::string& where,
                      std::vector<Annotation>& annotations, std::vector<Annotation>& hypotheses,
                      SceneMessages& messages) {
  if (!names_a_type(key)) return false;
  if (!is_list_of_objects(value)) {
    const bool is_empty = value.list() != nullptr && value.list()->empty();
    if (find_annotation_type(key) != nullptr && !is_empty) {
      messages.errors.push_back(fmt::format("{}'{}' is {}, not a list of objects", where, key, value.kind()));
    }
    return false;  // kept as it is
  }
  auto& target = is_hypothesis_type(key) ? hypotheses : annotations;
  for (const Value& item : *value.list()) target.push_back(read_annotation(key, *item.object(), where, messages));
  return true;
}

std::optional<Cluster> read_cluster(const Value& document, const std::string& position, SceneMessages& messages) {
  const Value::Object* object = document.object();
  if (object == nullptr) {
    messages.errors.push_back(fmt::format("{} is {}, not an object", position, document.kind()));
    return std::nullopt;
  }
  std::optional<std::string> id;
  if (const Value* value = find(*object, "id")) KeyReader(position + ": ", messages.errors).text("id", *value, id);
  if (!id) {
    if (find(*object, "id") == nullptr) messages.errors.push_back(position + " has no 'id'");
    return std::nullopt;
  }
  Cluster cluster;
  cluster.id = *id;
  const std::string where = fmt::format("cluster '{}': ", cluster.id);
  KeyReader reader(where, messages.errors);
  for (const auto& [key, value] : *object) {
    if (key == "id") continue;
    if (key == "source") {
      reader.text(key, value, cluster.source);
    } else if (key == "frame") {
      reader.text(key, value, cluster.frame);
    } else if (key == "timestamp") {
      reader.number(key, value, cluster.timestamp);
    } else if (key == "confidence") {
      reader.number(key, value, cluster.confidence);
    } else if (!read_annotations(key, value, where, cluster.annotations, cluster.hypotheses, messages)) {
      cluster.other.emplace_back(key, value);
    }
  }
  return cluster;
}

void read_clusters(const std::string& key, const Value& value, const SceneLimits& limits, Scene& scene,
                   SceneMessages& messages) {
  const Value::List* list = value.list();
  if (list == nullptr) {
    messages.errors.push_back(fmt::format("'{}' is {}, not a list of objects", key, value.kind()));
    return;
  }
  if (scene.has_clusters_key) {
    messages.errors.emplace_back("both 'identifiables' and 'clusters'; one of them has the clusters");
    return;
  }
  scene.has_clusters_key = true;
  scene.calls_them_clusters = key == "clusters";
  if (list->size() > limits.max_clusters) {
    messages.errors.push_back(too_many_clusters(scene.id, list->size(), limits));
    return;
  }
  scene.clusters.reserve(list->size());
  for (std::size_t i = 0; i < list->size(); ++i) {
    if (messages.errors.size() >= kMostMessages) return;
    auto cluster = read_cluster((*list)[i], fmt::format("{}[{}]", key, i), messages);
    if (cluster) scene.clusters.push_back(std::move(*cluster));
  }
}

// --- writing ---

void add_text(Value::Object& object, const char* key, const std::optional<std::string>& text) {
  if (text) object.emplace_back(key, Value(*text));
}

void add_number(Value::Object& object, const char* key, const std::optional<double>& number) {
  if (number) object.emplace_back(key, Value(*number));
}

Value annotation_to_json(const Annotation& annotation) {
  Value::Object object = annotation.fields;
  add_number(object, "confidence", annotation.confidence);
  add_text(object, "source", annotation.source);
  add_text(object, "frame", annotation.frame);
  add_number(object, "timestamp", annotation.timestamp);
  add_text(object, "id", annotation.id);
  return Value(std::move(object));
}

// One list for each type, in the order in which the types come first.
void add_annotations(Value::Object& object, const std::vector<Annotation>& annotations) {
  const std::size_t begin = object.size();
  for (const Annotation& annotation : annotations) {
    const auto same = std::find_if(object.begin() + static_cast<std::ptrdiff_t>(begin), object.end(),
                                   [&](const auto& entry) { return entry.first == annotation.type; });
    if (same == object.end()) {
      object.emplace_back(annotation.type, Value(Value::List{annotation_to_json(annotation)}));
    } else {
      same->second.list()->push_back(annotation_to_json(annotation));
    }
  }
}

Value cluster_to_json(const Cluster& cluster, bool says_frame) {
  Value::Object object{{"id", Value(cluster.id)}};
  add_number(object, "timestamp", cluster.timestamp);
  add_text(object, "source", cluster.source);
  if (says_frame) add_text(object, "frame", cluster.frame);
  add_number(object, "confidence", cluster.confidence);
  add_annotations(object, cluster.hypotheses);
  add_annotations(object, cluster.annotations);
  object.insert(object.end(), cluster.other.begin(), cluster.other.end());
  return Value(std::move(object));
}

std::optional<ScenePosition> position_at(const std::vector<const Value*>& values, const Value* frame) {
  for (const Value* value : values) {
    auto numbers = numbers_of(*value);
    if (!numbers || numbers->size() < 2 || numbers->size() > 3) continue;
    ScenePosition position{std::move(*numbers), {}, {}};
    if (frame != nullptr && frame->text() != nullptr) position.frame = *frame->text();
    return position;
  }
  return std::nullopt;
}

std::optional<ScenePosition> pose_position(const Cluster& cluster) {
  for (const char* view : {"world", "camera"}) {
    for (const Annotation* pose : annotations_of(cluster.annotations, "rs.annotation.PoseAnnotation")) {
      const Value* stamped = find(pose->fields, view);
      if (stamped == nullptr) continue;
      if (const Value* inner = stamped->find("rs.tf.StampedPose")) stamped = inner;
      if (auto position = position_at(select(*stamped, "/translation"), stamped->find("frame"))) {
        if (position->frame.empty()) position->frame = pose->frame.value_or("");
        if (const Value* rotation = stamped->find("rotation"))
          position->rotation = numbers_of(*rotation).value_or(std::vector<double>());
        if (position->rotation.size() != 4) position->rotation.clear();
        return position;
      }
    }
  }
  return std::nullopt;
}

}  // namespace

bool operator==(const Annotation& a, const Annotation& b) {
  return a.type == b.type && a.id == b.id && a.source == b.source && a.frame == b.frame && a.timestamp == b.timestamp &&
         a.confidence == b.confidence && Value(a.fields) == Value(b.fields);
}

// As their documents are.
bool operator==(const Cluster& a, const Cluster& b) {
  const auto said = [](const Cluster& c) { return c.has_frame_of_scene ? std::nullopt : c.frame; };
  return a.id == b.id && a.source == b.source && said(a) == said(b) && a.timestamp == b.timestamp &&
         a.confidence == b.confidence && a.hypotheses == b.hypotheses && a.annotations == b.annotations &&
         Value(a.other) == Value(b.other);
}

bool operator==(const Scene& a, const Scene& b) {
  return a.id == b.id && a.timestamp == b.timestamp && a.source == b.source && a.frame == b.frame &&
         a.annotations == b.annotations && a.clusters == b.clusters && a.calls_them_clusters == b.calls_them_clusters &&
         a.has_clusters_key == b.has_clusters_key && Value(a.other) == Value(b.other);
}

std::vector<const Annotation*> annotations_of(const std::vector<Annotation>& annotations, std::string_view type) {
  std::vector<const Annotation*> result;
  for (const Annotation& annotation : annotations) {
    if (annotation.type == type || is_annotation_of(annotation.type, type)) result.push_back(&annotation);
  }
  return result;
}

std::string_view text_field(const Annotation& annotation, std::string_view field) {
  const Value* value = find(annotation.fields, field);
  return value == nullptr || value->text() == nullptr ? std::string_view() : std::string_view(*value->text());
}

std::optional<ScenePosition> position_of(const Cluster& cluster) {
  auto position = pose_position(cluster);
  for (const Annotation* location : annotations_of(cluster.annotations, "rs.annotation.LocationAnnotation")) {
    if (position) break;
    position = position_at(select(location->fields, "/position"), nullptr);
    if (position) position->frame = location->frame.value_or("");
  }
  for (const ObjectHypothesis* points : annotations_of(cluster.hypotheses, "rs.scene.ClusterPoints")) {
    if (position) break;
    position = position_at(select(points->fields, "/centroid"), nullptr);
    if (position) position->frame = points->frame.value_or("");
  }
  if (position && position->frame.empty()) position->frame = cluster.frame.value_or("");
  return position;
}

std::string place_of(const std::vector<Annotation>& annotations) {
  for (const Annotation* location : annotations_of(annotations, "rs.annotation.TFLocation")) {
    return std::string(text_field(*location, "frame_id"));
  }
  for (const Annotation* location : annotations_of(annotations, "rs.annotation.LocationAnnotation")) {
    const std::string_view place = text_field(*location, "place");
    if (!place.empty()) return std::string(place);
  }
  return {};
}

std::optional<Cluster> designator_from_json(const Value& document, SceneMessages& messages, const SceneLimits& limits) {
  const std::size_t before = messages.errors.size();
  auto cluster = read_cluster(document, "the designator", messages);
  if (cluster) check_cluster(*cluster, limits, messages);
  return messages.errors.size() == before ? std::move(cluster) : std::nullopt;
}

std::optional<Scene> scene_from_json(const Value& document, SceneMessages& messages, const SceneLimits& limits) {
  const std::size_t before = messages.errors.size();
  const Value::Object* object = document.object();
  if (object == nullptr) {
    messages.errors.push_back(fmt::format("a scene is an object, not {}", document.kind()));
    return std::nullopt;
  }
  Scene scene;
  scene.has_clusters_key = false;
  KeyReader reader("", messages.errors);
  std::optional<std::string> id;
  std::optional<double> time;
  for (const char* key : {"id", "timestamp"}) {
    if (find(*object, key) == nullptr) messages.errors.push_back(fmt::format("the scene has no '{}'", key));
  }
  if (const Value* value = find(*object, "id")) reader.text("id", *value, id);
  if (const Value* value = find(*object, "timestamp")) reader.number("timestamp", *value, time);
  scene.id = id.value_or("");
  scene.timestamp = time.value_or(0);
  std::vector<Annotation> hypotheses;
  for (const auto& [key, value] : *object) {
    if (key == "id" || key == "timestamp") continue;
    if (key == "source") {
      reader.text(key, value, scene.source);
    } else if (key == "frame") {
      reader.text(key, value, scene.frame);
    } else if (key == "identifiables" || key == "clusters") {
      read_clusters(key, value, limits, scene, messages);
    } else if (!read_annotations(key, value, "", scene.annotations, hypotheses, messages)) {
      scene.other.emplace_back(key, value);
    }
  }
  // Hypotheses of the scene itself are annotations like others.
  scene.annotations.insert(scene.annotations.end(), hypotheses.begin(), hypotheses.end());
  if (messages.errors.size() == before) check_scene(scene, limits, messages);
  if (messages.errors.size() != before) return std::nullopt;
  take_frame_of_scene(scene);
  return scene;
}

bool is_designator(const Value& document) {
  const Value::Object* object = document.object();
  if (object == nullptr || find(*object, "identifiables") != nullptr || find(*object, "clusters") != nullptr)
    return false;
  return std::any_of(object->begin(), object->end(), [](const auto& entry) {
    const auto& [key, value] = entry;
    return is_list_of_objects(value) && find_annotation_type(key) != nullptr && !is_of_scenes(key);
  });
}

void take_frame_of_scene(Scene& scene) {
  if (!scene.frame) return;
  for (Cluster& cluster : scene.clusters) {
    if (cluster.frame) continue;
    cluster.frame = scene.frame;
    cluster.has_frame_of_scene = true;
  }
}

Value designator_to_json(const Cluster& cluster) { return cluster_to_json(cluster, true); }

Value scene_to_json(const Scene& scene) {
  Value::Object object{{"id", Value(scene.id)}, {"timestamp", Value(scene.timestamp)}};
  add_text(object, "source", scene.source);
  add_text(object, "frame", scene.frame);
  add_annotations(object, scene.annotations);
  object.insert(object.end(), scene.other.begin(), scene.other.end());
  if (scene.has_clusters_key || !scene.clusters.empty()) {
    Value::List clusters;
    clusters.reserve(scene.clusters.size());
    for (const Cluster& cluster : scene.clusters) {
      const bool says_frame = !(cluster.has_frame_of_scene && cluster.frame == scene.frame);
      clusters.push_back(cluster_to_json(cluster, says_frame));
    }
    object.emplace_back(scene.calls_them_clusters ? "clusters" : "identifiables", Value(std::move(clusters)));
  }
  return Value(std::move(object));
}

std::vector<std::string> validate(const Scene& scene, const SceneLimits& limits) {
  SceneMessages messages;
  check_scene(scene, limits, messages);
  return std::move(messages.errors);
}

}  // namespace sherlog
