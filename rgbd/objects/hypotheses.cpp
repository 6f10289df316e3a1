#include "rgbd/objects/hypotheses.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <opencv2/imgproc.hpp>

#include "rgbd/objects/walls.h"

namespace sherlog::rgbd {
namespace {

using Pixels = std::vector<cv::Point>;

class UnionFind {
 public:
  explicit UnionFind(std::size_t size) : parent_(size) { std::iota(parent_.begin(), parent_.end(), 0); }
  int find(int i) {
    while (parent_[at(i)] != i) i = parent_[at(i)] = parent_[at(parent_[at(i)])];
    return i;
  }
  void join(int a, int b) {
    a = find(a), b = find(b);
    parent_[at(std::max(a, b))] = std::min(a, b);
  }

 private:
  static std::size_t at(int i) { return static_cast<std::size_t>(i); }
  std::vector<int> parent_;
};

// a, b and half of L, with the noise of single pixels smoothed.
cv::Mat3f colours_of(const ColourImage& colour) {
  cv::Mat3f lab;
  colour.convertTo(lab, CV_32FC3, 1 / 255.0);
  cv::GaussianBlur(lab, lab, {3, 3}, 0.8);
  cv::cvtColor(lab, lab, cv::COLOR_BGR2Lab);
  cv::multiply(lab, cv::Scalar(0.5, 1, 1), lab);
  return lab;
}

float distance(const cv::Vec3f& a, const cv::Vec3f& b) { return static_cast<float>(cv::norm(a - b)); }

cv::Vec3f median_colour(const cv::Mat3f& lab, const Pixels& pixels) {
  cv::Vec3f result;
  std::vector<float> values(pixels.size());
  for (int channel = 0; channel < 3 && !pixels.empty(); ++channel) {
    std::ranges::transform(pixels, values.begin(), [&](const cv::Point& p) { return lab(p)[channel]; });
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::nth_element(values.begin(), middle, values.end());
    result[channel] = *middle;
  }
  return result;
}

Pixels pixels_of(const MaskImage& mask) {
  Pixels pixels;
  cv::findNonZero(mask, pixels);
  return pixels;
}

void sort_from_left(std::vector<Hypothesis>& things) {
  std::ranges::stable_sort(things, {}, [](const Hypothesis& h) { return h.roi.x + h.roi.width / 2; });
}

// One call's data.
class Finder {
 public:
  // `elsewhere`: pixels that are none of this table's; their points are gaps.
  Finder(const cv::Mat3f& points, const cv::Mat3f& lab, const Table& table, const Calibration& calibration,
         const HypothesisOptions& options, const MaskImage& elsewhere)
      : points_(points),
        table_(table),
        calibration_(calibration),
        options_(options),
        lab_(lab),
        elsewhere_(elsewhere | behind_walls(points, table)),
        eye_(table.pose.inverse(Eigen::Isometry).translation()),
        turn_(table.pose.linear().transpose()),
        depth_row_(table.pose.matrix().row(2)) {
    result_.reaching_mask = MaskImage(points.size(), std::uint8_t{0});
    taken_ = MaskImage(points.size(), std::uint8_t{0});
  }

  Hypotheses find(const MaskImage& body = {}) {
    if (!body.empty()) {
      result_.reaching_mask |= body;
      result_.reaching += covers_the_table(body) ? 1U : 0U;
    }
    if (options_.use_depth) {
      for (const Pixels& piece : pieces()) judge(piece);
    }
    if (options_.use_colour && !lab_.empty()) find_by_colour();
    for (const Pixels& part : low_) add_low(part);
    sort_from_left(result_.things);
    return std::move(result_);
  }

 private:
  double error_at(const cv::Point& p) const { return depth_error(range(p)); }
  // Along the optical axis.
  double range(const cv::Point& p) const {
    const cv::Vec3f& q = points_(p);
    return depth_row_.dot(Eigen::Vector4d(q[0], q[1], q[2], 1));
  }
  bool stands_out(const cv::Point& p) const {
    const float height = points_(p)[2];
    if (elsewhere_(p) != 0) return false;
    if (height < options_.least_height || height > 2 * options_.most_height) return false;
    return height > options_.errors * error_at(p);
  }

