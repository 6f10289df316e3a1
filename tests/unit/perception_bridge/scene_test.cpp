#include "perception_bridge/scene.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <iterator>
#include <limits>
#include <set>
#include <sstream>

#include "perception_bridge/annotation_types.h"

namespace sherlog {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

std::string read_project_file(const std::string& name) {
  std::ifstream in(std::string(SHERLOG_SOURCE_DIR "/") + name);
  return {std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
}

Value json(const std::string& text) {
  std::string problem;
  const auto value = parse_json(text, problem);
  EXPECT_TRUE(value) << problem << " in " << text;
  return value.value_or(Value());
}

std::vector<std::string> shipped_lines() {
  std::vector<std::string> lines;
  std::istringstream in(read_project_file("examples/scenes/kitchen.jsonl"));
  for (std::string line; std::getline(in, line);) lines.push_back(line);
  EXPECT_EQ(lines.size(), 3u);
  return lines;
}

// The first error of a scene, or "".
std::string error_of(const std::string& text, const SceneLimits& limits = {}) {
  SceneMessages messages;
  const auto scene = scene_from_json(json(text), messages, limits);
  EXPECT_EQ(scene.has_value(), messages.errors.empty());
  return messages.errors.empty() ? "" : messages.errors.front();
}

std::string with_cluster(const std::string& entry) {
  return R"({"id":"s","timestamp":1,"identifiables":[{"id":"c0",)" + entry + "}]}";
}

// --- values ---

TEST(Value, JsonComesOutAsItWentIn) {
  for (const char* text : {R"({"b":1,"a":[1.5,true,null,"x\n\"\\"],"c":{}})", "18446744073709551615",
                           "-9007199254740993", "1e-300", "[]", R"("ä€")", "0.1", "2.0"}) {
    EXPECT_EQ(json_text(json(text)), text);
  }
}

TEST(Value, ObjectsAreEqualWhateverTheirOrder) {
  EXPECT_EQ(json(R"({"a":1,"b":[2]})"), json(R"({"b":[2.0],"a":1})"));
  EXPECT_FALSE(json(R"({"a":1})") == json(R"({"a":2})"));
  EXPECT_FALSE(json(R"({"a":1})") == json(R"({"a":1,"b":1})"));
  EXPECT_FALSE(json("1") == json("\"1\""));
}

TEST(Value, WhatIsNotJsonIsNamedWithItsColumn) {
  std::string problem;
  EXPECT_FALSE(parse_json("{\"a\": }", problem));
  EXPECT_THAT(problem, HasSubstr("line 1, column 7"));
  EXPECT_FALSE(parse_json(R"({"a": 1, "a": 2})", problem));
  EXPECT_THAT(problem, HasSubstr("'a' appears twice"));
  EXPECT_FALSE(parse_json(std::string(100, '[') + std::string(100, ']'), problem));
  EXPECT_THAT(problem, HasSubstr("nested deeper than 64"));
  EXPECT_FALSE(parse_json("\"\xff\"", problem));
  EXPECT_FALSE(parse_json("1e999", problem));
  EXPECT_FALSE(parse_json("NaN", problem));
  EXPECT_FALSE(parse_json("", problem));
}

TEST(Value, APointerWithAStarSelectsEveryElement) {
  const Value value = json(R"({"list":[{"x":1},{"x":2},{"y":3}],"a/b":4})");
  EXPECT_EQ(select(value, "/list/*/x").size(), 2u);
  EXPECT_EQ(*select(value, "/list/1/x").front()->number(), 2);
  EXPECT_EQ(*select(value, "/a~1b").front()->number(), 4);
  EXPECT_TRUE(select(value, "/list/x").empty());
  EXPECT_EQ(select(value, "").size(), 1u);
}

// --- types ---

