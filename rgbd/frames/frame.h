// What a depth and colour camera gives at one moment.
//
// Depth is along the optical axis, in millimetres; 0 is a gap: no measurement, OpenCV's habit for such images. Colour
// is in the order blue, green, red. Both images have the same size and show the same ray at the same pixel. A camera
// looks along its z axis, x to the right and y down; a pose takes its points to the world, in metres.
// cv::Mat_ is the view: it knows its stride, may be a part of a larger image, and a copy of it shares the pixels.
// Functions here never write into an image that is given as const.
#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <opencv2/core.hpp>
#include <optional>
#include <string>

namespace sherlog::rgbd {

using DepthImage = cv::Mat1w;   // millimetres, 0 = gap
using ColourImage = cv::Mat3b;  // blue, green, red
using MaskImage = cv::Mat1b;    // 0 or 255

// A pinhole without distortion.
struct Calibration {
  std::int32_t width = 0, height = 0;
  double fx = 0, fy = 0, cx = 0, cy = 0;  // pixels
  double units_per_metre = 1000;          // of the depth in files: 5000 in TUM recordings

  cv::Size size() const { return {width, height}; }
  // Point in metres, in the camera's frame, of a pixel with a depth in metres; and the pixel of a point (z > 0).
  Eigen::Vector3d point(double x, double y, double depth) const {
    return {(x - cx) / fx * depth, (y - cy) / fy * depth, depth};
  }
  Eigen::Vector2d pixel(const Eigen::Vector3d& p) const { return {p.x() / p.z() * fx + cx, p.y() / p.z() * fy + cy}; }
};

// The Kinect's 57 x 43 degrees at this size.
Calibration kinect_calibration(std::int32_t width = 640, std::int32_t height = 480);
// Empty, or what cannot be: sizes or focal lengths that are not positive, a centre far outside of the image, not
// numbers.
std::string problem_of(const Calibration& calibration);

struct Frame {
  double time = 0;  // seconds
  DepthImage depth;
  ColourImage colour;
  std::optional<Eigen::Isometry3d> pose;  // camera to world
};

}  // namespace sherlog::rgbd
