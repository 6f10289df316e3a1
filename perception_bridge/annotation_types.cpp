#include "perception_bridge/annotation_types.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

namespace sherlog {
namespace {

using enum FieldKind;
using enum FieldRange;

constexpr bool kRequired = true;
constexpr std::string_view kAnnotation = "rs.core.Annotation";
constexpr std::string_view kHypothesis = "rs.scene.ObjectHypothesis";

// id, source, frame, timestamp and confidence belong to every annotation and are not repeated here.
std::vector<AnnotationType> make_types() {
  return {
      {"rs.core.Annotation", "", "", {}, "anything that is said about a scene or a cluster"},
      // Hypotheses: where a thing is in the data.
      {kHypothesis, kAnnotation, "", {}, "where in the data a thing may be"},
      {"rs.scene.ClusterPoints",
       kHypothesis,
       "",
       {{"indices", kNumbers, false, kNotNegative}, {"centroid", kNumbers, false, kFree, 3}},
       "points of a cloud"},
      {"rs.scene.ImageROI",
       kHypothesis,
       "",
       {{"x", kNumber},
        {"y", kNumber},
        {"width", kNumber, false, kNotNegative},
        {"height", kNumber, false, kNotNegative}},
       "a rectangle of the picture, in pixels"},
      {"rs.scene.TFLinkSphereROI",
       kHypothesis,
       "",
       {{"link", kText, kRequired}, {"radius", kNumber, kRequired, kNotNegative}},
       "a sphere around a link, in metres"},
      {"rs.scene.TFLinkBBoxROI",
       kHypothesis,
       "",
       {{"link", kText, kRequired}, {"size", kNumbers, kRequired, kNotNegative, 3}},
       "a box around a link, in metres"},
      // What it looks like.
      {"rs.annotation.Shape", kAnnotation, "", {{"shape", kText, kRequired}}, "box, round, flat, cylinder"},
      {"rs.annotation.SemanticSize", kAnnotation, "", {{"size", kText, kRequired}}, "small, medium, large"},
      {"rs.annotation.SemanticColor",
       kAnnotation,
       "",
       {{"color", kText, kRequired}, {"ratio", kNumber, false, kUnit}},
       "the name of a colour and its share of the thing"},
      {"sherlog.annotation.MeanColor",
       kAnnotation,
       "",
       {{"color", kNumbers, kRequired, kUnit, 3}},
       "a colour as numbers"},
      {"rs.annotation.ColorHistogram",
       kAnnotation,
       "",
       {{"hist", kNumbers, kRequired, kNotNegative}},
       "counts of colours, row by row"},
      {"rs.annotation.HueSaturationHistogram",
       "rs.annotation.ColorHistogram",
       "",
       {},
       "counts of hues and saturations, 16 by 16"},
      {"rs.annotation.PerceptualHash", kAnnotation, "", {{"hash", kText, kRequired}}, "hexadecimal digits"},
      {"rs.annotation.ImageMask", kAnnotation, "", {{"mask", kAny}}, "the pixels of a thing"},
      {"rs.annotation.Features",
       kAnnotation,
       "",
       {{"descriptors", kNumbers}, {"extractor", kText}, {"descriptorType", kText}},
       "features of the picture"},
      {"rs.annotation.PclFeature",
       kAnnotation,
       "PclFeatureAnnotation",
       {{"feature", kNumbers, kRequired}, {"feat_type", kText}},
       "a descriptor of the shape: VFH, CVFH, FPFH, ..."},
      {"rs.annotation.PclSAC",
       kAnnotation,
       "PclSACAnnotation SACModel",
       {{"model", kText, kRequired}, {"inliers", kNumber, false, kNotNegative}, {"parameters", kNumbers}},
       "a geometric model that fits the points"},
      {"rs.annotation.Geometry",
       kAnnotation,
       "",
       {{"size", kNumbers, false, kNotNegative, 3}, {"boundingBox", kObject}},
       "the edges of a box around it, in metres"},
      // Where it is.
      {"rs.annotation.PoseAnnotation",
       kAnnotation,
       "",
       {{"camera", kObject}, {"world", kObject}},
       "a pose, as rs.tf.StampedPose"},
      {"rs.annotation.LocationAnnotation",
       kAnnotation,
       "Location",
       {{"place", kText}, {"position", kNumbers, false, kFree}, {"covariance", kNumbers}},
       "where it is, by name or by numbers"},
      {"rs.annotation.TFLocation",
       kAnnotation,
       "",
       {{"frame_id", kText, kRequired}, {"reference_desc", kText}},
       "the piece of furniture that it stands on or in"},
      // What it is.
      {"rs.annotation.Detection", kAnnotation, "", {{"name", kText, kRequired}}, "the name of an object"},
      {"rs.annotation.Classification",
       kAnnotation,
       "ClassificationAnnotation",
       {{"classname", kText, kRequired},
        {"classification_type", kText},
        {"classifier", kText},
        {"featurename", kText},
        {"confidences", kObjects}},
       "a label, and how probable each label is"},
      {"rs.annotation.Goggles",
       kAnnotation,
       "GogglesAnnotation",
       {{"category", kText}, {"title", kText}, {"preview_link", kText}},
       "what an image search on the web found"},
      {"rs.annotation.Product",
       kAnnotation,
       "ProductAnnotation",
       {{"name", kText}, {"attributes", kObject}},
       "a product of a shop"},
      {"rs.annotation.Barcode",
       kAnnotation,
       "BarcodeAnnotation",
       {{"barcode", kText, kRequired}, {"barcodeType", kText}},
       "a code that was read"},
      {"rs.annotation.NamedWWWLink",
       kAnnotation,
       "",
       {{"name", kText}, {"url", kText, kRequired}},
       "a page on the web"},
      {"rs.annotation.GroundTruth",
       kAnnotation,
       "",
       {{"classificationGT", kObject}, {"object", kText}},
       "what a person says that it is"},
      {"rs.annotation.MLNAtoms",
       kAnnotation,
       "",
       {{"atoms", kTexts, kRequired}},
       "evidence for a Markov logic network"},
      // Who is there.
      {"sherlog.annotation.Person",
       kAnnotation,
       "",
       {{"label", kNumber, kRequired},
        {"position", kNumbers, false, kFree, 3},
        {"keypoints", kNumber, false, kNotNegative},
        {"roi", kNumbers, false, kNotNegative, 4},
        {"posture", kNumber, false, kNotNegative},
        {"similarity", kNumber, false, kNotNegative}},
       "somebody whom the camera follows: label from frame to frame, place, and the number of the posture"},
      {"sherlog.annotation.Crowd",
       kAnnotation,
       "",
       {{"most", kNumber, kRequired, kNotNegative}, {"groups", kNumber, kRequired, kNotNegative}},
       "there are more people than can be followed at once: so many have no label of their own"},
      // Which one it is.
      {"rs.annotation.Tracking",
       kAnnotation,
       "TrackingAnnotation",
       {{"trackingID", kAny, kRequired}, {"tracker", kText}},
       "the number that a tracker gave it"},
      {"rs.annotation.ClusterSimilaritiesMatrix",
       kAnnotation,
       "",
       {{"matrix", kMatrix, kRequired, kUnit}, {"rows", kTexts}, {"columns", kTexts}},
       "how alike clusters are"},
      {"rs.annotation.ClusterDistancesMatrix",
       kAnnotation,
       "",
       {{"matrix", kMatrix, kRequired, kNotNegative}, {"rows", kTexts}, {"columns", kTexts}},
       "how far from each other clusters are"},
      // About the whole scene.
      {"sherlog.annotation.Context",
       kAnnotation,
       "",
       {{"name", kText, kRequired}},
       "breakfast, cooking, drawer, fridge"},
      {"sherlog.annotation.ViewFrustum",
       kAnnotation,
       "",
       {{"translation", kNumbers, kRequired, kFree, 3},
        {"rotation", kNumbers, kRequired, kFree, 4},
        {"horizontal_angle", kNumber, kRequired, kNotNegative},
        {"vertical_angle", kNumber, kRequired, kNotNegative},
        {"near", kNumber, false, kNotNegative},
        {"far", kNumber, false, kNotNegative}},
       "what the camera sees: its pose, angles in radians, metres"},
      {"sherlog.annotation.ViewBox",
       kAnnotation,
       "",
       {{"min", kNumbers, kRequired}, {"max", kNumbers, kRequired}},
       "what is seen, as a box in a frame"},
      {"rs.annotation.LoggingInformation",
       kAnnotation,
       "Logging",
       {{"annotator", kText, kRequired}, {"milliseconds", kNumber, false, kNotNegative}, {"message", kText}},
       "what an annotator did and how long it took"},
  };
}

struct TypeIndex {
  std::map<std::string_view, const AnnotationType*> by_name;

