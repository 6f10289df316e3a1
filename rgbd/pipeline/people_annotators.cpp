#include "rgbd/pipeline/people_annotators.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <opencv2/imgproc.hpp>
#include <optional>

#include "rgbd/pipeline/declared.h"

namespace sherlog::rgbd {
namespace {

using Camera = std::optional<Eigen::Isometry3d>;

class RegionFilter : public Declared {
 public:
  RegionFilter() : Declared("RegionFilter", {"depth", "calibration", "camera", "structure"}, {"known", "robot"}, 4) {}
  void process(const Analysis& in, Analysis& out) override {
    const DepthImage& depth = in.need<DepthImage>("depth");
    const KnownBodies& bodies = in.need<KnownBodies>("structure");
    MaskImage known = measured(depth, in, bodies.map);
    MaskImage robot = measured(depth, in, bodies.robot);
    // Where the robot gives no depth it still has a colour.
    if (cv::countNonZero(robot) > 0) robot.setTo(255, (depth == 0) & (view_.disparity() < static_cast<float>(kA1)));
    out.set("known", std::move(known));
    out.set("robot", std::move(robot));
  }

 private:
  // 255 where the image measures these bodies. Without the camera's pose nothing can be said.
  MaskImage measured(const DepthImage& depth, const Analysis& in, const std::vector<PlacedMesh>& bodies) {
    MaskImage mask(depth.size(), std::uint8_t{0});
    const Camera& camera = in.need<Camera>("camera");
    if (!camera || bodies.empty()) return mask;
    view_.clear(depth.size());
    view_.draw(bodies, in.need<Calibration>("calibration"), *camera);
    known_structure(depth, view_.disparity(), {}, mask);
    return mask;
  }

  VirtualView view_;
};

// Pixels of the largest connected part. Of a person there are lines of many; what flickers at the edge of the background
// behind one makes specks.
std::size_t largest_part(const std::vector<Keypoint>& points) {
  cv::Rect box(points[0].pixel.x, points[0].pixel.y, 1, 1);
  for (const Keypoint& point : points) box |= cv::Rect(point.pixel.x, point.pixel.y, 1, 1);
  cv::Mat1b lines(box.size(), std::uint8_t{0});
  for (const Keypoint& point : points) lines(point.pixel.y - box.y, point.pixel.x - box.x) = 255;
  cv::Mat1i labels;
  cv::Mat statistics, centres;
  const int count = cv::connectedComponentsWithStats(lines, labels, statistics, centres, 8, CV_32S);
  std::int32_t largest = 0;
  for (int i = 1; i < count; ++i) largest = std::max(largest, statistics.at<std::int32_t>(i, cv::CC_STAT_AREA));
  return static_cast<std::size_t>(largest);
}

class HumanAnnotator : public Declared {
 public:
  explicit HumanAnnotator(const SegmentationOptions& options)
      : Declared("HumanAnnotator", {"disparity", "foreground", "calibration", "camera", "known", "robot"},
                 {"people", "sherlog.annotation.Person", "sherlog.annotation.Crowd"}, 10),
        most_(options.most_means),
        segmentation_(options) {}

  void process(const Analysis& in, Analysis& out) override {
    const auto& calibration = in.need<Calibration>("calibration");
    MaskImage foreground = in.need<MaskImage>("foreground").clone();
    foreground.setTo(0, in.need<MaskImage>("known"));
    foreground.setTo(0, in.need<MaskImage>("robot"));
    if (map_.width != calibration.width || map_.height != calibration.height)
      map_ = make_hilbert_map(calibration.width, calibration.height);
    const auto points = keypoints(in.need<DisparityImage>("disparity"), foreground, calibration);
    const auto labels = segmentation_.next(points);
    std::map<std::int32_t, std::vector<Keypoint>> by_label;
    for (std::size_t i = 0; i < points.size(); ++i) {
      if (labels[i] > 0) by_label[labels[i]].push_back(points[i]);
    }
    const Camera& camera = in.need<Camera>("camera");
    std::vector<Person> people;
    for (auto& [label, its] : by_label) {
      if (its.size() < kLeastKeypoints) continue;
      const std::size_t line = largest_part(its);
      if (line < kLongLine && 10 * line < 7 * its.size()) continue;
      auto person = describe(label, std::move(its), calibration, camera);
      if (!person) continue;
      out.annotate(Analysis::kScene, annotation(*person, camera.has_value()));
      people.push_back(std::move(*person));
    }
    if (const std::size_t groups = segmentation_.crowded_out(); groups > 0) {
      out.annotate(Analysis::kScene,
                   make("sherlog.annotation.Crowd", {{"most", Value(static_cast<std::int64_t>(most_))},
                                                     {"groups", Value(static_cast<std::int64_t>(groups))}}));
    }
    out.set("people", std::move(people));
  }

