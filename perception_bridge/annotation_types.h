// The annotation types: what annotators can say about a scene, a cluster or a part of the picture.
//
// Idea      One table, one line a type: name, parent, fields. Everything else walks it: the check of scenes that are read, the
//           JSON Schema, `sherlog scenes types`, the documentation. A type that the table does not have is kept as it is.
//           Names are those of RoboSherlock (rs.annotation.Shape); the last part alone (Shape) and the names of the paper
//           (GogglesAnnotation) mean the same type.
// Source    Beetz et al., RoboSherlock, ICRA 2015, section 7 and Fig. 6; the type system of the published system. Types named
//           sherlog.* are ours.
// To add a type: one line in annotation_types.cpp, and `sherlog scenes schema > docs/scene.schema.json`.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "perception_bridge/value.h"

namespace sherlog {

enum class FieldKind : std::uint8_t {
  kText,
  kNumber,
  kWhole,
  kFlag,
  kObject,
  kTexts,    // a list of texts
  kNumbers,  // a list of numbers
  kObjects,  // a list of objects
  kMatrix,   // a list of lists of numbers, all of one length
  kAny,
};

enum class FieldRange : std::uint8_t {
  kFree,
  kUnit,         // each number is in [0, 1]
  kNotNegative,  // a distance, a time, a radius
};

struct AnnotationField {
  std::string_view name;
  FieldKind kind = FieldKind::kText;
  bool required = false;
  FieldRange range = FieldRange::kFree;
  std::uint32_t length = 0;  // of a list of numbers: as many; 0: any number of them
};

struct AnnotationType {
  std::string_view name;
  std::string_view parent;   // empty: none
  std::string_view aliases;  // separated by blanks
  std::vector<AnnotationField> fields;
  std::string_view summary;
};

const std::vector<AnnotationType>& annotation_types();

// By full name, its last part, or an alias; null pointer where there is none.
const AnnotationType* find_annotation_type(std::string_view name);
// The full name where the type is known, else the name itself.
std::string_view full_type_name(std::string_view name);
// Whether the type is that one or one below it.
bool is_annotation_of(std::string_view type, std::string_view ancestor);
// Hypotheses are the rs.scene.ObjectHypothesis below: where a thing is in the data. All other types are annotations.
bool is_hypothesis_type(std::string_view type);
// Where a thing is, and what trackers called it, is true of one moment; what it looks like and is, of all.
bool is_of_the_moment(std::string_view type);

// Its own fields and those of its parents.
std::vector<AnnotationField> all_fields(const AnnotationType& type);

// What is wrong with the fields of an annotation of that type, one sentence each; unknown fields are never wrong.
std::vector<std::string> check_fields(const AnnotationType& type, const Value::Object& fields);

// The JSON Schema (2020-12) of one scene, made from the table: docs/scene.schema.json.
std::string scene_json_schema();

}  // namespace sherlog