  // Connected pixels above the table, inside of its outline or not.
  std::vector<Pixels> pieces() const {
    const cv::Size size = points_.size();
    cv::Mat1b out(size, std::uint8_t{0});
    for (int y = 0; y < size.height; ++y) {
      for (int x = 0; x < size.width; ++x) out(y, x) = stands_out({x, y}) ? 1 : 0;
    }
    UnionFind sets(points_.total());
    const auto number = [&](const cv::Point& p) { return p.y * size.width + p.x; };
    static const cv::Point kSteps[] = {{-1, 0}, {-2, 0}, {-3, 0}, {0, -1}, {0, -2}, {0, -3}, {-1, -1}, {1, -1}};
    for (int y = 0; y < size.height; ++y) {
      for (int x = 0; x < size.width; ++x) {
        if (out(y, x) == 0) continue;
        const double most = options_.gap + 2 * error_at({x, y}), most_squared = most * most;
        for (const cv::Point& step : kSteps) {
          const cv::Point other = cv::Point(x, y) + step;
          if (other.x < 0 || other.y < 0 || other.x >= size.width || out(other) == 0) continue;
          const cv::Vec3f between = points_(y, x) - points_(other);
          if (static_cast<double>(between.dot(between)) < most_squared) sets.join(number({x, y}), number(other));
        }
      }
    }
    std::vector<Pixels> found;
    std::vector<int> index(points_.total(), -1);
    for (int y = 0; y < size.height; ++y) {
      for (int x = 0; x < size.width; ++x) {
        if (out(y, x) == 0) continue;
        int& place = index[static_cast<std::size_t>(sets.find(number({x, y})))];
        if (place < 0) place = static_cast<int>(found.size()), found.emplace_back();
        found[static_cast<std::size_t>(place)].emplace_back(x, y);
      }
    }
    return found;
  }

  // Whether the body is in front of what is seen of the table, more than by its rim.
  bool covers_the_table(const MaskImage& body) const {
    constexpr int kLeast = 50;  // pixels
    std::vector<cv::Point> outline;
    cv::convexHull(pixels_of(table_.surface), outline);
    if (outline.size() < 3) return false;
    MaskImage whole(points_.size(), std::uint8_t{0});
    cv::fillConvexPoly(whole, outline, 255);
    return cv::countNonZero(whole & body) > kLeast;
  }

  // Square metres that the pixels show, if they face the camera.
  double area_of(const Pixels& pixels) const {
    double area = 0;
    for (const cv::Point& p : pixels) area += std::pow(range(p), 2) / (calibration_.fx * calibration_.fy);
    return area;
  }

  // Below the middle of what is seen of it, a little way into it; and how high its lowest part is.
  struct Foot {
    Eigen::Vector2d middle, away;  // away: from the camera, of length one
    double depth = 0;              // of what is seen, from near to far
    double lowest = 0;
  };
  Foot foot_of(const Pixels& pixels) const {
    const auto quantile = [](std::vector<double>& values, double share) {
      const auto at = values.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
      std::nth_element(values.begin(), at, values.end());
      return *at;
    };
    Foot foot;
    std::vector<double> heights;
    Eigen::Vector2d mean = Eigen::Vector2d::Zero();
    for (const cv::Point& p : pixels) {
      heights.push_back(points_(p)[2]);
      mean += Eigen::Vector2d(points_(p)[0], points_(p)[1]) / static_cast<double>(pixels.size());
    }
    foot.lowest = quantile(heights, 0.02);
    const Eigen::Vector2d line = mean - eye_.head<2>();
    foot.away = line.norm() > 1e-6 ? Eigen::Vector2d(line.normalized()) : Eigen::Vector2d(1, 0);
    const Eigen::Vector2d across(-foot.away.y(), foot.away.x());
    std::vector<double> along, side;
    for (const cv::Point& p : pixels) side.push_back(across.dot(Eigen::Vector2d(points_(p)[0], points_(p)[1])));
    std::vector<double> sorted = side;
    const double middle_side = quantile(sorted, 0.5);
    // A slice of it, as a bent thing is not over the middle of all of it.
    constexpr double kHalfSlice = 0.015;
    for (std::size_t i = 0; i < pixels.size(); ++i) {
      if (std::abs(side[i] - middle_side) > kHalfSlice) continue;
      along.push_back(foot.away.dot(Eigen::Vector2d(points_(pixels[i])[0], points_(pixels[i])[1])));
    }
    const double near = quantile(along, 0.02), far = quantile(along, 0.98);
    foot.middle = foot.away * ((near + far) / 2) + across * middle_side;
    foot.depth = far - near;
    return foot;
  }

