#include "rgbd/pipeline/object_annotators.h"

#include <algorithm>
#include <cmath>

#include "rgbd/depth/background.h"
#include "rgbd/objects/looks.h"
#include "rgbd/pipeline/declared.h"
#include "rgbd/pipeline/people_annotators.h"

namespace sherlog::rgbd {
namespace {

using Camera = std::optional<Eigen::Isometry3d>;
using Forms = std::vector<ShapeFit>;
using Tables = std::vector<Table>;

class Preprocessing : public Declared {
 public:
  Preprocessing() : Declared("DepthPreprocessing", {"depth", "colour"}, {"filled", "disparity", "foreground"}, 25) {}
  void process(const Analysis& in, Analysis& out) override {
    const PreprocessedDepth& result = chain_.next(in.need<DepthImage>("depth"), in.need<ColourImage>("colour"));
    DepthImage filled;
    to_depth(result.disparity, filled);
    out.set("filled", filled);
    out.set<DisparityImage>("disparity", result.disparity.clone());
    out.set<MaskImage>("foreground", result.foreground.clone());
  }

 private:
  DepthPreprocessing chain_;
};

class CloudMaker : public Declared {
 public:
  CloudMaker() : Declared("CloudAnnotator", {"depth", "calibration"}, {"cloud"}, 15) {}
  void process(const Analysis& in, Analysis& out) override {
    const DepthImage& depth = in.need<DepthImage>("depth");
    DepthImage smooth(depth.size());
    selective_median(depth, smooth);
    smooth.setTo(0, depth == 0);  // it closes small gaps, which are none of our points
    out.set("cloud", cloud_of(smooth, in.need<Calibration>("calibration")));
  }
};

class TableTop : public Declared {
 public:
  explicit TableTop(const SemanticMap& map)
      : Declared("TableTopAnnotator", {"cloud", "camera"}, {"tables", "points"}, 60) {
    for (const Surface& surface : map) options_.heights.push_back(surface.height);
  }
  void process(const Analysis& in, Analysis& out) override {
    const Cloud& cloud = in.need<Cloud>("cloud");
    std::string problem;
    Tables tables = find_tables(cloud, in.need<Camera>("camera"), options_, problem);
    if (tables.empty()) throw std::runtime_error(problem);
    std::vector<cv::Mat3f> points;
    for (const Table& table : tables) points.push_back(above_table(cloud, table));
    out.set("points", std::move(points));
    out.set("tables", std::move(tables));
  }

