#include "rgbd/objects/shape.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace sherlog::rgbd {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3f;
constexpr double kPi = std::numbers::pi;
constexpr std::size_t kLeastOutline = 5;  // points

// Value below which that share lies. Requires values.
double quantile(std::vector<double> values, double share) {
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

template <class Get>
double quantile_of(const std::vector<Vector3f>& points, double share, Get get) {
  std::vector<double> values(points.size());
  std::ranges::transform(points, values.begin(), get);
  return quantile(std::move(values), share);
}

// Middle of the extent, which half-seen sides do not pull as they pull the mean.
Vector2d middle_of(const std::vector<Vector3f>& points) {
  Vector2d middle;
  for (int axis = 0; axis < 2; ++axis) {
    const auto get = [axis](const Vector3f& p) { return static_cast<double>(p[axis]); };
    middle[axis] = (quantile_of(points, 0.01, get) + quantile_of(points, 0.99, get)) / 2;
  }
  return middle;
}

double cut(double x) { return std::clamp(x, 0.0, 1.0); }

}  // namespace

std::vector<Vector2d> outline_of(const std::vector<Vector3f>& points) {
  constexpr std::size_t kSectors = 72;
  std::vector<Vector2d> outline;
  if (points.size() < 20) return outline;
  const Vector2d middle = middle_of(points);
  std::array<std::vector<std::pair<double, Vector2d>>, kSectors> sectors;
  for (const Vector3f& p : points) {
    const Vector2d from = Vector2d(p.x(), p.y()) - middle;
    const double turn = (std::atan2(from.y(), from.x()) + kPi) / (2 * kPi) * kSectors;
    sectors[std::min(kSectors - 1, static_cast<std::size_t>(turn))].emplace_back(from.norm(), Vector2d(p.x(), p.y()));
  }
  for (auto& sector : sectors) {
    if (sector.size() < 2) continue;
    // Not the very last one: an outlier is always the outermost.
    const auto at = sector.begin() + static_cast<std::ptrdiff_t>((sector.size() - 1) * 97 / 100);
    std::nth_element(sector.begin(), at, sector.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
    outline.push_back(at->second);
  }
  return outline;
}

CircleFit fit_circle(const std::vector<Vector2d>& outline, double tolerance) {
  CircleFit fit;
  if (outline.size() < kLeastOutline) return fit;
  // |p|^2 = 2 c.p + k, weighted anew by how far each is off (Cauchy's weights).
  std::vector<double> weights(outline.size(), 1.0);
  for (int round = 0; round < 12; ++round) {
    Eigen::Matrix3d products = Eigen::Matrix3d::Zero();
    Eigen::Vector3d right = Eigen::Vector3d::Zero();
    for (std::size_t i = 0; i < outline.size(); ++i) {
      const Eigen::Vector3d row(2 * outline[i].x(), 2 * outline[i].y(), 1);
      products += weights[i] * row * row.transpose();
      right += weights[i] * outline[i].squaredNorm() * row;
    }
    const Eigen::Vector3d solution = products.ldlt().solve(right);
    fit.centre = solution.head<2>();
    const double squared = solution.z() + fit.centre.squaredNorm();
    if (!(squared > 0) || !solution.allFinite()) return {};
    fit.radius = std::sqrt(squared);
    for (std::size_t i = 0; i < outline.size(); ++i) {
      const double r = ((outline[i] - fit.centre).norm() - fit.radius) / tolerance;
      weights[i] = 1 / (1 + r * r);
    }
  }
  const auto near = std::ranges::count_if(
      outline, [&](const Vector2d& p) { return std::abs((p - fit.centre).norm() - fit.radius) < tolerance; });
  fit.inliers = static_cast<double>(near) / static_cast<double>(outline.size());
  return fit;
}

RectangleFit fit_rectangle(const std::vector<Vector2d>& outline, double tolerance) {
  RectangleFit best;
  if (outline.size() < kLeastOutline) return best;
  double least = std::numeric_limits<double>::infinity();
  std::vector<double> u(outline.size()), v(outline.size());
  for (int degree = 0; degree < 90; ++degree) {
    const double heading = degree * kPi / 180;
    const Vector2d x(std::cos(heading), std::sin(heading)), y(-x.y(), x.x());
    for (std::size_t i = 0; i < outline.size(); ++i) u[i] = outline[i].dot(x), v[i] = outline[i].dot(y);
    const double left = quantile(u, 0.04), right = quantile(u, 0.96), low = quantile(v, 0.04), high = quantile(v, 0.96);
    double cost = 0;
    std::size_t near = 0;
    for (std::size_t i = 0; i < outline.size(); ++i) {
      const double off =
          std::min({std::abs(u[i] - left), std::abs(u[i] - right), std::abs(v[i] - low), std::abs(v[i] - high)});
      cost += std::min(1.0, off * off / (tolerance * tolerance));
      if (off < tolerance) ++near;
    }
    // Of equally good ones the smallest.
    cost += 1e-3 * (right - left) * (high - low) / (tolerance * tolerance);
    if (cost >= least) continue;
    least = cost;
    best.centre = x * ((left + right) / 2) + y * ((low + high) / 2);
    best.size = {right - left, high - low};
    best.heading = heading;
    best.inliers = static_cast<double>(near) / static_cast<double>(outline.size());
  }
  if (best.size.x() < best.size.y()) {  // the longer edge first
    std::swap(best.size.x(), best.size.y());
    best.heading -= kPi / 2;
  }
  return best;
}

namespace {

// Of a round footprint: whether the wall is upright or the top closed, in 0 ... 1.
double cylinder_likeness(const std::vector<Vector3f>& points, const CircleFit& circle, double height) {
  std::size_t inner = 0, on_top = 0;
  std::vector<double> low_radii;
  for (const Vector3f& p : points) {
    const double radius = (Vector2d(p.x(), p.y()) - circle.centre).norm();
    if (radius < 0.6 * circle.radius) {
      ++inner;
      if (p.z() > height - std::max(0.012, 0.12 * height)) ++on_top;
    }
    if (p.z() > 0.15 * height && p.z() < 0.45 * height) low_radii.push_back(radius);
  }
  const double closed = inner < 10 ? 0 : static_cast<double>(on_top) / static_cast<double>(inner);
  // The outer wall near the foot; what is inside of an open thing has smaller radii, so the larger ones count.
  const double upright = low_radii.size() < 10 ? 0 : cut((quantile(low_radii, 0.8) / circle.radius - 0.75) / 0.2);
  return std::max(closed, closed > 0.2 ? upright : 0.6 * upright);
}

// A footprint of four sides may be a cylinder's that lies along the longer ones: whether the points between its ends are near one
// rather than near a box's top and sides. Share of these points, 0 where they are a box's.
double lying_likeness(const std::vector<Vector3f>& points, const Box& box, double tolerance) {
  constexpr std::size_t kFewest = 30;
  const double height = box.size.z(), width = box.size.y(), radius = height / 2;
  if (std::abs(width - height) > 0.3 * height + 2 * tolerance) return 0;
  const Vector2d x(std::cos(box.heading), std::sin(box.heading)), y(-x.y(), x.x());
  std::vector<Vector2d> section;  // across, and up
  for (const Vector3f& p : points) {
    const Vector2d at = Vector2d(p.x(), p.y()) - box.centre.head<2>();
    if (std::abs(at.dot(x)) < 0.4 * box.size.x()) section.emplace_back(at.dot(y), p.z());
  }
  if (section.size() < kFewest) return 0;
  const auto share = [&](auto is_near) {
    return static_cast<double>(std::ranges::count_if(section, is_near)) / static_cast<double>(section.size());
  };
  const double boxy = share([&](const Vector2d& p) {
    return std::abs(p.y() - height) < tolerance || std::abs(std::abs(p.x()) - width / 2) < tolerance;
  });
  double round = 0;
  for (int step = -8; step <= 8; ++step) {  // one side is hidden, so the middle is not sure
    const Vector2d axis(step * radius / 25, radius);
    round = std::max(round, share([&](const Vector2d& p) { return std::abs((p - axis).norm() - radius) < tolerance; }));
  }
  return round > 0.75 && round > boxy + 0.1 ? round : 0;
}

struct BallFit {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  double radius = 0;
  double inliers = 0;  // share of the points; 0: it is no ball that lies on the table
};

// |p|^2 = 2 c.p + k, weighted anew by how far each is off (Cauchy's weights).
BallFit fit_ball(const std::vector<Vector3f>& points, double height, double tolerance) {
  constexpr std::size_t kEnough = 2000;
  const std::size_t step = points.size() / kEnough + 1;
  std::vector<Eigen::Vector3d> some;
  for (std::size_t i = 0; i < points.size(); i += step) some.push_back(points[i].cast<double>());
  std::vector<double> weights(some.size(), 1.0);
  BallFit fit;
  for (int round = 0; round < 12; ++round) {
    Eigen::Matrix4d products = Eigen::Matrix4d::Zero();
    Eigen::Vector4d right = Eigen::Vector4d::Zero();
    for (std::size_t i = 0; i < some.size(); ++i) {
      const Eigen::Vector4d row(2 * some[i].x(), 2 * some[i].y(), 2 * some[i].z(), 1);
      products += weights[i] * row * row.transpose();
      right += weights[i] * some[i].squaredNorm() * row;
    }
    const Eigen::Vector4d solution = products.ldlt().solve(right);
    fit.centre = solution.head<3>();
    const double squared = solution.w() + fit.centre.squaredNorm();
    if (!solution.allFinite() || !(squared > 0)) return {};
    fit.radius = std::sqrt(squared);
    for (std::size_t i = 0; i < some.size(); ++i) {
      const double r = ((some[i] - fit.centre).norm() - fit.radius) / tolerance;
      weights[i] = 1 / (1 + r * r);
    }
  }
  // It lies on the table, and its top is what is highest: a bowl's inside is on a sphere, too.
  const double slack = 0.2 * fit.radius + tolerance;
  if (std::abs(fit.centre.z() - fit.radius) > slack || std::abs(2 * fit.radius - height) > slack) return {};
  const auto near = std::ranges::count_if(
      some, [&](const Eigen::Vector3d& p) { return std::abs((p - fit.centre).norm() - fit.radius) < tolerance; });
  fit.inliers = static_cast<double>(near) / static_cast<double>(some.size());
  return fit;
}

}  // namespace

ShapeFit fit_shape(const Hypothesis& thing, double error) {
  ShapeFit fit;
  const auto& points = thing.points;
  if (points.size() < 20) return fit;
  const double tolerance = std::max(0.004, 2 * error);
  const std::vector<Vector2d> outline = outline_of(points);
  if (outline.size() < kLeastOutline) return fit;
  const CircleFit circle = fit_circle(outline, tolerance);
  const RectangleFit rectangle = fit_rectangle(outline, tolerance);
  const double height = std::max(0.002, quantile_of(points, 0.985, [](const Vector3f& p) { return p.z(); }));
  constexpr double kBall = 0.8;
  if (const BallFit ball = thing.from_colour ? BallFit{} : fit_ball(points, height, tolerance); ball.inliers > kBall) {
    fit.shape = "round";
    fit.confidence = ball.inliers;
    fit.box_share = rectangle.inliers, fit.circle_share = circle.inliers;
    fit.box.centre = {ball.centre.x(), ball.centre.y(), height / 2};
    fit.box.size = {2 * ball.radius, 2 * ball.radius, height};
    return fit;
  }
  // Four lines explain more than one circle does.
  const bool is_circle = circle.inliers > 0.3 && circle.inliers > rectangle.inliers - 0.05 && circle.radius < 0.5 &&
                         rectangle.size.y() > 0.7 * rectangle.size.x();
  fit.box_share = rectangle.inliers, fit.circle_share = circle.inliers;
  Vector2d centre = rectangle.centre, size = rectangle.size;
  if (is_circle) {
    centre = circle.centre, size = {2 * circle.radius, 2 * circle.radius};
  } else {
    fit.box.heading = rectangle.heading;
  }
  fit.box.centre = {centre.x(), centre.y(), height / 2};
  fit.box.size = {size.x(), size.y(), height};

  const double longest = std::max(size.x(), size.y());
  const double margin = std::abs(circle.inliers - rectangle.inliers);
  if (thing.from_colour || height <= 0.25 * longest) {
    const bool is_low = height <= std::min(0.25 * longest, 0.06);
    if (is_low || thing.from_colour) {
      fit.shape = "flat";
      fit.confidence = cut(0.5 + 2 * (0.25 - height / longest));
      return fit;
    }
  }
  const double lying = is_circle ? 0 : lying_likeness(points, fit.box, tolerance);
  if (lying > 0) {
    fit.shape = "cylinder";
    fit.confidence = cut(0.5 * rectangle.inliers + 0.5 * lying);
    return fit;
  }
  if (!is_circle) {
    fit.shape = "box";
    fit.confidence = cut(0.5 * rectangle.inliers + 0.3 + margin);
    return fit;
  }
  const double cylinder = cylinder_likeness(points, circle, height);
  fit.shape = cylinder >= 0.5 ? "cylinder" : "round";
  fit.confidence = cut(0.5 * circle.inliers + 0.5 * std::max(cylinder, 1 - cylinder));
  return fit;
}

std::vector<double> shape_features(const Hypothesis& thing) {
  constexpr std::size_t kBins = 15;
  constexpr double kLongest = 0.3;
  std::vector<double> counts(3 * kBins, 0.0);
  const auto& points = thing.points;
  if (points.empty()) return counts;
  const Vector2d middle = middle_of(points);
  const auto count = [&](std::size_t part, double value) {
    const double bin = std::clamp(value / kLongest * kBins, 0.0, kBins - 1.0);
    counts[part * kBins + static_cast<std::size_t>(bin)] += 1;
  };
  for (std::size_t i = 0; i < points.size(); ++i) {
    count(0, (Vector2d(points[i].x(), points[i].y()) - middle).norm());
    count(1, points[i].z());
    count(2, static_cast<double>((points[i] - points[(i * 7919 + points.size() / 2) % points.size()]).norm()));
  }
  for (double& value : counts) value = std::round(1000 * value / static_cast<double>(points.size()));
  return counts;
}

SizeName size_name(double volume) {
  constexpr double kSmall = 0.0012, kLarge = 0.004;
  // In factors: at twice or half of a limit one is sure.
  const auto beyond = [](double value, double limit) { return cut(0.5 + std::abs(std::log2(value / limit)) / 2); };
  volume = std::max(volume, 1e-9);
  if (volume < kSmall) return {"small", beyond(volume, kSmall)};
  if (volume >= kLarge) return {"large", beyond(volume, kLarge)};
  return {"medium", std::min(beyond(volume, kSmall), beyond(volume, kLarge))};
}

}  // namespace sherlog::rgbd