  // Whether one looks through below it: what stands on the table hides the table below its middle, as far as it goes, and
  // all that is between. Where a ball or what is looked at from above ends in the picture says nothing.
  bool hovers(const Foot& foot) const {
    if (foot.lowest < options_.hover) return false;
    const Eigen::Vector3d at(foot.middle.x(), foot.middle.y(), foot.lowest / 2);
    const Eigen::Vector3d down = at - eye_;
    const double error = depth_error(depth_row_.dot(Eigen::Vector4d(at.x(), at.y(), at.z(), 1)));
    // In front of an upright face there is nothing of the thing: its own points are off by so much. And of a ball one sees
    // the near half, and of its far half the less the lower one looks: it touches the table behind the middle of that.
    const double level = down.head<2>().norm() / down.norm(), steep = -down.z() / down.norm();
    const double share = 1 / (1 + std::max(0.0, steep - 0.3));
    const double inwards = std::max((0.015 + options_.errors * error) * level, (share - 0.5) * foot.depth);
    const Eigen::Vector2d across(-foot.away.y(), foot.away.x());
    constexpr double kStep = 0.008;  // metres
    std::size_t open = 0, closed = 0;
    for (int i = -1; i <= 1; ++i) {
      for (int j = -1; j <= 1; ++j) {
        const Eigen::Vector2d column = foot.middle + foot.away * (inwards + i * kStep) + across * (j * kStep);
        const auto view = view_through(column, foot.lowest - 0.01);
        if (view == View::kOpen) ++open;
        if (view == View::kClosed) ++closed;
      }
    }
    return open >= 3 && open > closed;
  }

  enum class View { kOpen, kClosed, kUnknown };
  // Of the air between the table and a height: open if something farther away is measured through it anywhere, or the table.
  View view_through(const Eigen::Vector2d& column, double height) const {
    bool is_measured = false;
    for (int step = 0; step < 6; ++step) {
      const Eigen::Vector3d at(column.x(), column.y(), std::max(0.0, height) * step / 5);
      const Eigen::Vector3d in_camera = table_.pose * at;
      if (in_camera.z() < 0.1) continue;
      const Eigen::Vector2d on = calibration_.pixel(in_camera);
      const cv::Point pixel(static_cast<int>(std::lround(on.x())), static_cast<int>(std::lround(on.y())));
      if (!pixel.inside({{0, 0}, points_.size()}) || points_(pixel)[2] < -5) continue;
      is_measured = true;
      const double tolerance = 0.005 + 2 * depth_error(in_camera.z());
      const double beyond = range(pixel) - in_camera.z();
      if (step == 0 ? beyond > -tolerance : beyond > tolerance + 0.01) return View::kOpen;
    }
    return is_measured ? View::kClosed : View::kUnknown;
  }

  // By the edge of the picture.
  bool is_cut_off(const Pixels& piece) const {
    return std::ranges::any_of(piece, [&](const cv::Point& p) {
      return p.x < 2 || p.y < 2 || p.x >= points_.cols - 2 || p.y >= points_.rows - 2;
    });
  }