TEST(AnnotationTypes, EveryParentIsATypeAndEveryNameIsUnique) {
  std::set<std::string_view> names;
  for (const AnnotationType& type : annotation_types()) {
    EXPECT_TRUE(names.insert(type.name).second) << type.name;
    EXPECT_TRUE(type.parent.empty() || find_annotation_type(type.parent) != nullptr) << type.name;
    EXPECT_EQ(find_annotation_type(type.name), &type);
  }
}

TEST(AnnotationTypes, ShortNamesAndThePapersNamesMeanTheSame) {
  EXPECT_EQ(full_type_name("Shape"), "rs.annotation.Shape");
  EXPECT_EQ(full_type_name("GogglesAnnotation"), "rs.annotation.Goggles");
  EXPECT_EQ(full_type_name("my.Type"), "my.Type");
  EXPECT_TRUE(is_annotation_of("HueSaturationHistogram", "ColorHistogram"));
  EXPECT_FALSE(is_annotation_of("ColorHistogram", "HueSaturationHistogram"));
  EXPECT_TRUE(is_hypothesis_type("rs.scene.ImageROI"));
  EXPECT_FALSE(is_hypothesis_type("rs.annotation.Shape"));
}

// A value that a field accepts.
Value example_of(const AnnotationField& field) {
  const Value half(0.5);
  const Value::List numbers(field.length == 0 ? 2 : field.length, half);
  switch (field.kind) {
    case FieldKind::kNumber:
      return half;
    case FieldKind::kWhole:
      return Value(std::int64_t{3});
    case FieldKind::kFlag:
      return Value(true);
    case FieldKind::kObject:
      return Value(Value::Object{{"key", half}});
    case FieldKind::kTexts:
      return Value(Value::List{Value("one")});
    case FieldKind::kNumbers:
      return Value(numbers);
    case FieldKind::kObjects:
      return Value(Value::List{Value(Value::Object{{"name", Value("x")}})});
    case FieldKind::kMatrix:
      return Value(Value::List{Value(numbers), Value(numbers)});
    case FieldKind::kText:
    case FieldKind::kAny:
      break;
  }
  return Value("text");
}

TEST(AnnotationTypes, EveryTypeRoundTripsWithAllItsFields) {
  for (const AnnotationType& type : annotation_types()) {
    Annotation annotation;
    annotation.type = std::string(type.name);
    annotation.id = "a";
    annotation.source = "test";
    annotation.frame = "map";
    annotation.timestamp = 2.5;
    annotation.confidence = 0.25;
    for (const AnnotationField& field : all_fields(type)) {
      annotation.fields.emplace_back(std::string(field.name), example_of(field));
    }
    annotation.fields.emplace_back("never heard of", Value(Value::List{}));
    Scene scene;
    scene.id = "s";
    scene.timestamp = 3;
    Cluster cluster;
    cluster.id = "c0";
    (is_hypothesis_type(type.name) ? cluster.hypotheses : cluster.annotations).push_back(annotation);
    scene.clusters.push_back(cluster);
    EXPECT_THAT(validate(scene), IsEmpty()) << type.name;
    SceneMessages messages;
    const auto again = scene_from_json(json(json_text(scene_to_json(scene))), messages);
    ASSERT_TRUE(again) << type.name << messages.errors.front();
    EXPECT_EQ(*again, scene) << type.name;
  }
}

TEST(AnnotationTypes, AFieldOfAnotherKindIsAnError) {
  for (const AnnotationType& type : annotation_types()) {
    for (const AnnotationField& field : all_fields(type)) {
      if (field.kind == FieldKind::kAny) continue;
      Value::Object fields;
      for (const AnnotationField& other : all_fields(type)) {
        fields.emplace_back(std::string(other.name), other.name == field.name ? Value() : example_of(other));
      }
      EXPECT_EQ(check_fields(type, fields).size(), 1u) << type.name << "." << field.name;
    }
  }
}

// --- scenes ---

TEST(Scene, TheShippedOnesComeOutAsTheyWentIn) {
  for (const std::string& line : shipped_lines()) {
    SceneMessages messages;
    const Value document = json(line);
    const auto scene = scene_from_json(document, messages);
    ASSERT_TRUE(scene) << messages.errors.front();
    EXPECT_EQ(scene_to_json(*scene), document);
    SceneMessages again;
    EXPECT_EQ(scene_from_json(scene_to_json(*scene), again), scene);
  }
}

