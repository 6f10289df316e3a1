#include "rgbd/pose/descriptor.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <numbers>

#include "rgbd/frames/png.h"

namespace sherlog::rgbd {
namespace {

constexpr double kPi = std::numbers::pi;

// The grid of one direction, smoothed along one axis; what falls over the border is lost.
void smooth(PoseDescriptor& pose, std::span<const double> kernel, std::size_t stride_along, std::size_t stride_across) {
  const auto reach = static_cast<std::ptrdiff_t>(kernel.size() / 2);
  for (std::size_t direction = 0; direction < kPoseDirections; ++direction) {
    for (std::size_t line = 0; line < kPoseCells; ++line) {
      std::array<double, kPoseCells> before{};
      const auto at = [&](std::size_t k) -> float& {
        return pose[(line * stride_across + k * stride_along) * kPoseDirections + direction];
      };
      for (std::size_t k = 0; k < kPoseCells; ++k) before[k] = static_cast<double>(at(k));
      for (std::size_t k = 0; k < kPoseCells; ++k) {
        double sum = 0;
        for (std::ptrdiff_t d = -reach; d <= reach; ++d) {
          const auto from = static_cast<std::ptrdiff_t>(k) + d;
          if (from < 0 || from >= static_cast<std::ptrdiff_t>(kPoseCells)) continue;
          sum += kernel[static_cast<std::size_t>(d + reach)] * before[static_cast<std::size_t>(from)];
        }
        at(k) = static_cast<float>(sum);
      }
    }
  }
}

std::vector<double> gaussian(double sigma) {
  const int reach = static_cast<int>(std::ceil(3 * sigma));
  std::vector<double> kernel;
  double sum = 0;
  for (int d = -reach; d <= reach; ++d) sum += kernel.emplace_back(std::exp(-d * d / (2 * sigma * sigma)));
  for (double& k : kernel) k /= sum;
  return kernel;
}

}  // namespace

std::optional<std::vector<float>> branch_directions(const HilbertMap& map, std::span<const Pixel> points,
                                                    std::uint32_t neighbours) {
  KeypointQueue queue(map);
  if (points.empty() || !queue.assign(points)) return std::nullopt;
  std::vector<float> directions;
  for (const double down : local_directions(queue, points, neighbours)) {
    directions.push_back(static_cast<float>(down > 0 ? kPi - down : -down));  // of an image, whose y axis points down
  }
  return directions;
}

std::optional<PoseDescriptor> describe_pose(std::span<const Pixel> points, std::span<const float> directions,
                                            const PoseOptions& options) {
  if (points.size() < 2 || directions.size() != points.size()) return std::nullopt;
  const auto [left, right] = std::ranges::minmax(points, {}, &Pixel::x);
  const auto [top, bottom] = std::ranges::minmax(points, {}, &Pixel::y);
  const double width = right.x - left.x + 1.0, height = bottom.y - top.y + 1.0;
  const auto cell = [](double offset, double side) {
    return std::min(static_cast<std::size_t>((offset + 0.5) / side * kPoseCells), kPoseCells - 1);
  };
  PoseDescriptor pose{};
  for (std::size_t i = 0; i < points.size(); ++i) {
    const std::size_t x = cell(points[i].x - left.x, width), y = cell(points[i].y - top.y, height);
    const auto bin =
        static_cast<std::size_t>(std::lround(static_cast<double>(directions[i]) / (kPi / 4))) % kPoseDirections;
    pose[(y * kPoseCells + x) * kPoseDirections + bin] += 1.0F / static_cast<float>(points.size());
  }
  if (options.smoothing > 0) {
    const std::vector<double> kernel = gaussian(options.smoothing);
    smooth(pose, kernel, 1, kPoseCells);
    smooth(pose, kernel, kPoseCells, 1);
  }
  return pose;
}

double correlation(const PoseDescriptor& a, const PoseDescriptor& b) {
  double sum_a = 0, sum_b = 0;
  for (std::size_t i = 0; i < kPoseLength; ++i) {
    sum_a += static_cast<double>(a[i]);
    sum_b += static_cast<double>(b[i]);
  }
  const double mean_a = sum_a / kPoseLength, mean_b = sum_b / kPoseLength;
  double ab = 0, aa = 0, bb = 0;
  for (std::size_t i = 0; i < kPoseLength; ++i) {
    const double da = static_cast<double>(a[i]) - mean_a, db = static_cast<double>(b[i]) - mean_b;
    ab += da * db;
    aa += da * da;
    bb += db * db;
  }
  const double norm = std::sqrt(aa * bb);
  return norm > 0 ? std::clamp(ab / norm, -1.0, 1.0) : 0.0;
}

bool PoseLibrary::add(const PoseDescriptor& pose) {
  std::vector<std::uint8_t> bytes;
  for (const float value : pose) {
    const auto bits = std::bit_cast<std::uint32_t>(value);
    for (unsigned shift = 0; shift < 32; shift += 8) bytes.push_back(static_cast<std::uint8_t>(bits >> shift));
  }
  if (!sums_.insert(crc32(bytes)).second) return false;
  poses_.push_back(pose);
  return true;
}

std::vector<PoseMatch> PoseLibrary::find(const PoseDescriptor& pose, double least) const {
  std::vector<PoseMatch> matches;
  for (std::size_t i = 0; i < poses_.size(); ++i) {
    const double c = correlation(pose, poses_[i]);
    if (c >= least) matches.push_back({i, c});
  }
  std::ranges::stable_sort(matches, std::greater<>{}, &PoseMatch::correlation);
  return matches;
}

}  // namespace sherlog::rgbd