  // Over the table's edge, but not from beyond it: its middle is on the table, and all of it close by.
  bool hangs_over(const Pixels& piece, const Foot& foot) {
    if (is_cut_off(piece) || !table_.has(foot.middle.x(), foot.middle.y())) return false;
    if (beyond_.empty()) cv::distanceTransform(table_.raster == 0, beyond_, cv::DIST_L2, cv::DIST_MASK_PRECISE);
    std::size_t far = 0;
    for (const cv::Point& p : piece) {
      const Eigen::Vector3d at(points_(p)[0], points_(p)[1], 0);
      const Eigen::Vector2d cell = (at.head<2>() - table_.raster_origin) / table_.cell;
      // The raster goes some centimetres beyond the outline.
      const int column = std::clamp(static_cast<int>(cell.x()), 0, table_.raster.cols - 1),
                row = std::clamp(static_cast<int>(cell.y()), 0, table_.raster.rows - 1);
      const double off = std::hypot(cell.x() - column, cell.y() - row) + beyond_(row, column);
      if (off * table_.cell > options_.overhang + error_at(p)) ++far;
    }
    return 50 * far < piece.size();
  }

  void judge(const Pixels& piece) {
    if (area_of(piece) < options_.least_area || piece.size() < 20) return;
    const auto share_of = [&](auto is_so) {
      return static_cast<double>(std::ranges::count_if(piece, is_so)) / static_cast<double>(piece.size());
    };
    const double outside = share_of([&](const cv::Point& p) { return !table_.has(points_(p)[0], points_(p)[1]); });
    const double inside = share_of([&](const cv::Point& p) { return is_surely_on(points_(p)); });
    if (inside < 0.1) return;  // something beside the table
    const Foot foot = foot_of(piece);
    const bool is_beyond = outside > (is_cut_off(piece) ? 0.01 : options_.beyond);
    const bool overhangs = is_beyond && hangs_over(piece, foot);
    if ((is_beyond && !overhangs) || hovers(foot)) {
      ++result_.reaching;
      for (const cv::Point& p : piece) result_.reaching_mask(p) = 255;
      return;
    }
    if (inside < 0.5 && !overhangs) return;
    for (const Pixels& part : parts(piece)) {
      if (is_low(part)) {
        low_.push_back(part);
      } else {
        add(part, false);
      }
    }
  }

  // Two means of the colours, begun at the ends of the longest axis; the parts' shares of connected pixels have to be
  // large.
  std::vector<Pixels> parts(const Pixels& piece) const {
    if (lab_.empty() || !options_.use_colour) return {piece};
    const cv::Vec3f middle = median_colour(lab_, piece);
    const auto farthest = [&](const cv::Vec3f& from) {
      return lab_(*std::ranges::max_element(piece, {}, [&](const cv::Point& p) { return distance(lab_(p), from); }));
    };
    cv::Vec3f a = farthest(middle), b = farthest(a);
    Pixels first, second;
    for (int round = 0; round < 6; ++round) {
      first.clear(), second.clear();
      cv::Vec3d sum_a, sum_b;
      for (const cv::Point& p : piece) {
        const bool is_first = distance(lab_(p), a) < distance(lab_(p), b);
        (is_first ? first : second).push_back(p);
        (is_first ? sum_a : sum_b) += cv::Vec3d(lab_(p));
      }
      if (first.empty() || second.empty()) return {piece};
      a = cv::Vec3f(sum_a / static_cast<double>(first.size()));
      b = cv::Vec3f(sum_b / static_cast<double>(second.size()));
    }
    if (distance(a, b) < options_.split_distance || !is_a_thing(first, piece) || !is_a_thing(second, piece))
      return {piece};
    std::vector<Pixels> result = parts(first);
    for (Pixels& part : parts(second)) result.push_back(std::move(part));
    return result;
  }

