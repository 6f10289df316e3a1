#include "rgbd/objects/hypotheses.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <opencv2/imgproc.hpp>

#include "rgbd/objects/standing.h"
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
        depth_row_(table.pose.matrix().row(2)),
        standing_(points, table, calibration, options) {
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

  // By the edge of the picture.
  bool is_cut_off(const Pixels& piece) const {
    return std::ranges::any_of(piece, [&](const cv::Point& p) {
      return p.x < 2 || p.y < 2 || p.x >= points_.cols - 2 || p.y >= points_.rows - 2;
    });
  }

  // Behind the plane of a wall, say: an arm that comes from there.
  bool goes_on_elsewhere(const Pixels& piece) const {
    constexpr int kReach = 3, kFew = 5;  // pixels
    const cv::Rect image({0, 0}, points_.size());
    int count = 0;
    for (const cv::Point& p : piece) {
      const double most = options_.gap + 2 * error_at(p);
      bool goes_on = false;
      for (const cv::Point& step : {cv::Point(-kReach, 0), {kReach, 0}, {0, -kReach}, {0, kReach}}) {
        const cv::Point other = p + step;
        goes_on = goes_on || (other.inside(image) && elsewhere_(other) != 0 && points_(other)[2] > -5 &&
                              cv::norm(points_(other) - points_(p)) < most);
      }
      count += goes_on ? 1 : 0;
    }
    return count > kFew;
  }

  void judge(const Pixels& piece) {
    if (area_of(piece) < options_.least_area || piece.size() < 20) return;
    const auto share_of = [&](auto is_so) {
      return static_cast<double>(std::ranges::count_if(piece, is_so)) / static_cast<double>(piece.size());
    };
    const double outside = share_of([&](const cv::Point& p) { return !table_.has(points_(p)[0], points_(p)[1]); });
    const double inside = share_of([&](const cv::Point& p) { return is_surely_on(points_(p)); });
    if (inside < 0.1) return;  // something beside the table
    const Standing::Foot foot = standing_.foot_of(piece);
    const bool is_beyond = outside > (is_cut_off(piece) ? 0.01 : options_.beyond);
    const bool overhangs =
        is_beyond && !is_cut_off(piece) && !goes_on_elsewhere(piece) && standing_.hangs_over(piece, foot);
    if ((is_beyond && !overhangs) || standing_.hovers(foot)) {
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

  // Where nothing is known to be on the table: the number of its piece.
  cv::Mat1b open_surface() const {
    cv::Mat1b open(points_.size(), std::uint8_t{0});
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
        if (on) open(y, x) = static_cast<std::uint8_t>(table_.piece(on->x(), on->y()));
      }
    }
    return open;
  }

  // By number: two tables of one height may have different colours.
  std::vector<cv::Vec3f> colours_of_pieces() const {
    std::vector<Pixels> surfaces(256);
    for (const cv::Point& p : pixels_of(table_.surface)) {
      surfaces[table_.piece(points_(p)[0], points_(p)[1])].push_back(p);
    }
    std::vector<cv::Vec3f> colours;
    for (const Pixels& surface : surfaces) colours.push_back(median_colour(lab_, surface));
    return colours;
  }

  void find_by_colour() {
    const std::vector<cv::Vec3f> table_colours = colours_of_pieces();
    cv::Mat1b open = open_surface();
    for (const cv::Point& p : pixels_of(open)) {
      if (distance(lab_(p), table_colours[open(p)]) < options_.colour_distance) open(p) = 0;
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
  Standing standing_;
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
