#include "rgbd/objects/walls.h"

#include <algorithm>
#include <climits>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <random>
#include <utility>

namespace sherlog::rgbd {
namespace {

// An upright plane, seen from above: a line.
struct Line {
  Eigen::Vector2d normal = Eigen::Vector2d::UnitX();  // away from the table
  double offset = 0;
  double beyond(double x, double y) const { return normal.x() * x + normal.y() * y - offset; }
};

// What is beyond the table's rim, or at it, and how far its measurements are off.
class WallFinder {
 public:
  WallFinder(const cv::Mat3f& points, const Table& table) {
    error_ = depth_error(table.pose.translation().z());
    eye_ = table.pose.inverse(Eigen::Isometry).translation().head<2>();
    const int reach = static_cast<int>((0.02 + 3 * error_) / table.cell) + 1;
    cv::Mat1b inner;
    cv::erode(table.raster, inner, cv::Mat::ones(2 * reach + 1, 2 * reach + 1, CV_8U));
    std::vector<std::vector<cv::Point>> outlines;
    cv::findContours(table.raster, outlines, cv::RETR_EXTERNAL, cv::CHAIN_APPROX_NONE);
    for (const std::vector<cv::Point>& outline : outlines) {
      std::vector<cv::Point> corners;
      cv::convexHull(outline, corners);
      hulls_.emplace_back();
      for (const cv::Point& cell : corners)
        hulls_.back().push_back(table.raster_origin + table.cell * Eigen::Vector2d(cell.x, cell.y));
    }
    const int step = std::max(1, static_cast<int>(std::sqrt(static_cast<double>(points.total()) / 20'000)));
    for (int y = step / 2; y < points.rows; y += step) {
      for (int x = step / 2; x < points.cols; x += step) {
        const cv::Vec3f& p = points(y, x);
        if (p[2] < kLow || p[2] > kHigh) continue;
        const auto column = static_cast<int>((p[0] - table.raster_origin.x()) / table.cell),
                   row = static_cast<int>((p[1] - table.raster_origin.y()) / table.cell);
        const bool is_inner = column >= 0 && row >= 0 && column < inner.cols && row < inner.rows && inner(row, column);
        if (!is_inner) candidates_.emplace_back(p[0], p[1], p[2]);
      }
    }
  }

  std::vector<Line> find() {
    constexpr int kMostWalls = 3;
    std::vector<Line> walls;
    while (walls.size() < kMostWalls) {
      const std::optional<Line> wall = best();
      if (!wall) break;
      walls.push_back(*wall);
      std::erase_if(candidates_, [&](const Eigen::Vector3d& p) { return wall->beyond(p.x(), p.y()) > -tolerance(); });
    }
    return walls;
  }
  double tolerance() const { return std::max(0.01, 3 * error_); }

 private:
  using Hull = std::vector<Eigen::Vector2d>;
  static constexpr float kLow = 0.02F, kHigh = 1.5F;
  static constexpr double kCell = 0.04;  // of a wall

  std::optional<Line> best() {
    constexpr int kTrials = 120;
    constexpr std::size_t kFewest = 60;
    std::optional<Line> best;
    std::size_t most = kFewest;
    for (int trial = 0; trial < kTrials && candidates_.size() > kFewest; ++trial) {
      const Eigen::Vector3d &a = any(), &b = any();
      const Eigen::Vector2d along = (b - a).head<2>();
      if (along.norm() < 0.15) continue;
      Line line{Eigen::Vector2d(along.y(), -along.x()).normalized(), 0};
      line.offset = line.normal.dot(a.head<2>());
      if (line.beyond(0, 0) > 0) line = {-line.normal, -line.offset};
      if (line.beyond(eye_.x(), eye_.y()) > 0) continue;  // what is between the table and the camera is no wall of its
      const auto is_before = [&](const Eigen::Vector2d& p) { return line.beyond(p.x(), p.y()) < tolerance(); };
      if (!std::ranges::all_of(hulls_, [&](const Hull& hull) { return std::ranges::all_of(hull, is_before); }))
        continue;
      const auto votes = static_cast<std::size_t>(std::ranges::count_if(
          candidates_, [&](const Eigen::Vector3d& p) { return std::abs(line.beyond(p.x(), p.y())) < tolerance(); }));
      if (votes > most && is_wall(line)) most = votes, best = line;
    }
    return best;
  }

  // Behind one of the tables of this height.
  bool is_wall(const Line& line) const {
    const auto along = [&](double x, double y) { return line.normal.x() * y - line.normal.y() * x; };
    std::vector<std::pair<int, int>> cells;
    for (const Eigen::Vector3d& p : candidates_) {
      if (std::abs(line.beyond(p.x(), p.y())) >= tolerance()) continue;
      cells.emplace_back(cvFloor(along(p.x(), p.y()) / kCell), cvFloor(p.z() / kCell));
    }
    std::ranges::sort(cells);
    cells.erase(std::unique(cells.begin(), cells.end()), cells.end());
    return std::ranges::any_of(hulls_, [&](const Hull& hull) {
      const auto [first, last] =
          std::ranges::minmax(hull, {}, [&](const Eigen::Vector2d& p) { return along(p.x(), p.y()); });
      return stands_behind(cells, along(first.x(), first.y()), along(last.x(), last.y()));
    });
  }

  // Upright, covered, and wide: most of the table stands against it, which is more than things in a row at its rim do.
  // `cells`: in order.
  static bool stands_behind(const std::vector<std::pair<int, int>>& cells, double first, double last) {
    constexpr double kLeastWidth = 0.4, kLeastHeight = 0.15, kLeastCover = 0.4, kLeastShare = 0.75;
    const auto begin = std::ranges::lower_bound(cells, std::pair(cvFloor(first / kCell) - 2, INT_MIN)),
               end = std::ranges::upper_bound(cells, std::pair(cvFloor(last / kCell) + 2, INT_MAX));
    if (begin >= end) return false;
    const auto [low, high] = std::ranges::minmax(std::ranges::subrange(begin, end), {}, &std::pair<int, int>::second);
    const int columns = std::prev(end)->first - begin->first + 1, rows = high.second - low.second + 1;
    return columns * kCell > std::max(kLeastWidth, kLeastShare * (last - first)) && rows * kCell > kLeastHeight &&
           static_cast<double>(end - begin) > kLeastCover * columns * rows;
  }

  const Eigen::Vector3d& any() { return candidates_[random_() % candidates_.size()]; }

  double error_ = 0;
  Eigen::Vector2d eye_ = Eigen::Vector2d::Zero();  // the camera, from above
  std::vector<Hull> hulls_;                        // of the tables
  std::vector<Eigen::Vector3d> candidates_;
  std::mt19937_64 random_{7};
};

}  // namespace

MaskImage behind_walls(const cv::Mat3f& points, const Table& table) {
  WallFinder finder(points, table);
  const std::vector<Line> walls = finder.find();
  MaskImage mask(points.size(), std::uint8_t{0});
  for (int y = 0; y < points.rows && !walls.empty(); ++y) {
    for (int x = 0; x < points.cols; ++x) {
      const cv::Vec3f& p = points(y, x);
      if (p[2] < -5) continue;
      for (const Line& wall : walls) {
        if (wall.beyond(p[0], p[1]) > -finder.tolerance()) mask(y, x) = 255;
      }
    }
  }
  return mask;
}

}  // namespace sherlog::rgbd