  // Large enough, nearly all in one piece, and standing on the table.
  bool is_a_thing(const Pixels& part, const Pixels& whole) const {
    if (static_cast<double>(part.size()) < options_.least_part * static_cast<double>(whole.size())) return false;
    if (area_of(part) < options_.least_area) return false;
    const cv::Rect box = cv::boundingRect(part);
    MaskImage mask(box.size(), std::uint8_t{0});
    for (const cv::Point& p : part) mask(p - box.tl()) = 255;
    cv::Mat1i labels;
    cv::Mat statistics, centres;
    const int count = cv::connectedComponentsWithStats(mask, labels, statistics, centres, 8, CV_32S);
    int largest = 0;
    for (int i = 1; i < count; ++i) largest = std::max(largest, statistics.at<int>(i, cv::CC_STAT_AREA));
    if (largest < 0.85 * static_cast<double>(part.size())) return false;
    const auto low = std::ranges::count_if(part, [&](const cv::Point& p) { return points_(p)[2] < options_.hover; });
    return static_cast<double>(low) > 0.02 * static_cast<double>(part.size());
  }

  // So low that depth has it in parts only.
  bool is_low(const Pixels& pixels) const {
    const auto high = std::ranges::count_if(
        pixels, [&](const cv::Point& p) { return points_(p)[2] > static_cast<float>(2 * options_.least_height); });
    return static_cast<std::size_t>(50 * high) < pixels.size();
  }

  // What colour has found there is all of it; else it is what depth has.
  void add_low(const Pixels& pixels) {
    for (Hypothesis& thing : result_.things) {
      if (!thing.from_colour) continue;
      const auto common = std::ranges::count_if(
          pixels, [&](const cv::Point& p) { return thing.roi.contains(p) && thing.mask(p - thing.roi.tl()) != 0; });
      if (static_cast<std::size_t>(5 * common) < 2 * pixels.size()) continue;
      // Where depth measures it, its points are measured.
      cv::Mat1b measured(thing.roi.size(), std::uint8_t{0});
      for (const cv::Point& p : pixels) {
        if (thing.roi.contains(p)) measured(p - thing.roi.tl()) = 255;
      }
      thing.points.clear();
      for (const cv::Point& q : pixels_of(thing.mask)) {
        const cv::Point p = q + thing.roi.tl();
        if (measured(q) != 0) {
          thing.points.emplace_back(points_(p)[0], points_(p)[1], points_(p)[2]);
        } else if (const auto on = on_surface(p)) {
          thing.points.push_back(*on);
        }
      }
      thing.from_colour = false;
      return;
    }
    add(pixels, false);
  }

  void add(const Pixels& pixels, bool from_colour) {
    Hypothesis thing;
    thing.roi = cv::boundingRect(pixels);
    thing.mask = cv::Mat1b::zeros(thing.roi.size());
    thing.from_colour = from_colour;
    for (const cv::Point& p : pixels) {
      thing.mask(p - thing.roi.tl()) = 255;
      taken_(p) = 255;
      if (from_colour) {
        if (const auto on = on_surface(p)) thing.points.push_back(*on);
      } else {
        thing.points.emplace_back(points_(p)[0], points_(p)[1], points_(p)[2]);
      }
    }
    result_.things.push_back(std::move(thing));
  }

  // Where the pixel's ray meets the table.
  std::optional<Eigen::Vector3f> on_surface(const cv::Point& p) const {
    const Eigen::Vector3d ray = turn_ * calibration_.point(p.x, p.y, 1);
    if (ray.z() > -0.05) return std::nullopt;
    return (eye_ - ray * (eye_.z() / ray.z())).cast<float>();
  }