 private:
  TableOptions options_;
};

class ClusterExtractor : public Declared {
 public:
  ClusterExtractor()
      : Declared("PointCloudClusterExtractor", {"points", "colour", "tables", "calibration", "robot"},
                 {"things", "rs.scene.ImageROI", "rs.scene.ClusterPoints"}, 150) {}
  void process(const Analysis& in, Analysis& out) override {
    const Tables& tables = in.need<Tables>("tables");
    Hypotheses found = find_hypotheses(in.need<std::vector<cv::Mat3f>>("points"), in.need<ColourImage>("colour"),
                                       tables, in.need<Calibration>("calibration"), {}, in.need<MaskImage>("robot"));
    for (std::size_t i = 0; i < found.things.size(); ++i) {
      const Hypothesis& thing = found.things[i];
      const Table& table = tables[thing.table];
      out.annotate(i, make("rs.scene.ImageROI", {{"x", Value(std::int64_t{thing.roi.x})},
                                                 {"y", Value(std::int64_t{thing.roi.y})},
                                                 {"width", Value(std::int64_t{thing.roi.width})},
                                                 {"height", Value(std::int64_t{thing.roi.height})}}));
      Eigen::Vector3d mean = Eigen::Vector3d::Zero();
      for (const Eigen::Vector3f& p : thing.points) mean += p.cast<double>();
      if (thing.points.empty()) continue;
      mean = table.in_world * Eigen::Vector3d(mean / static_cast<double>(thing.points.size()));
      Annotation points =
          make("rs.scene.ClusterPoints",
               {{"centroid", rounded_numbers(mean)}, {"count", Value(static_cast<std::int64_t>(thing.points.size()))}});
      points.frame = table.has_world ? "map" : "camera";
      out.annotate(i, std::move(points));
    }
    out.set("things", std::move(found));
  }
};

class Fitter : public Declared {
 public:
  Fitter() : Declared("PrimitiveFitter", {"things", "tables"}, {"forms"}, 20) {}
  void process(const Analysis& in, Analysis& out) override {
    const Tables& tables = in.need<Tables>("tables");
    Forms forms;
    for (const Hypothesis& thing : in.need<Hypotheses>("things").things) {
      const Table& table = tables[thing.table];
      const double metres =
          thing.points.empty() ? 1 : (table.pose * Eigen::Vector3d(thing.points[0].cast<double>())).z();
      forms.push_back(fit_shape(thing, depth_error(metres)));
    }
    out.set("forms", std::move(forms));
  }
};

class ShapeAnnotator : public Declared {
 public:
  ShapeAnnotator() : Declared("PrimitiveShapeAnnotator", {"forms"}, {"rs.annotation.Shape"}, 1) {
    set_written_values("rs.annotation.Shape", {kShapes.begin(), kShapes.end()});
  }
  void process(const Analysis& in, Analysis& out) override {
    const Forms& forms = in.need<Forms>("forms");
    for (std::size_t i = 0; i < forms.size(); ++i) {
      if (forms[i].shape.empty()) continue;
      out.annotate(i, make("rs.annotation.Shape", {{"shape", Value(forms[i].shape)}}, forms[i].confidence));
    }
  }
};

class GeometryAnnotator : public Declared {
 public:
  GeometryAnnotator()
      : Declared("Cluster3DGeometryAnnotator", {"things", "forms", "tables"},
                 {"rs.annotation.SemanticSize", "rs.annotation.Geometry", "rs.annotation.PoseAnnotation"}, 1) {
    set_written_values("rs.annotation.SemanticSize", {kSizes.begin(), kSizes.end()});
  }
  void process(const Analysis& in, Analysis& out) override {
    const Forms& forms = in.need<Forms>("forms");
    const auto& things = in.need<Hypotheses>("things").things;
    for (std::size_t i = 0; i < forms.size(); ++i) {
      if (forms[i].shape.empty()) continue;
      const Table& table = in.need<Tables>("tables")[things[i].table];
      const Box& box = forms[i].box;
      const SizeName size = size_name(box.size.prod());
      out.annotate(i, make("rs.annotation.SemanticSize", {{"size", Value(size.name)}}, size.confidence));
      out.annotate(i, make("rs.annotation.Geometry", {{"size", rounded_numbers(box.size)}}));
      const Eigen::Isometry3d pose =
          table.in_world * Eigen::Translation3d(box.centre) * Eigen::AngleAxisd(box.heading, Eigen::Vector3d::UnitZ());
      const Eigen::Quaterniond turn(pose.linear());
      const Value stamped(Value::Object{{"frame", Value(table.has_world ? "map" : "camera")},
                                        {"rotation", rounded_numbers(turn.coeffs())},
                                        {"translation", rounded_numbers(pose.translation())}});
      out.annotate(i, make("rs.annotation.PoseAnnotation", {{table.has_world ? "world" : "camera",
                                                             Value(Value::Object{{"rs.tf.StampedPose", stamped}})}}));
    }
  }
};

class ColourAnnotator : public Declared {
 public:
  ColourAnnotator()
      : Declared(
            "ColorAnnotator", {"things", "colour"},
            {"rs.annotation.SemanticColor", "sherlog.annotation.MeanColor", "rs.annotation.HueSaturationHistogram"},
            5) {
    set_written_values("rs.annotation.SemanticColor", {kColours.begin(), kColours.end()});
  }
  void process(const Analysis& in, Analysis& out) override {
    const auto& things = in.need<Hypotheses>("things").things;
    const ColourImage& colour = in.need<ColourImage>("colour");
    for (std::size_t i = 0; i < things.size() && !colour.empty(); ++i) {
      for (const ColourName& name : colour_names(colour, things[i])) {
        if (name.share < kReportedShare) continue;
        out.annotate(i, make("rs.annotation.SemanticColor",
                             {{"color", Value(name.name)}, {"ratio", Value(rounded(name.share, 1e4))}}));
      }
      const auto mean = mean_colour(colour, things[i]);
      out.annotate(i, make("sherlog.annotation.MeanColor",
                           {{"color", rounded_numbers(Eigen::Vector3d(mean[0], mean[1], mean[2]))}}));
      out.annotate(i, make("rs.annotation.HueSaturationHistogram",
                           {{"hist", number_list(colour_histogram(colour, things[i]))}}));
    }
  }
};

class FeatureAnnotator : public Declared {
 public:
  FeatureAnnotator() : Declared("ShapeFeatureAnnotator", {"things"}, {"rs.annotation.PclFeature"}, 3) {}
  void process(const Analysis& in, Analysis& out) override {
    const auto& things = in.need<Hypotheses>("things").things;
    for (std::size_t i = 0; i < things.size(); ++i) {
      out.annotate(i, make("rs.annotation.PclFeature", {{"feature", number_list(shape_features(things[i]))},
                                                        {"feat_type", Value("RadiusHeightDistance")}}));
    }
  }
};

class LocationAnnotator : public Declared {
 public:
  explicit LocationAnnotator(SemanticMap map)
      : Declared("LocationAnnotator", {"things", "forms", "tables"}, {"rs.annotation.TFLocation"}, 1),
        map_(std::move(map)) {
    Names names = {"table"};
    for (const Surface& surface : map_) names.push_back(surface.name);
    set_written_values("rs.annotation.TFLocation", std::move(names));
  }
  void process(const Analysis& in, Analysis& out) override {
    const Forms& forms = in.need<Forms>("forms");
    const auto& things = in.need<Hypotheses>("things").things;
    for (std::size_t i = 0; i < forms.size(); ++i) {
      const Table& table = in.need<Tables>("tables")[things[i].table];
      Eigen::Vector3d foot = forms[i].shape.empty() ? middle_of(things[i]) : forms[i].box.centre;
      foot.z() = 0;
      out.annotate(i, make("rs.annotation.TFLocation", {{"frame_id", Value(name_at(table, table.in_world * foot))},
                                                        {"reference_desc", Value("on top of")}}));
    }
  }