 private:
  static constexpr std::size_t kLeastKeypoints = 15;  // less is a hand at the border of the picture
  static constexpr std::size_t kLongLine = 20;        // pixels; shorter ones have to be nearly all that there is
  static constexpr double kSamePosture = 0.75;        // correlation

  std::optional<Person> describe(std::int32_t label, std::vector<Keypoint> points, const Calibration& calibration,
                                 const Camera& camera) {
    std::vector<Pixel> pixels;
    for (const Keypoint& point : points) pixels.push_back(point.pixel);
    const PoseOptions options;
    const auto directions = branch_directions(map_, pixels, options.neighbours);
    const auto pose = directions ? describe_pose(pixels, *directions, options) : std::nullopt;
    if (!pose) return std::nullopt;
    Person person;
    person.label = label;
    person.pose = *pose;
    person.position = middle_of(points, calibration);
    if (camera) person.position = *camera * person.position;
    person.keypoints = std::move(points);
    const auto known = library_.find(*pose, kSamePosture);
    if (known.empty()) library_.add(*pose);
    person.posture = known.empty() ? library_.size() - 1 : known.front().pose;
    person.similarity = similarity(known.empty() ? 1 : known.front().correlation);
    return person;
  }

  static Eigen::Vector3d middle_of(const std::vector<Keypoint>& points, const Calibration& calibration) {
    Eigen::Vector3d middle;
    std::vector<double> values(points.size());
    for (int axis = 0; axis < 3; ++axis) {
      std::ranges::transform(points, values.begin(), [&](const Keypoint& point) {
        return calibration.point(point.pixel.x, point.pixel.y, static_cast<double>(point.depth))[axis];
      });
      const auto half = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
      std::ranges::nth_element(values, half);
      middle[axis] = *half;
    }
    return middle;
  }

  Annotation annotation(const Person& person, bool has_world) const {
    cv::Rect box(person.keypoints[0].pixel.x, person.keypoints[0].pixel.y, 1, 1);
    for (const Keypoint& point : person.keypoints) box |= cv::Rect(point.pixel.x, point.pixel.y, 1, 1);
    Annotation result = make("sherlog.annotation.Person",
                             {{"label", Value(std::int64_t{person.label})},
                              {"position", rounded_numbers(person.position, 1e3)},
                              {"keypoints", Value(static_cast<std::int64_t>(person.keypoints.size()))},
                              {"roi", number_list({static_cast<double>(box.x), static_cast<double>(box.y),
                                                   static_cast<double>(box.width), static_cast<double>(box.height)})},
                              {"posture", Value(static_cast<std::int64_t>(person.posture))},
                              {"similarity", Value(rounded(person.similarity, 10))}});
    result.frame = has_world ? "map" : "camera";
    return result;
  }

  HilbertMap map_;
  std::size_t most_;
  SpatioTemporalSegmentation segmentation_;
  PoseLibrary library_;
};

}  // namespace

Annotators people_annotators(const SegmentationOptions& options) {
  Annotators annotators;
  annotators.push_back(std::make_unique<HumanAnnotator>(options));
  return annotators;
}

std::unique_ptr<Annotator> region_filter() { return std::make_unique<RegionFilter>(); }

}  // namespace sherlog::rgbd