  MaskImage open_surface() const {
    MaskImage open(points_.size(), std::uint8_t{0});
    const int reach = std::max(1, points_.cols / 128);
    MaskImage blocked;
    cv::dilate(taken_ | result_.reaching_mask | elsewhere_, blocked,
               cv::Mat::ones(2 * reach + 1, 2 * reach + 1, CV_8U));
    const cv::Rect box = cv::boundingRect(table_.surface);
    for (int y = box.y; y < box.br().y; ++y) {
      for (int x = box.x; x < box.br().x; ++x) {
        if (blocked(y, x) != 0) continue;
        const float height = points_(y, x)[2];
        if (height > -5 && std::abs(height) > std::max(0.012, options_.errors * error_at({x, y}))) continue;
        const auto on = on_surface({x, y});
        if (on && table_.has(on->x(), on->y())) open(y, x) = 255;
      }
    }
    return open;
  }

  void find_by_colour() {
    const cv::Vec3f table_colour = median_colour(lab_, pixels_of(table_.surface));
    MaskImage open = open_surface();
    for (int y = 0; y < open.rows; ++y) {
      for (int x = 0; x < open.cols; ++x) {
        if (open(y, x) != 0 && distance(lab_(y, x), table_colour) < options_.colour_distance) open(y, x) = 0;
      }
    }
    cv::morphologyEx(open, open, cv::MORPH_OPEN, cv::Mat::ones(2, 2, CV_8U));
    cv::Mat1i labels;
    const int count = cv::connectedComponents(open, labels, 8, CV_32S);
    std::vector<Pixels> pieces(static_cast<std::size_t>(count));
    for (const cv::Point& p : pixels_of(open)) pieces[static_cast<std::size_t>(labels(p))].push_back(p);
    const MaskImage depth_things = taken_.clone();
    for (const Pixels& pixels : pieces) {
      if (surface_area(pixels) >= options_.least_area && !belongs_to_a_thing(pixels, depth_things) &&
          is_inside(pixels)) {
        add(pixels, true);
      }
    }
  }

  // The table's own rim has other colours beside it.
  bool is_inside(const Pixels& pixels) const {
    const auto at_rim = std::ranges::count_if(pixels, [&](const cv::Point& p) {
      const auto on = on_surface(p);
      return !on || !is_inside_by(std::max(0.012, rim_error(*on)), on->x(), on->y());
    });
    return 2 * static_cast<std::size_t>(at_rim) < pixels.size();
  }

  bool is_inside_by(double margin, double x, double y) const {
    return table_.has(x - margin, y) && table_.has(x + margin, y) && table_.has(x, y - margin) &&
           table_.has(x, y + margin);
  }

  // Inside of the outline; of a far table, by more than its place is uncertain.
  bool is_surely_on(const cv::Vec3f& at) const {
    constexpr double kFar = 0.02;
    const double margin = rim_error({at[0], at[1], 0});
    return margin > kFar ? is_inside_by(margin, at[0], at[1]) : table_.has(at[0], at[1]);
  }

  // Errors of depth and a pixel's length on the table.
  double rim_error(const Eigen::Vector3f& on) const {
    const Eigen::Vector3d point = table_.pose * on.cast<double>();
    const double facing = std::max(0.1, std::abs(table_.pose.linear().col(2).dot(point.normalized())));
    return options_.errors * depth_error(point.z()) + point.z() / (calibration_.fy * facing);
  }

  double surface_area(const Pixels& pixels) const {
    const Eigen::Vector3d normal = table_.pose.linear().col(2);
    double area = 0;
    for (const cv::Point& p : pixels) {
      const auto on = on_surface(p);
      if (!on) continue;
      const Eigen::Vector3d point = table_.pose * on->cast<double>();
      const double facing = std::abs(normal.dot(point.normalized()));
      area += point.z() * point.z() / (calibration_.fx * calibration_.fy * std::max(facing, 0.1));
    }
    return area;
  }

