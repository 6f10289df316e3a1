#include "perception_bridge/kitchen_scenes.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>

namespace sherlog {
namespace {

// SplitMix64 on a stream of its own, so that the scenes of kitchen_generator.h stay what they are.
class Draws {
 public:
  Draws(std::uint64_t seed, std::uint64_t number) : state_(mix(seed * 0x9e3779b97f4a7c15ULL) + mix(number + 1)) {}
  double uniform(double low, double high) {
    state_ += 0x9e3779b97f4a7c15ULL;
    return low + (high - low) * static_cast<double>(mix(state_) >> 11) * 0x1.0p-53;
  }
  // To a thousandth: what annotators write.
  double rounded(double low, double high) { return std::round(uniform(low, high) * 1000) / 1000; }

 private:
  static std::uint64_t mix(std::uint64_t z) {
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ULL;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebULL;
    return z ^ (z >> 31);
  }
  std::uint64_t state_;
};

std::string lower(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return text;
}

struct NamedColor {
  std::string_view name;
  double red, green, blue;
};
constexpr NamedColor kColors[] = {{"red", .8, .15, .1},   {"yellow", .85, .8, .15}, {"blue", .15, .25, .8},
                                  {"green", .2, .7, .25}, {"white", .95, .95, .95}, {"black", .08, .08, .08}};

// Where things of a context stand: x of the near left corner of a table of one square metre.
struct Place {
  std::string_view context, link;
  double x;
};
constexpr Place kPlaces[] = {{"breakfast", "counter_top_island_link", 0},
                             {"cooking", "stove_link", 2},
                             {"drawer", "drawer_sinkblock_link", 4},
                             {"fridge", "fridge_link", 6}};

Annotation annotation(const char* type, Value::Object fields, const char* source,
                      std::optional<double> confidence = {}) {
  Annotation result;
  result.type = type;
  result.fields = std::move(fields);
  result.source = source;
  result.confidence = confidence;
  return result;
}

Annotation named(const char* type, const char* field, const std::string& value, const char* source,
                 std::optional<double> confidence = {}) {
  return annotation(type, {{field, Value(value)}}, source, confidence);
}

Annotation goggles(const char* category, const std::string& title) {
  return annotation("rs.annotation.Goggles", {{"category", Value(category)}, {"title", Value(title)}},
                    "ClusterGogglesAnnotator");
}

Annotation pose(double time, const std::vector<double>& translation) {
  const Value stamped(Value::Object{{"frame", Value("map")},
                                    {"timestamp", Value(time)},
                                    {"rotation", number_list({0, 0, 0, 1})},
                                    {"translation", number_list(translation)}});
  return annotation("rs.annotation.PoseAnnotation", {{"world", Value(Value::Object{{"rs.tf.StampedPose", stamped}})}},
                    "Cluster3DGeometryAnnotator");
}

void add_colors(const KitchenConfig& config, const KitchenObject& object, Draws& draws, Cluster& cluster) {
  std::vector<double> mean(3, 0.0);
  double left = 1;
  for (const std::uint32_t color : object.colors) {
    const std::string name = lower(config.colors[color]);
    const double ratio = std::round(left * draws.uniform(0.5, 0.8) * 1000) / 1000;
    left -= ratio;
    cluster.annotations.push_back(
        annotation("rs.annotation.SemanticColor", {{"color", Value(name)}, {"ratio", Value(ratio)}}, "ColorAnnotator"));
    for (const NamedColor& entry : kColors) {
      if (entry.name != name) continue;
      mean[0] += entry.red / static_cast<double>(object.colors.size());
      mean[1] += entry.green / static_cast<double>(object.colors.size());
      mean[2] += entry.blue / static_cast<double>(object.colors.size());
    }
  }
  for (double& channel : mean)
    channel = std::round(std::clamp(channel + draws.uniform(-.05, .05), 0.0, 1.0) * 1000) / 1000;
  cluster.annotations.push_back(
      annotation("sherlog.annotation.MeanColor", {{"color", number_list(mean)}}, "ColorAnnotator"));
}

Cluster kitchen_cluster(const KitchenConfig& config, const KitchenObject& object, double time, const Place& place,
                        bool labels, Draws& draws) {
  Cluster cluster;
  cluster.timestamp = time;
  cluster.hypotheses.push_back(annotation("rs.scene.ImageROI",
                                          {{"x", Value(std::round(draws.uniform(0, 540)))},
                                           {"y", Value(std::round(draws.uniform(0, 380)))},
                                           {"width", Value(std::round(draws.uniform(20, 100)))},
                                           {"height", Value(std::round(draws.uniform(20, 100)))}},
                                          "PointCloudClusterExtractor"));
  for (const std::uint32_t shape : object.shapes) {
    cluster.annotations.push_back(named("rs.annotation.Shape", "shape", lower(config.shapes[shape]),
                                        "PrimitiveShapeAnnotator", draws.rounded(0.55, 0.95)));
  }
  add_colors(config, object, draws, cluster);
  if (object.big) {
    cluster.annotations.push_back(named("rs.annotation.SemanticSize", "size", *object.big ? "large" : "small",
                                        "Cluster3DGeometryAnnotator", draws.rounded(0.6, 0.99)));
  }
  if (object.text) cluster.annotations.push_back(goggles("Text", *object.text));
  if (object.logo) cluster.annotations.push_back(goggles("Logo", *object.logo));
  if (object.image) cluster.annotations.push_back(goggles("Image", *object.image));
  if (object.product) cluster.annotations.push_back(goggles("Product", *object.product));
  if (object.contact) cluster.annotations.push_back(goggles("Contact", *object.contact));
  if (object.detected) {
    cluster.annotations.push_back(
        named("rs.annotation.Detection", "name", *object.detected, "LinemodAnnotator", draws.rounded(0.3, 0.8)));
  }
  if (labels) {
    const std::string& name = config.classes[object.object_class].name;
    cluster.annotations.push_back(annotation("rs.annotation.GroundTruth",
                                             {{"classificationGT", Value(Value::Object{{"classname", Value(name)}})}},
                                             "GroundTruthAnnotator"));
  }
  cluster.annotations.push_back(
      pose(time, {place.x + draws.rounded(0, 1), draws.rounded(0, 1), draws.rounded(0.85, 1.1)}));
  cluster.annotations.push_back(
      annotation("rs.annotation.TFLocation",
                 {{"frame_id", Value(std::string(place.link))}, {"reference_desc", Value("on")}}, "URDFRegionFilter"));
  return cluster;
}

}  // namespace

Scene kitchen_scene(const KitchenConfig& config, std::uint64_t seed, std::uint64_t number,
                    const KitchenSceneOptions& options) {
  const KitchenScene facts = generate_kitchen_scene(config, seed, number);
  Draws draws(seed, number);
  Scene scene;
  scene.id = fmt::format("kitchen-{}-{}", seed, number);
  scene.timestamp = options.start + options.interval * static_cast<double>(number);
  scene.frame = "map";
  const std::string context = lower(config.contexts[facts.context]);
  const auto* place = std::find_if(std::begin(kPlaces), std::end(kPlaces) - 1,
                                   [&](const Place& entry) { return entry.context == context; });
  scene.annotations.push_back(named("sherlog.annotation.Context", "name", context, "KitchenGenerator"));
  Annotation view =
      annotation("sherlog.annotation.ViewBox",
                 {{"min", number_list({place->x, 0})}, {"max", number_list({place->x + 1, 1})}}, "KitchenGenerator");
  view.frame = "map";
  scene.annotations.push_back(std::move(view));
  // Run times: means and deviations of Table 2 of the RoboSherlock paper, drawn from between two deviations.
  struct Cost {
    const char* annotator;
    double mean, deviation;
  };
  for (const auto& [name, mean, deviation] :
       {Cost{"URDFRegionFilter", 48.5, 6.0}, Cost{"PointCloudClusterExtractor", 1513.8, 850.3},
        Cost{"SmallObjectAnnotator", 741.4, 166.0}, Cost{"GenericFeatureFromNormalsEstimator", 265.6, 91.5},
        Cost{"ClusterTracker", 101.4, 36.7}, Cost{"ClusterGogglesAnnotator", 4945.7, 1446.0}}) {
    const double milliseconds = std::max(1.0, draws.rounded(mean - 1.7 * deviation, mean + 1.7 * deviation));
    scene.annotations.push_back(annotation("rs.annotation.LoggingInformation",
                                           {{"annotator", Value(name)}, {"milliseconds", Value(milliseconds)}}, name));
  }
  for (const KitchenObject& object : facts.objects) {
    scene.clusters.push_back(kitchen_cluster(config, object, scene.timestamp, *place, options.labels, draws));
    scene.clusters.back().id = fmt::format("c{}", scene.clusters.size() - 1);
  }
  return scene;
}

}  // namespace sherlog
