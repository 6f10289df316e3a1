#include "rgbd/objects/table_top.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <random>

#include "rgbd/depth/disparity.h"

namespace sherlog::rgbd {
namespace {

using Eigen::Vector3d;

struct Plane {
  Vector3d normal = Vector3d::UnitZ();  // away from what lies below
  double offset = 0;                    // height = normal . p + offset
  double height(const Vector3d& p) const { return normal.dot(p) + offset; }
};

struct Sample {
  Vector3d point;
  double tolerance;
};

std::vector<Sample> sample(const Cloud& cloud, double agreement) {
  const int step = std::max(1, static_cast<int>(std::sqrt(static_cast<double>(cloud.total()) / 20'000)));
  std::vector<Sample> samples;
  for (int y = step / 2; y < cloud.rows; y += step) {
    for (int x = step / 2; x < cloud.cols; x += step) {
      const cv::Vec3f& p = cloud(y, x);
      if (p[2] > 0) samples.push_back({{p[0], p[1], p[2]}, agreement * depth_error(p[2])});
    }
  }
  return samples;
}

// Towards the camera, so up where it looks down on it.
Plane oriented(const Vector3d& normal, const Vector3d& point) {
  Plane plane{normal, -normal.dot(point)};
  if (plane.offset < 0) plane = {-normal, -plane.offset};
  return plane;
}

std::size_t votes(const Plane& plane, const std::vector<Sample>& samples) {
  return static_cast<std::size_t>(
      std::ranges::count_if(samples, [&](const Sample& s) { return std::abs(plane.height(s.point)) < s.tolerance; }));
}

// Weighted least squares with Tukey's weights of the residuals in tolerances.
Plane refined(Plane plane, const std::vector<Sample>& samples) {
  for (int round = 0; round < 8; ++round) {
    double sum = 0;
    Vector3d mean = Vector3d::Zero();
    Eigen::Matrix3d products = Eigen::Matrix3d::Zero();
    for (const Sample& s : samples) {
      const double r = plane.height(s.point) / s.tolerance;
      if (std::abs(r) >= 1) continue;
      const double weight = (1 - r * r) * (1 - r * r) / (s.tolerance * s.tolerance);
      sum += weight;
      mean += weight * s.point;
      products += weight * s.point * s.point.transpose();
    }
    if (!(sum > 0)) return plane;
    mean /= sum;
    const Eigen::Matrix3d covariance = products / sum - mean * mean.transpose();
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(covariance);
    plane = oriented(solver.eigenvectors().col(0), mean);
  }
  return plane;
}

std::optional<Plane> best_plane(const std::vector<Sample>& samples, const std::optional<Vector3d>& up,
                                const TableOptions& options) {
  if (samples.size() < 3) return std::nullopt;
  std::mt19937_64 random(5);
  std::optional<Plane> best;
  std::size_t most = 0;
  for (std::size_t trial = 0; trial < options.trials; ++trial) {
    const Vector3d& a = samples[random() % samples.size()].point;
    const Vector3d& b = samples[random() % samples.size()].point;
    const Vector3d& c = samples[random() % samples.size()].point;
    const Vector3d cross = (b - a).cross(c - a);
    if (cross.norm() < 1e-4) continue;
    const Plane plane = oriented(cross.normalized(), a);
    if (up && plane.normal.dot(*up) < std::cos(options.most_tilt)) continue;
    if (!up && plane.normal.y() > -0.2) continue;  // a camera that is held upright looks down on tables, not on walls
    const std::size_t count = votes(plane, samples);
    if (count > most) most = count, best = plane;
  }
  return best ? std::optional(refined(*best, samples)) : best;
}

// The largest connected piece of the pixels on the plane.
MaskImage surface_of(const Cloud& cloud, const Plane& plane, double agreement) {
  MaskImage on_plane(cloud.size(), std::uint8_t{0});
  for (int y = 0; y < cloud.rows; ++y) {
    for (int x = 0; x < cloud.cols; ++x) {
      const cv::Vec3f& p = cloud(y, x);
      if (p[2] <= 0) continue;
      if (std::abs(plane.height({p[0], p[1], p[2]})) < agreement * depth_error(p[2])) on_plane(y, x) = 255;
    }
  }
  cv::Mat1b open;
  cv::morphologyEx(on_plane, open, cv::MORPH_OPEN, cv::Mat::ones(3, 3, CV_8U));
  cv::Mat1i labels;
  cv::Mat statistics, centres;
  const int count = cv::connectedComponentsWithStats(open, labels, statistics, centres, 8, CV_32S);
  int largest = 0, area = 0;
  for (int i = 1; i < count; ++i) {
    if (statistics.at<int>(i, cv::CC_STAT_AREA) > area) largest = i, area = statistics.at<int>(i, cv::CC_STAT_AREA);
  }
  MaskImage result(cloud.size(), std::uint8_t{0});
  if (largest > 0) result.setTo(255, labels == largest);
  return result;
}

Eigen::Isometry3d frame_on(const Plane& plane, const Vector3d& origin, const Vector3d& ahead) {
  Vector3d x = ahead - plane.normal * plane.normal.dot(ahead);
  if (x.norm() < 1e-3) x = plane.normal.unitOrthogonal();
  x.normalize();
  Eigen::Isometry3d frame = Eigen::Isometry3d::Identity();
  frame.linear().col(0) = x;
  frame.linear().col(1) = plane.normal.cross(x);
  frame.linear().col(2) = plane.normal;
  frame.translation() = origin - plane.normal * plane.height(origin);
  return frame;
}

void draw_outline(Table& table, const std::vector<cv::Point2f>& hull, double cell) {
  Eigen::Vector2d low(hull[0].x, hull[0].y), high = low;
  for (const cv::Point2f& p : hull) {
    low = low.cwiseMin(Eigen::Vector2d(p.x, p.y));
    high = high.cwiseMax(Eigen::Vector2d(p.x, p.y));
  }
  const double margin = 4 * cell;
  table.cell = cell;
  table.raster_origin = low - Eigen::Vector2d(margin, margin);
  const Eigen::Vector2d size = (high - low + Eigen::Vector2d(2 * margin, 2 * margin)) / cell;
  table.raster = cv::Mat1b::zeros(static_cast<int>(size.y()) + 1, static_cast<int>(size.x()) + 1);
  std::vector<cv::Point> polygon;
  for (const cv::Point2f& p : hull) {
    table.outline.emplace_back(p.x, p.y);
    polygon.emplace_back(static_cast<int>(std::lround((p.x - table.raster_origin.x()) / cell)),
                         static_cast<int>(std::lround((p.y - table.raster_origin.y()) / cell)));
  }
  cv::fillConvexPoly(table.raster, polygon, 255);
}

}  // namespace

Cloud cloud_of(const DepthImage& depth, const Calibration& calibration) {
  Cloud cloud(depth.size());
  for (int y = 0; y < depth.rows; ++y) {
    for (int x = 0; x < depth.cols; ++x) {
      const double metres = depth(y, x) / 1000.0;
      const Vector3d p = calibration.point(x, y, metres);
      cloud(y, x) = {static_cast<float>(p.x()), static_cast<float>(p.y()), static_cast<float>(p.z())};
    }
  }
  return cloud;
}

double depth_error(double metres) { return disparity_step(std::max(metres, 0.3) * 1000) / 2000; }

bool Table::has(double x, double y) const {
  const auto column = static_cast<int>((x - raster_origin.x()) / cell),
             row = static_cast<int>((y - raster_origin.y()) / cell);
  return column >= 0 && row >= 0 && column < raster.cols && row < raster.rows && raster(row, column) != 0;
}

std::optional<Table> find_table(const Cloud& cloud, const std::optional<Eigen::Isometry3d>& camera,
                                const TableOptions& options, std::string& problem) {
  const std::vector<Sample> samples = sample(cloud, options.agreement);
  std::optional<Vector3d> up;
  if (camera) up = camera->linear().transpose() * Vector3d::UnitZ();
  const std::optional<Plane> plane = best_plane(samples, up, options);
  if (!plane) return problem = "there is no table top: too few depths, or no level plane", std::nullopt;

  Table table;
  table.surface = surface_of(cloud, *plane, options.agreement);
  const Vector3d ahead = camera ? Vector3d(camera->linear().transpose() * Vector3d::UnitX()) : Vector3d::UnitX();
  Eigen::Isometry3d frame = frame_on(*plane, -plane->normal * plane->offset, ahead);
  std::vector<cv::Point2f> points;
  for (int y = 0; y < cloud.rows; ++y) {
    for (int x = 0; x < cloud.cols; ++x) {
      if (table.surface(y, x) == 0) continue;
      const cv::Vec3f& p = cloud(y, x);
      const Vector3d on = frame.inverse(Eigen::Isometry) * Vector3d(p[0], p[1], p[2]);
      points.emplace_back(static_cast<float>(on.x()), static_cast<float>(on.y()));
    }
  }
  std::vector<cv::Point2f> hull;
  if (points.size() >= 3) cv::convexHull(points, hull);
  table.area = hull.size() < 3 ? 0 : cv::contourArea(hull);
  if (table.area < options.least_area) {
    return problem = "there is no table top: the largest level plane is too small", std::nullopt;
  }
  Vector3d middle = Vector3d::Zero();
  for (const cv::Point2f& p : hull) middle += Vector3d(p.x, p.y, 0) / static_cast<double>(hull.size());
  frame.translation() = frame * middle;
  for (cv::Point2f& p : hull) p -= cv::Point2f(static_cast<float>(middle.x()), static_cast<float>(middle.y()));
  table.pose = frame;
  table.has_world = camera.has_value();
  table.in_world = camera ? *camera * frame : frame;
  draw_outline(table, hull, options.cell);
  return table;
}

cv::Mat3f above_table(const Cloud& cloud, const Table& table) {
  const Eigen::Isometry3f to_table = table.pose.inverse(Eigen::Isometry).cast<float>();
  cv::Mat3f result(cloud.size());
  for (int y = 0; y < cloud.rows; ++y) {
    for (int x = 0; x < cloud.cols; ++x) {
      const cv::Vec3f& p = cloud(y, x);
      const Eigen::Vector3f q = to_table * Eigen::Vector3f(p[0], p[1], p[2]);
      result(y, x) = p[2] > 0 ? cv::Vec3f(q.x(), q.y(), q.z()) : cv::Vec3f(0, 0, -10);
    }
  }
  return result;
}

}  // namespace sherlog::rgbd