 private:
  static Eigen::Vector3d middle_of(const Hypothesis& thing) {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (const Eigen::Vector3f& p : thing.points) sum += p.cast<double>();
    return thing.points.empty() ? sum : Eigen::Vector3d(sum / static_cast<double>(thing.points.size()));
  }

  // The map's surface below the place; without one it is a table.
  std::string name_at(const Table& table, const Eigen::Vector3d& foot) const {
    constexpr double kMargin = 0.05;
    for (const Surface& surface : map_) {
      const bool is_above =
          (foot.head<2>() - surface.low).minCoeff() > -kMargin && (surface.high - foot.head<2>()).minCoeff() > -kMargin;
      if (table.has_world && is_above && std::abs(foot.z() - surface.height) < kMargin) return surface.name;
    }
    return "table";
  }

  SemanticMap map_;
};

// Each known thing's likelihood: differences of edges in logarithms, of the mean colour, and of the shape's name.
class KnownThingsAnnotator : public Declared {
 public:
  explicit KnownThingsAnnotator(std::vector<KnownThing> things)
      : Declared("KnownThingsAnnotator",
                 {"rs.annotation.Shape", "rs.annotation.Geometry", "sherlog.annotation.MeanColor"},
                 {"rs.annotation.Classification"}, 1),
        things_(std::move(things)) {
    Names names;
    for (const KnownThing& thing : things_) names.push_back(thing.name);
    set_written_values("rs.annotation.Classification", std::move(names));
  }
  void process(const Analysis& in, Analysis& out) override {
    for (std::size_t i = 0; i < in.clusters(); ++i) {
      const auto shapes = in.annotations_of(i, "rs.annotation.Shape");
      const auto sizes = in.annotations_of(i, "rs.annotation.Geometry");
      const auto colours = in.annotations_of(i, "sherlog.annotation.MeanColor");
      if (shapes.empty() || sizes.empty() || colours.empty()) continue;
      const Value* size_value = find(sizes[0]->fields, "size");
      const Value* colour_value = find(colours[0]->fields, "color");
      const auto size = size_value == nullptr ? std::nullopt : numbers_of(*size_value);
      const auto colour = colour_value == nullptr ? std::nullopt : numbers_of(*colour_value);
      if (!size || !colour) continue;
      annotate(i, std::string(text_field(*shapes[0], "shape")), {(*size)[0], (*size)[1], (*size)[2]}, *colour, out);
    }
  }