  TypeIndex() {
    for (const AnnotationType& type : annotation_types()) {
      by_name.emplace(type.name, &type);
      by_name.emplace(type.name.substr(type.name.rfind('.') + 1), &type);
      std::string_view rest = type.aliases;
      while (!rest.empty()) {
        const std::size_t end = std::min(rest.find(' '), rest.size());
        by_name.emplace(rest.substr(0, end), &type);
        rest.remove_prefix(std::min(end + 1, rest.size()));
      }
    }
  }
};

std::string_view expected(FieldKind kind) {
  switch (kind) {
    case kText:
      return "a text";
    case kNumber:
      return "a number";
    case kWhole:
      return "a whole number";
    case kFlag:
      return "true or false";
    case kObject:
      return "an object";
    case kTexts:
      return "a list of texts";
    case kNumbers:
      return "a list of numbers";
    case kObjects:
      return "a list of objects";
    case kMatrix:
      return "a list of lists of numbers of one length";
    case kAny:
      break;
  }
  return "a value";
}

template <class Test>
bool is_list_of(const Value& value, Test test) {
  return value.list() != nullptr && std::all_of(value.list()->begin(), value.list()->end(), test);
}

bool is_matrix(const Value& value) {
  if (!is_list_of(value, [](const Value& row) { return numbers_of(row).has_value(); })) return false;
  const Value::List& rows = *value.list();
  return std::all_of(rows.begin(), rows.end(),
                     [&](const Value& row) { return row.list()->size() == rows.front().list()->size(); });
}

bool has_kind(const Value& value, FieldKind kind) {
  switch (kind) {
    case kText:
      return value.text() != nullptr;
    case kNumber:
      return value.number().has_value();
    case kWhole:
      return value.whole_number().has_value();
    case kFlag:
      return value.flag() != nullptr;
    case kObject:
      return value.object() != nullptr;
    case kTexts:
      return is_list_of(value, [](const Value& item) { return item.text() != nullptr; });
    case kNumbers:
      return numbers_of(value).has_value();
    case kObjects:
      return is_list_of(value, [](const Value& item) { return item.object() != nullptr; });
    case kMatrix:
      return is_matrix(value);
    case kAny:
      break;
  }
  return true;
}

// The sentence about the first number that is not in the range, or "".
std::string range_problem(const Value& value, FieldRange range) {
  if (const Value::List* list = value.list()) {
    for (const Value& item : *list) {
      if (std::string problem = range_problem(item, range); !problem.empty()) return problem;
    }
    return {};
  }
  const auto number = value.number();
  if (!number) return {};
  if (!std::isfinite(*number)) return fmt::format("{} is not a finite number", *number);
  if (range == kUnit && (*number < 0 || *number > 1)) return fmt::format("{} is not in [0, 1]", *number);
  if (range == kNotNegative && *number < 0) return fmt::format("{} is negative", *number);
  return {};
}

Value text_value(std::string_view text) { return Value(std::string(text)); }
Value type_schema(const char* type) { return Value(Value::Object{{"type", Value(type)}}); }

Value number_schema(FieldRange range) {
  Value::Object schema{{"type", Value("number")}};
  if (range != kFree) schema.emplace_back("minimum", Value(std::int64_t{0}));
  if (range == kUnit) schema.emplace_back("maximum", Value(std::int64_t{1}));
  return Value(std::move(schema));
}

Value list_schema(Value item, std::uint32_t length = 0) {
  Value::Object schema{{"type", Value("array")}, {"items", std::move(item)}};
  if (length > 0) {
    schema.emplace_back("minItems", Value(std::int64_t{length}));
    schema.emplace_back("maxItems", Value(std::int64_t{length}));
  }
  return Value(std::move(schema));
}

Value field_schema(const AnnotationField& field) {
  switch (field.kind) {
    case kText:
      return type_schema("string");
    case kNumber:
      return number_schema(field.range);
    case kWhole:
      return type_schema("integer");
    case kFlag:
      return type_schema("boolean");
    case kObject:
      return type_schema("object");
    case kTexts:
      return list_schema(type_schema("string"));
    case kNumbers:
      return list_schema(number_schema(field.range), field.length);
    case kObjects:
      return list_schema(type_schema("object"));
    case kMatrix:
      return list_schema(list_schema(number_schema(field.range)));
    case kAny:
      break;
  }
  return Value(Value::Object{});
}

Value reference(std::string_view definition) {
  return Value(Value::Object{{"$ref", text_value(fmt::format("#/$defs/{}", definition))}});
}

Value annotation_schema(const AnnotationType& type) {
  Value::Object properties = {{"id", type_schema("string")},
                              {"source", type_schema("string")},
                              {"frame", type_schema("string")},
                              {"timestamp", number_schema(kNotNegative)},
                              {"confidence", number_schema(kUnit)}};
  Value::List required;
  for (const AnnotationField& field : all_fields(type)) {
    properties.emplace_back(std::string(field.name), field_schema(field));
    if (field.required) required.push_back(text_value(field.name));
  }
  Value::Object schema = {{"description", text_value(type.summary)},
                          {"type", Value("object")},
                          {"properties", Value(std::move(properties))}};
  if (!required.empty()) schema.emplace_back("required", Value(std::move(required)));
  return Value(std::move(schema));
}

}  // namespace

const std::vector<AnnotationType>& annotation_types() {
  static const std::vector<AnnotationType> types = make_types();
  return types;
}

const AnnotationType* find_annotation_type(std::string_view name) {
  static const TypeIndex index;
  const auto found = index.by_name.find(name);
  return found == index.by_name.end() ? nullptr : found->second;
}

std::string_view full_type_name(std::string_view name) {
  const AnnotationType* type = find_annotation_type(name);
  return type == nullptr ? name : type->name;
}

bool is_annotation_of(std::string_view type, std::string_view ancestor) {
  const std::string_view wanted = full_type_name(ancestor);
  std::string_view name = full_type_name(type);
  while (name != wanted) {
    const AnnotationType* entry = find_annotation_type(name);
    if (entry == nullptr || entry->parent.empty()) return false;
    name = entry->parent;
  }
  return true;
}

bool is_hypothesis_type(std::string_view type) { return is_annotation_of(type, kHypothesis); }

bool is_of_the_moment(std::string_view type) {
  constexpr std::array<std::string_view, 4> kTypes = {"rs.annotation.PoseAnnotation",
                                                      "rs.annotation.LocationAnnotation", "rs.annotation.TFLocation",
                                                      "rs.annotation.Tracking"};
  return std::ranges::any_of(kTypes, [&](std::string_view known) { return is_annotation_of(type, known); });
}

std::vector<AnnotationField> all_fields(const AnnotationType& type) {
  std::vector<AnnotationField> fields;
  for (const AnnotationType* entry = &type; entry != nullptr; entry = find_annotation_type(entry->parent)) {
    fields.insert(fields.end(), entry->fields.begin(), entry->fields.end());
    if (entry->parent.empty()) break;
  }
  return fields;
}

std::vector<std::string> check_fields(const AnnotationType& type, const Value::Object& fields) {
  std::vector<std::string> problems;
  for (const AnnotationField& field : all_fields(type)) {
    const Value* value = find(fields, field.name);
    if (value == nullptr) {
      if (field.required) problems.push_back(fmt::format("has no '{}', which is {}", field.name, expected(field.kind)));
      continue;
    }
    if (!has_kind(*value, field.kind)) {
      problems.push_back(fmt::format("'{}' is {}, not {}", field.name, value->kind(), expected(field.kind)));
      continue;
    }
    if (field.length != 0 && value->list()->size() != field.length) {
      problems.push_back(fmt::format("'{}' has {} numbers, not {}", field.name, value->list()->size(), field.length));
    }
    if (const std::string problem = range_problem(*value, field.range); !problem.empty()) {
      problems.push_back(fmt::format("'{}': {}", field.name, problem));
    }
  }
  return problems;
}

std::string scene_json_schema() {
  Value::Object definitions, in_scene, in_cluster;
  for (const AnnotationType& type : annotation_types()) {
    if (type.parent.empty()) continue;
    definitions.emplace_back(std::string(type.name), annotation_schema(type));
    in_cluster.emplace_back(std::string(type.name), list_schema(reference(type.name)));
    if (!is_hypothesis_type(type.name))
      in_scene.emplace_back(std::string(type.name), list_schema(reference(type.name)));
  }
  Value::Object cluster = {{"id", type_schema("string")},
                           {"timestamp", number_schema(kNotNegative)},
                           {"source", type_schema("string")},
                           {"frame", type_schema("string")},
                           {"confidence", number_schema(kUnit)}};
  cluster.insert(cluster.end(), in_cluster.begin(), in_cluster.end());
  definitions.emplace_back("cluster",
                           Value(Value::Object{{"description", Value("an object designator: one thing in a scene")},
                                               {"type", Value("object")},
                                               {"properties", Value(std::move(cluster))},
                                               {"required", Value(Value::List{Value("id")})}}));
  Value::Object scene = {{"id", type_schema("string")},
                         {"timestamp", number_schema(kNotNegative)},
                         {"source", type_schema("string")},
                         {"frame", type_schema("string")},
                         {"identifiables", list_schema(reference("cluster"))},
                         {"clusters", list_schema(reference("cluster"))}};
  scene.insert(scene.end(), in_scene.begin(), in_scene.end());
  const Value schema(Value::Object{{"$schema", Value("https://json-schema.org/draft/2020-12/schema")},
                                   {"title", Value("A scene: one line of a JSON lines file")},
                                   {"type", Value("object")},
                                   {"properties", Value(std::move(scene))},
                                   {"required", Value(Value::List{Value("id"), Value("timestamp")})},
                                   {"$defs", Value(std::move(definitions))}});
  return json_text(schema, 2) + "\n";
}

}  // namespace sherlog
