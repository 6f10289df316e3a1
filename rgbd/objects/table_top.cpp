#include "rgbd/objects/table_top.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <opencv2/imgproc.hpp>
#include <random>

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
  cv::Point cell;
  double tolerance;
};

// A grid of the picture's measurements, row by row.
std::vector<Sample> sample(const Cloud& cloud, double agreement) {
  const int step = std::max(1, static_cast<int>(std::sqrt(static_cast<double>(cloud.total()) / 20'000)));
  std::vector<Sample> samples;
  for (int y = step / 2; y < cloud.rows; y += step) {
    for (int x = step / 2; x < cloud.cols; x += step) {
      const cv::Vec3f& p = cloud(y, x);
      if (p[2] > 0) samples.push_back({{p[0], p[1], p[2]}, {x / step, y / step}, agreement * depth_error(p[2])});
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

// A plane for loops over many points.
struct QuickPlane {
  explicit QuickPlane(const Plane& plane)
      : x(static_cast<float>(plane.normal.x())),
        y(static_cast<float>(plane.normal.y())),
        z(static_cast<float>(plane.normal.z())),
        offset(static_cast<float>(plane.offset)) {}
  float height(float px, float py, float pz) const { return x * px + y * py + z * pz + offset; }
  float x, y, z, offset;
};

// Every so manieth sample; by coordinate, so that counting is quick.
class Voters {
 public:
  explicit Voters(const std::vector<Sample>& samples) {
    constexpr std::size_t kVoters = 4000;
    const std::size_t step = std::max<std::size_t>(1, samples.size() / kVoters);
    for (std::size_t i = 0; i < samples.size(); i += step) {
      x_.push_back(static_cast<float>(samples[i].point.x()));
      y_.push_back(static_cast<float>(samples[i].point.y()));
      z_.push_back(static_cast<float>(samples[i].point.z()));
      tolerance_.push_back(static_cast<float>(samples[i].tolerance));
    }
  }
  // Those within a share of their tolerance.
  int votes(const Plane& plane, float share = 1) const {
    const QuickPlane quick(plane);
    int count = 0;
    for (std::size_t i = 0; i < x_.size(); ++i) {
      count += std::abs(quick.height(x_[i], y_[i], z_[i])) < share * tolerance_[i] ? 1 : 0;
    }
    return count;
  }

 private:
  std::vector<float> x_, y_, z_, tolerance_;
};

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

// Whether the point may lie on a table.
bool is_table_height(const Vector3d& point, const Eigen::Isometry3d& camera, const TableOptions& options) {
  const double height = (camera * point).z();
  if (options.heights.empty()) return height > options.least_height;
  return std::ranges::any_of(options.heights, [&](double h) { return std::abs(h - height) < options.height_error; });
}

// Three samples of all of them, or of one place.
class Triples {
 public:
  explicit Triples(const std::vector<Sample>& samples) : samples_(samples) {
    cv::Point last;
    for (const Sample& s : samples) last = {std::max(last.x, s.cell.x), std::max(last.y, s.cell.y)};
    number_ = cv::Mat1i(last.y + 1, last.x + 1, -1);
    for (std::size_t i = 0; i < samples.size(); ++i) number_(samples[i].cell) = static_cast<int>(i);
  }
  std::optional<std::array<Vector3d, 3>> draw(bool of_one_place) {
    const Sample& a = samples_[random_() % samples_.size()];
    if (!of_one_place) return {{a.point, any(), any()}};
    const Sample *b = near(a), *c = near(a);
    if (b == nullptr || c == nullptr) return std::nullopt;
    return {{a.point, b->point, c->point}};
  }

 private:
  const Vector3d& any() { return samples_[random_() % samples_.size()].point; }
  const Sample* near(const Sample& a) {
    constexpr int kReach = 12;  // cells
    const auto offset = [&] { return static_cast<int>(random_() % (2 * kReach + 1)) - kReach; };
    const int dx = offset(), dy = offset();
    const cv::Point cell = a.cell + cv::Point(dx, dy);
    if (!cell.inside({{0, 0}, number_.size()}) || number_(cell) < 0) return nullptr;
    return &samples_[static_cast<std::size_t>(number_(cell))];
  }

  const std::vector<Sample>& samples_;
  cv::Mat1i number_;  // of the sample, by cell
  std::mt19937_64 random_{5};
};

// The best one parallel to another, below the camera. Far away there are walls in a plane's tolerance, which would tilt it.
std::optional<Plane> best_parallel(const Vector3d& normal, const std::vector<Sample>& samples,
                                   const TableOptions& options) {
  if (samples.empty()) return std::nullopt;
  const Voters voters(samples);
  std::mt19937_64 random(9);
  std::optional<Plane> best;
  int most = 0;
  for (std::size_t trial = 0; trial < options.trials; ++trial) {
    const Plane plane{normal, -normal.dot(samples[random() % samples.size()].point)};
    const int count = plane.offset > 0 ? voters.votes(plane) : 0;
    if (count > most) most = count, best = plane;
  }
  for (int round = 0; best && round < 4; ++round) {
    double sum = 0, weights = 0;
    for (const Sample& s : samples) {
      const double r = best->height(s.point) / s.tolerance;
      if (std::abs(r) >= 1) continue;
      const double weight = (1 - r * r) * (1 - r * r) / (s.tolerance * s.tolerance);
      sum += weight * normal.dot(s.point), weights += weight;
    }
    if (weights > 0) best->offset = -sum / weights;
  }
  return best;
}

std::optional<Plane> best_plane(const std::vector<Sample>& samples, const std::optional<Eigen::Isometry3d>& camera,
                                const TableOptions& options) {
  if (samples.size() < 3) return std::nullopt;
  std::optional<Vector3d> up;
  if (camera) up = camera->linear().transpose() * Vector3d::UnitZ();
  const auto is_steep = [&](const Plane& p) { return up && p.normal.dot(*up) < std::cos(options.most_tilt); };
  const Voters voters(samples);
  Triples triples(samples);
  std::optional<Plane> best;
  int most = 0;
  for (std::size_t trial = 0; trial < options.trials; ++trial) {
    const auto triple = triples.draw(trial % 2 != 0);
    if (!triple) continue;
    const auto& [a, b, c] = *triple;
    const bool is_level = up && trial % 4 == 0;  // as nearly all are: two of different heights are no slope
    const Vector3d cross = (b - a).cross(c - a);
    if (!is_level && cross.norm() < 1e-4) continue;
    const Plane plane = oriented(is_level ? *up : cross.normalized(), a);
    if (is_steep(plane)) continue;
    if (!up && plane.normal.y() > -0.2) continue;  // a camera that is held upright looks down on tables, not on walls
    const int count = voters.votes(plane);
    if (count > most) most = count, best = plane;
  }
  if (!best) return std::nullopt;
  const Plane fitted = refined(*best, samples);
  const Plane tilted = is_steep(fitted) ? *best : fitted;
  const std::optional<Plane> level = up ? best_parallel(*up, samples, options) : std::nullopt;
  // A slope lies near to two tables of nearly one height: nearer than an error of depth it is to neither.
  const float close = static_cast<float>(1 / options.agreement);
  return level && voters.votes(*level, close) >= voters.votes(tilted, close) ? level : tilted;
}

// The connected pieces of the pixels on the plane, by number; 0: none. The largest ones first, at most kMostPieces.
cv::Mat1i pieces_on(const Cloud& cloud, const cv::Mat1f& tolerance, const Plane& plane, int& count) {
  constexpr int kMostPieces = 8;
  MaskImage on_plane(cloud.size());
  const QuickPlane quick(plane);
  for (int y = 0; y < cloud.rows; ++y) {
    const cv::Vec3f* p = cloud[y];
    const float* t = tolerance[y];
    std::uint8_t* out = on_plane[y];
    for (int x = 0; x < cloud.cols; ++x) {
      out[x] = std::abs(quick.height(p[x][0], p[x][1], p[x][2])) < t[x] ? std::uint8_t{255} : std::uint8_t{0};
    }
  }
  cv::Mat1b open;
  cv::morphologyEx(on_plane, open, cv::MORPH_OPEN, cv::Mat::ones(3, 3, CV_8U));
  cv::Mat1i labels;
  cv::Mat statistics, centres;
  const int all = cv::connectedComponentsWithStats(open, labels, statistics, centres, 8, CV_32S);
  std::vector<int> order;
  for (int i = 1; i < all; ++i) order.push_back(i);
  std::ranges::stable_sort(order, std::greater<>{}, [&](int i) { return statistics.at<int>(i, cv::CC_STAT_AREA); });
  count = std::min(kMostPieces, static_cast<int>(order.size()));
  std::vector<int> number(static_cast<std::size_t>(all), 0);
  for (int i = 0; i < count; ++i) number[static_cast<std::size_t>(order[static_cast<std::size_t>(i)])] = i + 1;
  for (int& label : labels) label = number[static_cast<std::size_t>(label)];
  return labels;
}

// How far a point may be off a plane that it is on; 0: there is none.
cv::Mat1f tolerance_of(const Cloud& cloud, double agreement) {
  cv::Mat1f tolerance(cloud.size());
  for (int y = 0; y < cloud.rows; ++y) {
    for (int x = 0; x < cloud.cols; ++x) {
      const float z = cloud(y, x)[2];
      tolerance(y, x) = z > 0 ? static_cast<float>(agreement * depth_error(z)) : 0.0F;
    }
  }
  return tolerance;
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

constexpr double kHeightSlack = 0.01;  // metres

using Hull = std::vector<cv::Point2f>;

void draw_outlines(Table& table, const std::vector<Hull>& hulls, double cell) {
  Eigen::Vector2d low(hulls[0][0].x, hulls[0][0].y), high = low;
  for (const Hull& hull : hulls) {
    for (const cv::Point2f& p : hull) {
      low = low.cwiseMin(Eigen::Vector2d(p.x, p.y));
      high = high.cwiseMax(Eigen::Vector2d(p.x, p.y));
    }
  }
  const double margin = 4 * cell;
  table.cell = cell;
  table.raster_origin = low - Eigen::Vector2d(margin, margin);
  const Eigen::Vector2d size = (high - low + Eigen::Vector2d(2 * margin, 2 * margin)) / cell;
  table.raster = cv::Mat1b::zeros(static_cast<int>(size.y()) + 1, static_cast<int>(size.x()) + 1);
  for (const cv::Point2f& p : hulls[0]) table.outline.emplace_back(p.x, p.y);
  for (std::size_t i = hulls.size(); i-- > 0;) {  // the largest last: it wins where they overlap
    std::vector<cv::Point> polygon;
    for (const cv::Point2f& p : hulls[i]) {
      polygon.emplace_back(static_cast<int>(std::lround((p.x - table.raster_origin.x()) / cell)),
                           static_cast<int>(std::lround((p.y - table.raster_origin.y()) / cell)));
    }
    cv::fillConvexPoly(table.raster, polygon, static_cast<double>(i + 1));
  }
}

struct Piece {
  Hull points;            // in the frame's plane
  std::size_t close = 0;  // those that are off it by half of the tolerance at most

  // As a table's are. A wall that the plane cuts fills all of the tolerance, which far away is a hand's breadth.
  bool is_level() const { return 10 * close >= 7 * points.size(); }
};

std::vector<Piece> measured(const Cloud& cloud, const cv::Mat1f& tolerance, const cv::Mat1i& numbers, int count,
                            const Eigen::Isometry3d& frame) {
  std::vector<Piece> pieces(static_cast<std::size_t>(count));
  const Eigen::Isometry3d to_frame = frame.inverse(Eigen::Isometry);
  for (int y = 0; y < cloud.rows; ++y) {
    for (int x = 0; x < cloud.cols; ++x) {
      if (numbers(y, x) == 0) continue;
      Piece& piece = pieces[static_cast<std::size_t>(numbers(y, x) - 1)];
      const cv::Vec3f& p = cloud(y, x);
      const Vector3d on = to_frame * Vector3d(p[0], p[1], p[2]);
      piece.points.emplace_back(static_cast<float>(on.x()), static_cast<float>(on.y()));
      if (std::abs(on.z()) < 0.5 * static_cast<double>(tolerance(y, x))) ++piece.close;
    }
  }
  return pieces;
}

// Square metres of cells of 2 cm that have a point.
double covered_area(const Hull& points) {
  constexpr float kCell = 0.02F;
  cv::Point2f low = points[0], high = low;
  for (const cv::Point2f& p : points) {
    low = {std::min(low.x, p.x), std::min(low.y, p.y)};
    high = {std::max(high.x, p.x), std::max(high.y, p.y)};
  }
  const auto cell = [&](const cv::Point2f& p) {
    return cv::Point(static_cast<int>((p.x - low.x) / kCell), static_cast<int>((p.y - low.y) / kCell));
  };
  cv::Mat1b cells(cell(high).y + 1, cell(high).x + 1, std::uint8_t{0});
  for (const cv::Point2f& p : points) cells(cell(p)) = 1;
  return static_cast<double>(cv::countNonZero(cells)) * static_cast<double>(kCell * kCell);
}

// Those that may be corners of the hull: the others lie inside of the figure of eight extreme points.
Hull outer_points(const Hull& points) {
  static const std::array<cv::Point2f, 8> kDirections = {cv::Point2f(1, 0), {1, 1},   {0, 1},  {-1, 1},
                                                         {-1, 0},           {-1, -1}, {0, -1}, {1, -1}};
  std::array<cv::Point2f, 8> corners;
  for (std::size_t i = 0; i < kDirections.size(); ++i) {
    corners[i] = *std::ranges::max_element(points, {}, [&](const cv::Point2f& p) { return p.dot(kDirections[i]); });
  }
  Hull outer;
  for (const cv::Point2f& p : points) {
    bool is_inside = true;
    for (std::size_t i = 0; i < corners.size() && is_inside; ++i) {
      const cv::Point2f side = corners[(i + 1) % corners.size()] - corners[i];
      is_inside = side == cv::Point2f() || side.cross(p - corners[i]) > 0;
    }
    if (!is_inside) outer.push_back(p);
  }
  return outer.size() < 3 ? points : outer;
}

// Of a piece that may be a table top, else empty. Where a level plane cuts walls there are strips.
Hull hull_of(const Hull& points, double least_area) {
  constexpr float kLeastWidth = 0.15F;
  constexpr double kLeastShare = 0.2;  // of the hull that is seen
  Hull hull;
  if (points.size() < 3) return {};
  cv::convexHull(outer_points(points), hull);
  if (hull.size() < 3) return {};
  const double area = cv::contourArea(hull);
  const cv::Size2f sides = cv::minAreaRect(hull).size;
  if (area < least_area || std::min(sides.width, sides.height) < kLeastWidth) return {};
  return covered_area(points) < kLeastShare * area ? Hull() : hull;
}

// What is on the plane, as tables. Nothing: no piece is large enough, or the plane is too low after all.
std::optional<Table> table_on(const Plane& plane, const Cloud& cloud, const cv::Mat1f& tolerance,
                              const std::optional<Eigen::Isometry3d>& camera, const TableOptions& options,
                              double least_area) {
  Table table;
  const Vector3d ahead = camera ? Vector3d(camera->linear().transpose() * Vector3d::UnitX()) : Vector3d::UnitX();
  Eigen::Isometry3d frame = frame_on(plane, -plane.normal * plane.offset, ahead);
  int count = 0;
  const cv::Mat1i numbers = pieces_on(cloud, tolerance, plane, count);
  const std::vector<Piece> pieces = measured(cloud, tolerance, numbers, count, frame);
  table.surface = MaskImage(cloud.size(), std::uint8_t{0});
  std::vector<Hull> large;
  for (std::size_t i = 0; i < pieces.size(); ++i) {
    Hull hull = pieces[i].is_level() ? hull_of(pieces[i].points, least_area) : Hull();
    if (hull.empty()) continue;
    table.area += cv::contourArea(hull);
    table.surface.setTo(255, numbers == static_cast<int>(i + 1));
    large.push_back(std::move(hull));
  }
  if (large.empty()) return std::nullopt;
  Vector3d middle = Vector3d::Zero();
  for (const cv::Point2f& p : large[0]) middle += Vector3d(p.x, p.y, 0) / static_cast<double>(large[0].size());
  frame.translation() = frame * middle;
  // Points may be high enough where the plane they lie on is not: it is tilted a little.
  if (camera && !is_table_height(frame.translation() + kHeightSlack * plane.normal, *camera, options))
    return std::nullopt;
  const cv::Point2f origin(static_cast<float>(middle.x()), static_cast<float>(middle.y()));
  for (Hull& hull : large) {
    for (cv::Point2f& p : hull) p -= origin;
  }
  table.pose = frame;
  table.has_world = camera.has_value();
  table.in_world = camera ? *camera * frame : frame;
  draw_outlines(table, large, options.cell);
  return table;
}

// What stands on a table is no table, and what is as high as one belongs to it.
void drop_explained(std::vector<Sample>& samples, const Plane& plane, const std::optional<Table>& table,
                    const TableOptions& options) {
  constexpr double kSameHeight = 0.04, kRoomAbove = 0.5;
  const Eigen::Isometry3d to_table = table ? table->pose.inverse(Eigen::Isometry) : Eigen::Isometry3d::Identity();
  std::erase_if(samples, [&](const Sample& s) {
    const double height = plane.height(s.point);
    if (std::abs(height) < std::max(s.tolerance, table ? kSameHeight : 0.0)) return true;
    if (!table || !options.heights.empty() || height > kRoomAbove) return false;
    const Vector3d at = to_table * s.point;
    return table->has(at.x(), at.y());
  });
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

std::size_t Table::piece(double x, double y) const {
  const auto column = static_cast<int>((x - raster_origin.x()) / cell),
             row = static_cast<int>((y - raster_origin.y()) / cell);
  if (column < 0 || row < 0 || column >= raster.cols || row >= raster.rows) return 0;
  return raster(row, column);
}

std::vector<Table> find_tables(const Cloud& cloud, const std::optional<Eigen::Isometry3d>& camera,
                               const TableOptions& options, std::string& problem) {
  constexpr int kMostPlanes = 8;
  constexpr std::size_t kFewestSamples = 60;
  std::vector<Table> tables;
  std::vector<Sample> samples = sample(cloud, options.agreement);
  if (camera) std::erase_if(samples, [&](const Sample& s) { return !is_table_height(s.point, *camera, options); });
  const cv::Mat1f tolerance = tolerance_of(cloud, options.agreement);
  bool any_plane = false;
  for (int i = 0; i < kMostPlanes && tables.size() < options.most_heights; ++i) {
    if (i > 0 && samples.size() < kFewestSamples) break;
    const std::optional<Plane> plane = tables.empty() ? best_plane(samples, camera, options)
                                                      : best_parallel(tables[0].pose.linear().col(2), samples, options);
    if (!plane) break;
    any_plane = true;
    const bool is_further = !tables.empty() && options.heights.empty();
    auto table = table_on(*plane, cloud, tolerance, camera, options,
                          is_further ? options.least_further_area : options.least_area);
    drop_explained(samples, *plane, table, options);
    if (table) tables.push_back(*std::move(table));
    if (!camera) break;  // the next plane may be the floor
  }
  if (tables.empty()) {
    problem = any_plane ? "there is no table top: the largest level plane is too small, or too narrow"
              : camera && !options.heights.empty() ? "there is no table top: no level plane is as high as the map says"
              : camera ? "there is no table top: too few depths, or no level plane 30 cm and more above z = 0"
                       : "there is no table top: too few depths, or no level plane";
  }
  return tables;
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

std::vector<MaskImage> on_other_tables(const std::vector<cv::Mat3f>& points, const std::vector<Table>& tables) {
  constexpr float kBelow = 0.02F, kRoomAbove = 1;  // as high as things and what holds them can be
  const cv::Size size = points.empty() ? cv::Size() : points[0].size();
  std::vector<MaskImage> others(tables.size());
  for (MaskImage& mask : others) mask = MaskImage(size, std::uint8_t{0});
  for (int y = 0; y < size.height && tables.size() > 1; ++y) {
    for (int x = 0; x < size.width; ++x) {
      std::size_t owner = tables.size();
      float lowest = kRoomAbove;
      for (std::size_t i = 0; i < tables.size(); ++i) {
        const cv::Vec3f& p = points[i](y, x);
        if (p[2] < -kBelow || p[2] > lowest || !tables[i].has(p[0], p[1])) continue;
        owner = i, lowest = p[2];
      }
      if (owner == tables.size()) continue;
      for (std::size_t i = 0; i < tables.size(); ++i) {
        if (i != owner) others[i](y, x) = 255;
      }
    }
  }
  return others;
}

}  // namespace sherlog::rgbd
