#include "rgbd/objects/standing.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace sherlog::rgbd {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

// Value below which that share lies; moves the values. Requires values.
double quantile(std::vector<double>& values, double share) {
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

}  // namespace

Standing::Standing(const cv::Mat3f& points, const Table& table, const Calibration& calibration,
                   const HypothesisOptions& options)
    : points_(points),
      table_(table),
      calibration_(calibration),
      options_(options),
      eye_(table.pose.inverse(Eigen::Isometry).translation()),
      depth_row_(table.pose.matrix().row(2)) {}

Standing::Foot Standing::foot_of(const std::vector<cv::Point>& pixels) const {
  constexpr double kHalfSlice = 0.015;  // metres
  Foot foot;
  std::vector<double> heights;
  Vector2d mean = Vector2d::Zero();
  for (const cv::Point& p : pixels) {
    heights.push_back(points_(p)[2]);
    mean += Vector2d(points_(p)[0], points_(p)[1]) / static_cast<double>(pixels.size());
  }
  foot.lowest = quantile(heights, 0.02);
  foot.highest = quantile(heights, 0.98);
  const Vector2d line = mean - eye_.head<2>();
  foot.away = line.norm() > 1e-6 ? Vector2d(line.normalized()) : Vector2d(1, 0);
  const Vector2d across(-foot.away.y(), foot.away.x());
  // A slice through its middle: a bent thing is not over the middle of all of it.
  std::vector<double> side, along;
  for (const cv::Point& p : pixels) side.push_back(across.dot(Vector2d(points_(p)[0], points_(p)[1])));
  std::vector<double> moved = side;
  const double middle = quantile(moved, 0.5);
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    if (std::abs(side[i] - middle) > kHalfSlice) continue;
    along.push_back(foot.away.dot(Vector2d(points_(pixels[i])[0], points_(pixels[i])[1])));
  }
  const double near = quantile(along, 0.02), far = quantile(along, 0.98);
  foot.middle = foot.away * ((near + far) / 2) + across * middle;
  foot.depth = far - near;
  return foot;
}

bool Standing::hovers(const Foot& foot) const {
  if (foot.lowest < options_.hover) return false;
  const Vector3d at(foot.middle.x(), foot.middle.y(), foot.lowest / 2);
  const Vector3d down = (at - eye_).normalized();
  const double level = down.head<2>().norm();  // 1: one looks along the table
  // In front of an upright face there is nothing of the thing: its own points are off by so much.
  const double inwards = (0.015 + options_.errors * depth_error((table_.pose * at).z())) * level;
  // Of a ball one sees the near half, and of its far half the less the lower one looks: it touches the table behind the
  // middle of that.
  const double share = 1 / (1 + std::max(0.0, -down.z() - 0.3));
  if (is_open(foot, std::max(inwards, (share - 0.5) * foot.depth))) return true;
  // Where an arm leads away the middle of all that is seen is no middle. But a ball's lowest part would be lower.
  constexpr double kSlack = 0.22;
  const double lowest_of_ball = (1 - level) / 2 + kSlack;  // of its height
  return foot.lowest > lowest_of_ball * foot.highest && is_open(foot, inwards - foot.depth / 2);
}

// Whether one looks through below it, so far behind its middle.
bool Standing::is_open(const Foot& foot, double along) const {
  constexpr double kStep = 0.008;  // metres
  const Vector2d across(-foot.away.y(), foot.away.x());
  std::size_t open = 0, closed = 0;
  for (int i = -1; i <= 1; ++i) {
    for (int j = -1; j <= 1; ++j) {
      const Vector2d column = foot.middle + foot.away * (along + i * kStep) + across * (j * kStep);
      const View view = view_through(column, foot.lowest - 0.01);
      if (view == View::kOpen) ++open;
      if (view == View::kClosed) ++closed;
    }
  }
  return open >= 3 && open > closed;
}

// Of the air between the table and a height: open if the table or something farther away is measured through it anywhere.
Standing::View Standing::view_through(const Vector2d& column, double height) const {
  constexpr int kSteps = 5;
  bool is_measured = false;
  for (int step = 0; step <= kSteps; ++step) {
    const Vector3d in_camera = table_.pose * Vector3d(column.x(), column.y(), std::max(0.0, height) * step / kSteps);
    if (in_camera.z() < 0.1) continue;
    const Vector2d on = calibration_.pixel(in_camera);
    const cv::Point pixel(static_cast<int>(std::lround(on.x())), static_cast<int>(std::lround(on.y())));
    if (!pixel.inside({{0, 0}, points_.size()}) || points_(pixel)[2] < -5) continue;  // a gap
    is_measured = true;
    const double tolerance = 0.005 + 2 * depth_error(in_camera.z());
    const double beyond = range(points_(pixel)) - in_camera.z();
    if (step == 0 ? beyond > -tolerance : beyond > tolerance + 0.01) return View::kOpen;
  }
  return is_measured ? View::kClosed : View::kUnknown;
}

bool Standing::hangs_over(const std::vector<cv::Point>& pixels, const Foot& foot) {
  if (!table_.has(foot.middle.x(), foot.middle.y())) return false;
  if (beyond_.empty()) cv::distanceTransform(table_.raster == 0, beyond_, cv::DIST_L2, cv::DIST_MASK_PRECISE);
  std::size_t far = 0;
  for (const cv::Point& p : pixels) {
    const cv::Vec3f& at = points_(p);
    const Vector2d cell = (Vector2d(at[0], at[1]) - table_.raster_origin) / table_.cell;
    // The raster goes some centimetres beyond the outline.
    const int column = std::clamp(static_cast<int>(cell.x()), 0, table_.raster.cols - 1),
              row = std::clamp(static_cast<int>(cell.y()), 0, table_.raster.rows - 1);
    const double off = std::hypot(cell.x() - column, cell.y() - row) + static_cast<double>(beyond_(row, column));
    if (off * table_.cell > options_.overhang + depth_error(range(at))) ++far;
  }
  return 50 * far < pixels.size();
}

}  // namespace sherlog::rgbd
