#include "rgbd/depth/known_structure.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace sherlog::rgbd {
namespace {

using Eigen::Vector3d;
constexpr double kNearest = 0.05;                      // metres
constexpr double kPerInverseMetre = kA2 / kA4 / 1000;  // steps; Eq. 1 without a3, which is 0.0007 steps

// Half of polygon and half of circle: what is missing and what is too much are as large.
double mean_radius(double radius, std::uint32_t segments) {
  return radius * 2 / (1 + std::cos(std::numbers::pi / segments));
}

// Rings of `segments` points around z, joined from below to above and closed with a point at either end.
Mesh rings(std::span<const std::array<double, 2>> radius_and_height, double bottom, double top,
           std::uint32_t segments) {
  Mesh mesh;
  for (const auto& [radius, height] : radius_and_height) {
    for (std::uint32_t k = 0; k < segments; ++k) {
      const double angle = 2 * std::numbers::pi * k / segments;
      mesh.points.emplace_back(radius * std::cos(angle), radius * std::sin(angle), height);
    }
  }
  const auto count = static_cast<std::uint32_t>(radius_and_height.size());
  const std::uint32_t low = count * segments, high = low + 1;
  mesh.points.emplace_back(0, 0, bottom);
  mesh.points.emplace_back(0, 0, top);
  for (std::uint32_t k = 0; k < segments; ++k) {
    const std::uint32_t next = (k + 1) % segments;
    for (std::uint32_t r = 0; r + 1 < count; ++r) {
      const std::uint32_t here = r * segments, above = here + segments;
      mesh.triangles.push_back({here + k, here + next, above + next});
      mesh.triangles.push_back({here + k, above + next, above + k});
    }
    mesh.triangles.push_back({low, next, k});
    mesh.triangles.push_back({high, low - segments + k, low - segments + next});
  }
  return mesh;
}

// Where the drawn depth jumps: a neighbour may be what is measured here.
bool fits_across_jump(const DisparityImage& drawn, int y, int x, float measured, float tolerance) {
  constexpr float kJump = 4;  // steps
  for (int v = std::max(y - 1, 0); v <= std::min(y + 1, drawn.rows - 1); ++v) {
    for (int u = std::max(x - 1, 0); u <= std::min(x + 1, drawn.cols - 1); ++u) {
      if (std::abs(drawn(v, u) - drawn(y, x)) > kJump && std::abs(drawn(v, u) - measured) <= tolerance) return true;
    }
  }
  return false;
}

// Sums of three neighbours in a row, of two rows of numbers; the border repeats nothing.
void sum_of_three(const float* in, int width, float* __restrict out) {
  if (width == 1) {
    out[0] = in[0];
    return;
  }
  out[0] = in[0] + in[1];
  for (int x = 1; x + 1 < width; ++x) out[x] = in[x - 1] + in[x] + in[x + 1];
  out[width - 1] = in[width - 2] + in[width - 1];
}

}  // namespace

