#include "rgbd/pipeline/perception.h"

#include <fmt/format.h>

#include <cmath>

#include "perception_bridge/annotation_types.h"

namespace sherlog::rgbd {
namespace {

Annotation view_annotation(const Frame& frame, const Calibration& calibration) {
  const Eigen::Isometry3d camera = frame.pose.value_or(Eigen::Isometry3d::Identity());
  const Eigen::Quaterniond turn(camera.linear());
  const Eigen::Vector3d place = camera.translation();
  Annotation view;
  view.type = "sherlog.annotation.ViewFrustum";
  view.frame = frame.pose ? "map" : "camera";
  view.fields = {{"translation", number_list({place.x(), place.y(), place.z()})},
                 {"rotation", number_list({turn.x(), turn.y(), turn.z(), turn.w()})},
                 {"horizontal_angle", Value(2 * std::atan(calibration.width / (2 * calibration.fx)))},
                 {"vertical_angle", Value(2 * std::atan(calibration.height / (2 * calibration.fy)))}};
  return view;
}

Annotation logging(const AnnotatorRun& run) {
  Annotation log;
  log.type = "rs.annotation.LoggingInformation";
  log.source = run.annotator;
  log.fields = {{"annotator", Value(run.annotator)}, {"milliseconds", Value(run.milliseconds)}};
  if (!run.problem.empty()) log.fields.emplace_back("message", Value(run.problem));
  return log;
}

// Annotators rely on it. A frame may have no colour at all.
std::string mismatch(const Frame& frame, const Calibration& calibration) {
  const auto differs = [](const char* image, cv::Size size, cv::Size expected) {
    return fmt::format("the {} image has {} x {} pixels, the calibration {} x {}", image, size.width, size.height,
                       expected.width, expected.height);
  };
  if (frame.depth.size() != calibration.size()) return differs("depth", frame.depth.size(), calibration.size());
  if (!frame.colour.empty() && frame.colour.size() != calibration.size())
    return differs("colour", frame.colour.size(), calibration.size());
  return {};
}

std::vector<Wanted> conditions_of(const PerceptionOptions& options) {
  return options.request ? options.request->wanted() : std::vector<Wanted>();
}

std::vector<Wanted> wanted_of(const Annotators& annotators, const PerceptionOptions& options) {
  std::vector<Wanted> wanted;
  for (const std::string& name : options.also) wanted.push_back({{name}});
  if (!options.request && !options.everything) {
    if (wanted.empty()) wanted.push_back({{"foreground"}});
    return wanted;
  }
  std::vector<std::string> all;
  for (const auto& annotator : annotators) {
    for (std::string& name : annotator->writes()) {
      if (is_type_name(name)) all.push_back(std::move(name));
    }
  }
  // Where it is belongs to every answer.
  for (const char* name : {"rs.scene.ImageROI", "rs.annotation.PoseAnnotation"}) {
    if (std::ranges::find(all, name) != all.end()) wanted.push_back({.names = {name}, .is_needed = false});
  }
  for (Wanted& condition : conditions_of(options)) wanted.push_back(std::move(condition));
  if (options.everything || !options.request || options.request->wants_everything()) {
    for (std::string& name : all) wanted.push_back({.names = {std::move(name)}, .is_needed = false});
  }
  return wanted;
}

}  // namespace

std::optional<Perception> Perception::make(Annotators annotators, PerceptionOptions options, std::string& problem) {
  const std::vector<Wanted> wanted = wanted_of(annotators, options);
  const std::vector<Wanted> conditions = conditions_of(options);
  auto flow = options.flow.empty() ? plan_flow(annotators, frame_views(), wanted, problem)
                                   : fixed_flow(annotators, frame_views(), options.flow, conditions, problem);
  if (!flow) return std::nullopt;
  return Perception(std::move(annotators), std::move(*flow), std::move(options));
}

std::vector<std::string> Perception::annotators() const {
  std::vector<std::string> names;
  for (std::size_t step = 0; step < flow_.order.size(); ++step) names.push_back(annotator(step).name());
  return names;
}

Perceived Perception::perceive(const Frame& frame, const Calibration& calibration, std::size_t number,
                               const KnownBodies& bodies) {
  Perceived result;
  result.analysis.set("depth", frame.depth);
  result.analysis.set("colour", frame.colour);
  result.analysis.set("calibration", calibration);
  result.analysis.set("camera", frame.pose);
  result.analysis.set("structure", bodies);
  if (const std::string problem = mismatch(frame, calibration); !problem.empty()) {
    result.runs = {{.annotator = "Frame", .problem = problem}};
  } else {
    result.runs = run_flow(annotators_, flow_, result.analysis, options_.threads);
  }
  times_.add(result.runs);

  sherlog::Scene& scene = result.scene;
  scene.id = fmt::format("{}{:06}", options_.prefix, number);
  scene.timestamp = frame.time;
  scene.frame = frame.pose ? "map" : "camera";
  scene.annotations.push_back(view_annotation(frame, calibration));
  for (const Annotation* annotation : result.analysis.annotations(Analysis::kScene)) {
    scene.annotations.push_back(*annotation);
  }
  if (options_.log_times) {
    for (const AnnotatorRun& run : result.runs) scene.annotations.push_back(logging(run));
  }
  for (std::size_t i = 0; i < result.analysis.clusters(); ++i) {
    Cluster cluster;
    cluster.id = fmt::format("c{}", i);
    cluster.timestamp = frame.time;
    for (const Annotation* annotation : result.analysis.annotations(i)) {
      auto& list = is_hypothesis_type(annotation->type) ? cluster.hypotheses : cluster.annotations;
      list.push_back(*annotation);
    }
    scene.clusters.push_back(std::move(cluster));
  }
  if (const auto* found = result.analysis.view<Hypotheses>("things")) result.reaching = found->reaching;
  return result;
}

}  // namespace sherlog::rgbd