TEST(Scene, UnknownKeysAndTypesAreKept) {
  const std::string text =
      R"({"id":"s","timestamp":1,"robot":{"battery":0.5},"clusters":[{"id":"c","hasIngredient":["milk"],)"
      R"("my.annotation.Weight":[{"grams":31,"source":"scale"}],"rs.annotation.Shape":[]}]})";
  SceneMessages messages;
  const auto scene = scene_from_json(json(text), messages);
  ASSERT_TRUE(scene);
  EXPECT_EQ(scene_to_json(*scene), json(text));
  EXPECT_THAT(messages.warnings, ElementsAre(HasSubstr("my.annotation.Weight")));
  EXPECT_EQ(scene->clusters.front().annotations.front().source, "scale");
}

TEST(Scene, AnEmptySceneIsAScene) {
  for (const char* text : {R"({"id":"s","timestamp":0})", R"({"id":"s","timestamp":0,"identifiables":[]})"}) {
    SceneMessages messages;
    const auto scene = scene_from_json(json(text), messages);
    ASSERT_TRUE(scene);
    EXPECT_EQ(scene_to_json(*scene), json(text));
  }
}

TEST(Scene, EachMistakeIsNamed) {
  EXPECT_THAT(error_of("[1]"), HasSubstr("a scene is an object, not a list"));
  EXPECT_THAT(error_of(R"({"timestamp":1})"), HasSubstr("no 'id'"));
  EXPECT_THAT(error_of(R"({"id":"s"})"), HasSubstr("no 'timestamp'"));
  EXPECT_THAT(error_of(R"({"id":5,"timestamp":1})"), HasSubstr("'id' is a whole number, not a text"));
  EXPECT_THAT(error_of(R"({"id":"s","timestamp":-1})"), HasSubstr("-1 is not a number of seconds"));
  EXPECT_THAT(error_of(R"({"id":"s","timestamp":1353571200000000000})"), HasSubstr("too large for seconds"));
  EXPECT_THAT(error_of(R"({"id":"s","timestamp":1,"identifiables":{}})"), HasSubstr("not a list"));
  EXPECT_THAT(error_of(R"({"id":"s","timestamp":1,"identifiables":[{}]})"), HasSubstr("identifiables[0] has no 'id'"));
  EXPECT_THAT(error_of(R"({"id":"s","timestamp":1,"identifiables":[{"id":"c"},{"id":"c"}]})"),
              HasSubstr("two clusters have the id 'c'"));
  EXPECT_THAT(error_of(with_cluster(R"("rs.annotation.Shape":{"shape":"box"})")), HasSubstr("not a list of objects"));
  EXPECT_THAT(error_of(with_cluster(R"("rs.annotation.Shape":[{}])")), HasSubstr("has no 'shape'"));
  EXPECT_THAT(error_of(with_cluster(R"("rs.annotation.Shape":[{"shape":"box","confidence":1.2}])")),
              HasSubstr("'confidence' 1.2 is not in [0, 1]"));
  EXPECT_THAT(error_of(with_cluster(R"("rs.annotation.SemanticColor":[{"color":"red","ratio":-0.1}])")),
              HasSubstr("-0.1 is not in [0, 1]"));
  EXPECT_THAT(error_of(with_cluster(R"("rs.annotation.ClusterDistancesMatrix":[{"matrix":[[0,1],[-2,0]]}])")),
              HasSubstr("-2 is negative"));
  EXPECT_THAT(error_of(with_cluster(R"("rs.annotation.ClusterDistancesMatrix":[{"matrix":[[0,1],[2]]}])")),
              HasSubstr("of one length"));
}