  // Pixels beside a thing, in its colour: its lowest edge, which depth does not tell from the table, or a side in the
  // projector's shadow.
  bool belongs_to_a_thing(const Pixels& pixels, const MaskImage& things) const {
    const int reach = std::max(2, points_.cols / 64);
    const cv::Rect box = cv::boundingRect(pixels), image({0, 0}, points_.size());
    const cv::Rect around = (cv::Rect(box.tl() - cv::Point(reach, reach), box.br() + cv::Point(reach, reach))) & image;
    MaskImage near;
    MaskImage mine(around.size(), std::uint8_t{0});
    for (const cv::Point& p : pixels) mine(p - around.tl()) = 255;
    cv::dilate(mine, near, cv::Mat::ones(2 * reach + 1, 2 * reach + 1, CV_8U));
    near.setTo(0, things(around) == 0);
    // Sides are darker than tops: less than what makes two things.
    const cv::Vec3f mean = median_colour(lab_, pixels);
    const auto alike = std::ranges::count_if(pixels_of(near), [&](const cv::Point& p) {
      return distance(lab_(p + around.tl()), mean) < options_.split_distance;
    });
    return static_cast<std::size_t>(alike) >= std::max<std::size_t>(5, pixels.size() / 20);
  }

  const cv::Mat3f& points_;
  const Table& table_;
  const Calibration& calibration_;
  const HypothesisOptions& options_;
  const cv::Mat3f& lab_;
  MaskImage elsewhere_;
  Eigen::Vector3d eye_;  // the camera, in the table's frame
  Eigen::Matrix3d turn_;
  Eigen::RowVector4d depth_row_;
  cv::Mat1f beyond_;  // cells from the outline, where the table's raster is; empty: not needed yet
  MaskImage taken_;
  std::vector<Pixels> low_;
  Hypotheses result_;
};

// One table's, with gaps where nothing of its own is measured.
Hypotheses find_on(const cv::Mat3f& points, const cv::Mat3f& lab, const Table& table, const Calibration& calibration,
                   const HypothesisOptions& options, const MaskImage& body, const MaskImage& elsewhere) {
  if (body.empty() && elsewhere.empty())
    return Finder(points, lab, table, calibration, options, MaskImage(points.size(), std::uint8_t{0})).find();
  cv::Mat3f own = points.clone();
  if (!body.empty()) own.setTo(cv::Scalar(0, 0, -10), body);
  if (!elsewhere.empty()) own.setTo(cv::Scalar(0, 0, -10), elsewhere);
  const MaskImage none = elsewhere.empty() ? MaskImage(points.size(), std::uint8_t{0}) : elsewhere;
  return Finder(own, lab, table, calibration, options, none).find(body);
}

cv::Mat3f colours_for(const cv::Mat3f& points, const ColourImage& colour) {
  return colour.size() == points.size() ? colours_of(colour) : cv::Mat3f();
}

}  // namespace

Hypotheses find_hypotheses(const cv::Mat3f& points, const ColourImage& colour, const Table& table,
                           const Calibration& calibration, const HypothesisOptions& options) {
  return find_on(points, colours_for(points, colour), table, calibration, options, {}, {});
}

Hypotheses find_hypotheses(const std::vector<cv::Mat3f>& points, const ColourImage& colour,
                           const std::vector<Table>& tables, const Calibration& calibration,
                           const HypothesisOptions& options, const MaskImage& known) {
  Hypotheses all;
  if (tables.empty()) return all;
  // With the row of pixels at its outline, which measure now this and now that.
  MaskImage body;
  if (!known.empty() && cv::countNonZero(known) > 0) cv::dilate(known, body, cv::Mat::ones(3, 3, CV_8U));
  const cv::Mat3f lab = colours_for(points[0], colour);
  const std::vector<MaskImage> others = on_other_tables(points, tables);
  all.reaching_mask = MaskImage(points[0].size(), std::uint8_t{0});
  for (std::size_t i = 0; i < tables.size(); ++i) {
    Hypotheses its =
        find_on(points[i], lab, tables[i], calibration, options, body, tables.size() == 1 ? MaskImage() : others[i]);
    for (Hypothesis& thing : its.things) {
      thing.table = i;
      all.things.push_back(std::move(thing));
    }
    all.reaching += its.reaching;
    all.reaching_mask |= its.reaching_mask;
  }
  sort_from_left(all.things);
  return all;
}

}  // namespace sherlog::rgbd