Mesh box_mesh(const Vector3d& size) {
  Mesh mesh;
  for (int i = 0; i < 8; ++i) {
    mesh.points.emplace_back(
        Vector3d((i & 1) != 0 ? 0.5 : -0.5, (i & 2) != 0 ? 0.5 : -0.5, (i & 4) != 0 ? 0.5 : -0.5).cwiseProduct(size));
  }
  mesh.triangles = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
                    {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
  return mesh;
}

Mesh cylinder_mesh(double diameter, double height, std::uint32_t segments) {
  const double r = mean_radius(diameter / 2, segments);
  const std::array<std::array<double, 2>, 2> both = {{{r, -height / 2}, {r, height / 2}}};
  return rings(both, -height / 2, height / 2, segments);
}

Mesh capsule_mesh(double diameter, double length, std::uint32_t segments) {
  const double r = mean_radius(diameter / 2, segments);
  std::vector<std::array<double, 2>> all;
  const std::uint32_t quarter = std::max(segments / 4, 2U);
  for (const double side : {-1.0, 1.0}) {
    for (std::uint32_t k = 0; k < quarter; ++k) {
      const double angle = std::numbers::pi / 2 * (side < 0 ? k + 1.0 - quarter : static_cast<double>(k)) / quarter;
      all.push_back({r * std::cos(angle), side * length / 2 + r * std::sin(angle)});
    }
  }
  return rings(all, -length / 2 - r, length / 2 + r, segments);
}

void VirtualView::clear(cv::Size size) {
  disparity_.create(size);
  disparity_.setTo(static_cast<float>(kA1));
}

void VirtualView::draw(std::span<const PlacedMesh> meshes, const Calibration& c, const Eigen::Isometry3d& camera) {
  const Eigen::Isometry3d to_camera = camera.inverse();
  for (const PlacedMesh& placed : meshes) {
    const Eigen::Isometry3d to_sensor = to_camera * placed.pose;
    points_.clear();
    for (const Vector3d& point : placed.mesh.points) points_.push_back(to_sensor * point);
    for (const auto& triangle : placed.mesh.triangles) {
      const Vector3d &p = points_[triangle[0]], &q = points_[triangle[1]], &r = points_[triangle[2]];
      if ((q - p).cross(r - p).dot(p) >= 0) continue;  // seen from behind
      // What is too near is cut off: a triangle becomes none, one, or one of four corners.
      std::array<Vector3d, 4> corners;
      std::size_t count = 0;
      const std::array<const Vector3d*, 3> all = {&p, &q, &r};
      for (std::size_t k = 0; k < 3; ++k) {
        const Vector3d &a = *all[k], &b = *all[(k + 1) % 3];
        if (a.z() >= kNearest) corners[count++] = a;
        if ((a.z() >= kNearest) != (b.z() >= kNearest)) {
          corners[count++] = a + (kNearest - a.z()) / (b.z() - a.z()) * (b - a);
        }
      }
      if (count >= 3) draw_triangle(corners[0], corners[1], corners[2], c);
      if (count == 4) draw_triangle(corners[0], corners[2], corners[3], c);
    }
  }
}

void VirtualView::draw_triangle(const Vector3d& a, const Vector3d& b, const Vector3d& c,
                                const Calibration& calibration) {
  struct Corner {
    double x, y, index;
  };
  std::array<Corner, 3> p;
  const std::array<const Vector3d*, 3> all = {&a, &b, &c};
  for (std::size_t k = 0; k < 3; ++k) {
    const Eigen::Vector2d at = calibration.pixel(*all[k]);
    p[k] = {at.x(), at.y(), kA1 - kPerInverseMetre / all[k]->z()};
  }
  const double area = (p[1].x - p[0].x) * (p[2].y - p[0].y) - (p[2].x - p[0].x) * (p[1].y - p[0].y);
  if (std::abs(area) < 1e-9) return;
  // index = index0 + along (x - x0) + down (y - y0)
  const double along =
      ((p[1].index - p[0].index) * (p[2].y - p[0].y) - (p[2].index - p[0].index) * (p[1].y - p[0].y)) / area;
  const double down =
      ((p[2].index - p[0].index) * (p[1].x - p[0].x) - (p[1].index - p[0].index) * (p[2].x - p[0].x)) / area;
  constexpr double kSeam = 1e-3;  // pixels: triangles that share an edge leave no pixel out
  const auto [least, most] = std::ranges::minmax({p[0].y, p[1].y, p[2].y});
  const int first = static_cast<int>(std::ceil(std::max(least - kSeam, 0.0)));
  const int last = static_cast<int>(std::floor(std::min(most + kSeam, disparity_.rows - 1.0)));
  for (int y = first; y <= last; ++y) {
    double left = 1e9, right = -1e9;
    for (std::size_t k = 0; k < 3; ++k) {
      const Corner &from = p[k], &to = p[(k + 1) % 3];
      if (std::min(from.y, to.y) - kSeam > y || std::max(from.y, to.y) + kSeam < y) continue;
      const double rise = to.y - from.y;
      const double s = std::abs(rise) < 1e-9 ? 0.0 : std::clamp((y - from.y) / rise, 0.0, 1.0);
      const double x = from.x + s * (to.x - from.x);
      left = std::min(left, x);
      right = std::max(right, x);
      if (std::abs(rise) < 1e-9) {
        left = std::min(left, to.x);
        right = std::max(right, to.x);
      }
    }
    const int begin = static_cast<int>(std::ceil(std::max(left - kSeam, 0.0)));
    const int end = static_cast<int>(std::floor(std::min(right + kSeam, disparity_.cols - 1.0))) + 1;
    const auto start = static_cast<float>(p[0].index + along * (begin - p[0].x) + down * (y - p[0].y));
    const auto step = static_cast<float>(along);
    float* row = disparity_[y] + begin;
    for (int x = 0; x < end - begin; ++x) {
      const float index = start + step * static_cast<float>(x);
      row[x] = row[x] < index ? row[x] : index;
    }
  }
}

void known_structure(const DepthImage& depth, const DisparityImage& drawn, const KnownStructureOptions& options,
                     MaskImage& known) {
  known.create(depth.size());
  if (depth.empty()) return;
  const int width = depth.cols;
  DisparityImage measured;
  to_disparity(depth, measured);
  // Of the pixels that agree: residuals and how many, summed over three columns; three rows at a time.
  const auto columns = static_cast<std::size_t>(width);
  std::vector<float> residual(columns), agrees(columns);
  std::array<std::vector<float>, 3> sums, counts;
  for (auto* rows : {&sums, &counts}) {
    for (auto& row : *rows) row.assign(columns, 0.0F);
  }
  const float off = options.inaccuracy / static_cast<float>(kPerInverseMetre);
  const auto tolerance_at = [&](float index, float steps) {
    const float inverse = static_cast<float>(kA1) - index;  // kPerInverseMetre / z
    return steps + off * inverse * inverse;
  };
  const auto fill = [&](int y) {
    auto &sum = sums[static_cast<std::size_t>(y) % 3], &count = counts[static_cast<std::size_t>(y) % 3];
    if (y >= depth.rows) {
      std::ranges::fill(sum, 0.0F);
      std::ranges::fill(count, 0.0F);
      return;
    }
    const float *m = measured[y], *d = drawn[y];
    float *r = residual.data(), *g = agrees.data();
    for (int x = 0; x < width; ++x) {
      const float difference = m[x] - d[x];
      const bool agree = std::abs(difference) <= tolerance_at(d[x], options.tolerance);
      r[x] = agree ? difference : 0.0F;
      g[x] = agree ? 1.0F : 0.0F;
    }
    sum_of_three(r, width, sum.data());
    sum_of_three(g, width, count.data());
  };
  fill(0);
  for (int y = 0; y < depth.rows; ++y) {
    fill(y + 1);
    const float *m = measured[y], *d = drawn[y];
    std::uint8_t* out = known[y];
    for (int x = 0; x < width; ++x) {
      const auto i = static_cast<std::size_t>(x);
      const float sum = sums[0][i] + sums[1][i] + sums[2][i], count = counts[0][i] + counts[1][i] + counts[2][i];
      const bool agrees_itself = std::abs(m[x] - d[x]) <= tolerance_at(d[x], options.tolerance);
      const bool mean_agrees = std::abs(sum) <= count * tolerance_at(d[x], options.mean_tolerance);
      out[x] = agrees_itself && mean_agrees ? 255 : 0;
    }
    for (int x = 0; x < width; ++x) {
      if (out[x] != 0 || is_gap(m[x]) || std::abs(m[x] - d[x]) <= options.tolerance) continue;
      if (fits_across_jump(drawn, y, x, m[x], tolerance_at(m[x], options.tolerance))) out[x] = 255;
    }
  }
}

void remove_known(const MaskImage& known, DepthImage& depth) { depth.setTo(std::uint16_t{0}, known); }

}  // namespace sherlog::rgbd