TEST(Scene, NotANumberIsNeverGood) {
  Scene scene;
  scene.id = "s";
  scene.timestamp = std::nan("");
  EXPECT_THAT(validate(scene), ElementsAre(HasSubstr("timestamp")));
  scene.timestamp = 1;
  Annotation matrix;
  matrix.type = "rs.annotation.ClusterDistancesMatrix";
  matrix.fields = {{"matrix", Value(Value::List{number_list({std::nan("")})})}};
  scene.annotations = {matrix};
  EXPECT_THAT(validate(scene), ElementsAre(HasSubstr("finite")));
  scene.annotations.front().fields.front().second =
      Value(Value::List{number_list({std::numeric_limits<double>::infinity()})});
  EXPECT_THAT(validate(scene), ElementsAre(HasSubstr("finite")));
}

TEST(Scene, TooManyClustersAreRefusedWithTheLimit) {
  std::string text = R"({"id":"big","timestamp":1,"identifiables":[)";
  for (int i = 0; i < 10'000; ++i) text += (i > 0 ? ",{\"id\":\"c" : "{\"id\":\"c") + std::to_string(i) + "\"}";
  text += "]}";
  EXPECT_EQ(error_of(text), "scene 'big' has 10000 clusters; the limit is 5000");
  EXPECT_EQ(error_of(text, {.max_clusters = 10'000}), "");
}

TEST(Scene, PositionAndPlaceAreFoundWhereAnnotatorsPutThem) {
  SceneMessages messages;
  const auto scene = scene_from_json(json(shipped_lines().front()), messages);
  ASSERT_TRUE(scene);
  const auto position = position_of(scene->clusters.front());
  ASSERT_TRUE(position);
  EXPECT_THAT(position->coordinates, ElementsAre(0.31, 0.62, 0.95));
  EXPECT_EQ(position->frame, "map");
  EXPECT_EQ(place_of(scene->clusters.front().annotations), "counter_top_island_link");
  EXPECT_EQ(place_of({}), "");
}

TEST(Scene, AClusterIsInTheFrameOfItsScene) {
  const Value document = json(R"({"id":"s","timestamp":1,"frame":"map","identifiables":[
      {"id":"a","rs.annotation.LocationAnnotation":[{"position":[1,2]}]},
      {"id":"b","frame":"map","rs.annotation.LocationAnnotation":[{"position":[1,2]}]},
      {"id":"c","rs.annotation.LocationAnnotation":[{"position":[1,2],"frame":"camera"}]}]})");
  SceneMessages messages;
  const auto scene = scene_from_json(document, messages);
  ASSERT_TRUE(scene);
  EXPECT_EQ(position_of(scene->clusters[0])->frame, "map");
  EXPECT_EQ(position_of(scene->clusters[1])->frame, "map");
  EXPECT_EQ(position_of(scene->clusters[2])->frame, "camera");
  EXPECT_EQ(scene_to_json(*scene), document) << "what was not said is not said";
  // A cluster without its scene says it.
  const auto alone = designator_from_json(designator_to_json(scene->clusters[0]), messages);
  ASSERT_TRUE(alone);
  EXPECT_EQ(position_of(*alone)->frame, "map");
}

TEST(Scene, ADesignatorIsToldFromAScene) {
  for (const char* designator :
       {R"({"id":"o","timestamp":1,"rs.annotation.Shape":[{"shape":"box"}]})",
        R"({"id":"o","timestamp":1,"Detection":[{"name":"Milk"}],"rs.annotation.TFLocation":[{}]})",
        R"({"id":"o","timestamp":1,"rs.scene.ClusterPoints":[{"indices":[1]}]})"}) {
    EXPECT_TRUE(is_designator(json(designator))) << designator;
  }
  for (const char* scene : {R"({"id":"s","timestamp":1})", R"([1])",
                            R"({"id":"s","timestamp":1,"rs.annotation.TFLocation":[{"frame_id":"t"}]})",
                            R"({"id":"s","timestamp":1,"sherlog.annotation.Context":[{"name":"breakfast"}]})",
                            R"({"id":"s","timestamp":1,"rs.annotation.Shape":[]})",
                            R"({"id":"s","timestamp":1,"rs.annotation.Shape":[{"shape":"box"}],"clusters":[]})"}) {
    EXPECT_FALSE(is_designator(json(scene))) << scene;
  }
}

// --- the schema: a validator for the few words that it uses ---

class SchemaChecker {
 public:
  explicit SchemaChecker(const Value& schema) : root_(schema) {}

  bool accepts(const Value& value) const { return accepts(value, root_); }

 private:
  bool accepts(const Value& value, const Value& schema) const {
    if (const Value* reference = schema.find("$ref")) {
      return accepts(value, *root_.find("$defs")->find(reference->text()->substr(std::string("#/$defs/").size())));
    }
    return has_type(value, schema) && in_range(value, schema) && has_keys(value, schema) && has_items(value, schema);
  }
  static bool has_type(const Value& value, const Value& schema) {
    const Value* type = schema.find("type");
    if (type == nullptr) return true;
    const std::string& name = *type->text();
    if (name == "object") return value.object() != nullptr;
    if (name == "array") return value.list() != nullptr;
    if (name == "string") return value.text() != nullptr;
    if (name == "number") return value.number().has_value();
    if (name == "boolean") return value.flag() != nullptr;
    return name == "integer" && value.whole_number().has_value();
  }
  static bool in_range(const Value& value, const Value& schema) {
    const auto number = value.number();
    const Value *least = schema.find("minimum"), *most = schema.find("maximum");
    return !number ||
           ((least == nullptr || *number >= *least->number()) && (most == nullptr || *number <= *most->number()));
  }
  bool has_keys(const Value& value, const Value& schema) const {
    if (const Value* required = schema.find("required")) {
      for (const Value& key : *required->list()) {
        if (value.find(*key.text()) == nullptr) return false;
      }
    }
    const Value* properties = schema.find("properties");
    if (properties == nullptr) return true;
    for (const auto& [key, item] : *value.object()) {
      const Value* property = properties->find(key);
      if (property != nullptr && !accepts(item, *property)) return false;
    }
    return true;
  }
  bool has_items(const Value& value, const Value& schema) const {
    const Value *items = schema.find("items"), *least = schema.find("minItems"), *most = schema.find("maxItems");
    if (items == nullptr) return true;
    const auto size = static_cast<double>(value.list()->size());
    if ((least != nullptr && size < *least->number()) || (most != nullptr && size > *most->number())) return false;
    for (const Value& item : *value.list()) {
      if (!accepts(item, *items)) return false;
    }
    return true;
  }

  const Value& root_;
};

TEST(SceneSchema, TheShippedFileIsMadeFromTheTable) {
  EXPECT_EQ(read_project_file("docs/scene.schema.json"), scene_json_schema())
      << "run: sherlog scenes schema > docs/scene.schema.json";
}

TEST(SceneSchema, AcceptsTheShippedScenesAndRefusesWhatTheReaderRefuses) {
  const Value schema = json(scene_json_schema());
  const SchemaChecker checker(schema);
  for (const std::string& line : shipped_lines()) EXPECT_TRUE(checker.accepts(json(line)));
  for (const std::string& bad :
       {std::string("[1]"), std::string(R"({"id":"s"})"), std::string(R"({"id":"s","timestamp":-1})"),
        std::string(R"({"id":"s","timestamp":1,"identifiables":[{}]})"), with_cluster(R"("rs.annotation.Shape":[{}])"),
        with_cluster(R"("rs.annotation.Shape":[{"shape":"box","confidence":1.2}])"),
        with_cluster(R"("rs.annotation.Geometry":[{"size":[1,2]}])"),
        with_cluster(R"("rs.annotation.ClusterDistancesMatrix":[{"matrix":[[-2]]}])")}) {
    EXPECT_FALSE(checker.accepts(json(bad))) << bad;
    EXPECT_NE(error_of(bad), "") << bad;
  }
}

}  // namespace
}  // namespace sherlog