 private:
  double log_likelihood(const KnownThing& known, const std::string& shape, Eigen::Vector3d size,
                        const std::vector<double>& colour) const {
    constexpr double kSizeSigma = 0.15, kColourSigma = 0.1, kLogOfWrongShape = -3;
    Eigen::Vector3d its = known.size;
    if (size.x() < size.y()) std::swap(size.x(), size.y());
    if (its.x() < its.y()) std::swap(its.x(), its.y());
    double sum = shape == known.shape ? 0 : kLogOfWrongShape;
    for (int axis = 0; axis < 3; ++axis) {
      // A few millimetres are nothing, which matters for thin things.
      const double off = std::log((size[axis] + 0.005) / (its[axis] + 0.005)) / kSizeSigma;
      sum -= off * off / 2;
    }
    // Brightness is more the lamp's than the thing's.
    const double light = (colour[0] + colour[1] + colour[2] - known.colour[0] - known.colour[1] - known.colour[2]) / 3;
    for (std::size_t c = 0; c < 3; ++c) {
      const double off = (colour[c] - known.colour[c] - 0.7 * light) / kColourSigma;
      sum -= off * off / 2;
    }
    return sum;
  }

  void annotate(std::size_t cluster, const std::string& shape, const Eigen::Vector3d& size,
                const std::vector<double>& colour, Analysis& out) const {
    constexpr double kUnknown = -12;  // what fits no better is none of them
    std::vector<std::pair<double, const KnownThing*>> scores;
    double sum = std::exp(kUnknown);
    for (const KnownThing& known : things_) {
      scores.emplace_back(std::exp(log_likelihood(known, shape, size, colour)), &known);
      sum += scores.back().first;
    }
    std::ranges::stable_sort(scores, std::greater<>{}, [](const auto& score) { return score.first; });
    if (scores.empty() || scores[0].first < std::exp(kUnknown)) return;
    Value::List confidences;
    for (const auto& [score, known] : scores) {
      if (score / sum < 0.01) continue;
      confidences.emplace_back(
          Value::Object{{"name", Value(known->name)}, {"score", Value(rounded(score / sum, 1e4))}});
    }
    out.annotate(cluster, make("rs.annotation.Classification",
                               {{"classname", Value(scores[0].second->name)},
                                {"classification_type", Value("CLASS")},
                                {"classifier", Value("known things")},
                                {"confidences", Value(std::move(confidences))}},
                               scores[0].first / sum));
  }

  std::vector<KnownThing> things_;
};

}  // namespace

const std::vector<std::string>& frame_views() {
  static const std::vector<std::string> kViews = {"depth", "colour", "calibration", "camera", "structure"};
  return kViews;
}

Annotators object_annotators(const Knowledge& knowledge) {
  Annotators annotators;
  annotators.push_back(std::make_unique<Preprocessing>());
  annotators.push_back(region_filter());
  annotators.push_back(std::make_unique<CloudMaker>());
  annotators.push_back(std::make_unique<TableTop>(knowledge.map));
  annotators.push_back(std::make_unique<ClusterExtractor>());
  annotators.push_back(std::make_unique<Fitter>());
  annotators.push_back(std::make_unique<ShapeAnnotator>());
  annotators.push_back(std::make_unique<GeometryAnnotator>());
  annotators.push_back(std::make_unique<ColourAnnotator>());
  annotators.push_back(std::make_unique<FeatureAnnotator>());
  annotators.push_back(std::make_unique<LocationAnnotator>(knowledge.map));
  if (!knowledge.things.empty()) annotators.push_back(std::make_unique<KnownThingsAnnotator>(knowledge.things));
  return annotators;
}

}  // namespace sherlog::rgbd
