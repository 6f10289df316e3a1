#include "rgbd/pose/keypoints.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "rgbd/depth/background.h"

namespace sherlog::rgbd {
namespace {

// By the eight neighbours of a pixel, as bits from the one above, clockwise: may it go in the first or second half of a
// round?
struct ThinningTables {
  std::array<std::array<bool, 256>, 2> goes{};
};
constexpr ThinningTables make_tables() {
  ThinningTables tables;
  for (unsigned bits = 0; bits < 256; ++bits) {
    const auto p = [bits](unsigned k) { return ((bits >> (k % 8)) & 1U) != 0; };
    unsigned crossings = 0, pairs = 0, other_pairs = 0;
    for (unsigned k = 0; k < 8; k += 2) {
      crossings += !p(k) && (p(k + 1) || p(k + 2)) ? 1U : 0U;
      pairs += p(k + 7) || p(k) ? 1U : 0U;
      other_pairs += p(k) || p(k + 1) ? 1U : 0U;
    }
    const unsigned least = pairs < other_pairs ? pairs : other_pairs;
    const bool inner = crossings == 1 && least >= 2 && least <= 3;
    tables.goes[0][bits] = inner && !((p(0) || p(1) || !p(3)) && p(2));
    tables.goes[1][bits] = inner && !((p(4) || p(5) || !p(7)) && p(6));
  }
  return tables;
}
constexpr ThinningTables kThinning = make_tables();

}  // namespace

void remove_small_components(MaskImage& mask, std::int32_t least_pixels) {
  if (mask.empty()) return;
  cv::Mat1i labels;
  cv::Mat stats, centroids;
  const int count = cv::connectedComponentsWithStats(mask, labels, stats, centroids, 8, CV_32S);
  std::vector<std::uint8_t> keep(static_cast<std::size_t>(count), std::uint8_t{0});
  for (int label = 1; label < count; ++label) {
    if (stats.at<int>(label, cv::CC_STAT_AREA) >= least_pixels) keep[static_cast<std::size_t>(label)] = 255;
  }
  std::transform(labels.begin(), labels.end(), mask.begin(),
                 [&](int label) { return keep[static_cast<std::size_t>(label)]; });
}

void contours(const cv::Mat1f& gradient_magnitude, const KeypointOptions& options, MaskImage& contour) {
  contour.create(gradient_magnitude.size());
  std::transform(gradient_magnitude.begin(), gradient_magnitude.end(), contour.begin(),
                 [&](float magnitude) { return magnitude > options.contour ? std::uint8_t{255} : std::uint8_t{0}; });
  remove_small_components(contour, options.least_contour);
}

void thin(MaskImage& mask) {
  // A frame of nothing around it, and a list of the pixels that are left.
  MaskImage padded(mask.rows + 2, mask.cols + 2, std::uint8_t{0});
  const auto stride = static_cast<std::ptrdiff_t>(padded.cols);
  std::uint8_t* base = padded.ptr();
  std::vector<std::ptrdiff_t> left, going;
  for (int y = 0; y < mask.rows; ++y) {
    for (int x = 0; x < mask.cols; ++x) {
      if (mask(y, x) == 0) continue;
      left.push_back((y + 1) * stride + x + 1);
      base[left.back()] = 1;
    }
  }
  const std::array<std::ptrdiff_t, 8> neighbours = {-stride, -stride + 1, 1,  stride + 1,
                                                    stride,  stride - 1,  -1, -stride - 1};
  const auto bits_around = [&](std::ptrdiff_t at) {
    unsigned bits = 0;
    for (std::size_t k = 0; k < 8; ++k) bits |= static_cast<unsigned>(base[at + neighbours[k]]) << k;
    return bits;
  };
  for (bool changed = true; changed;) {
    changed = false;
    for (std::size_t half = 0; half < 2; ++half) {
      going.clear();
      for (const std::ptrdiff_t at : left) {
        if (kThinning.goes[half][bits_around(at)]) going.push_back(at);
      }
      for (const std::ptrdiff_t at : going) base[at] = 0;
      changed = changed || !going.empty();
      std::erase_if(left, [&](std::ptrdiff_t at) { return base[at] == 0; });
    }
  }
  mask.setTo(std::uint8_t{0});
  for (const std::ptrdiff_t at : left) {
    mask(static_cast<int>(at / stride) - 1, static_cast<int>(at % stride) - 1) = 255;
  }
}

std::vector<Keypoint> keypoints(const DisparityImage& disparity, const MaskImage& foreground,
                                const Calibration& calibration, const KeypointOptions& options) {
  std::vector<Keypoint> points;
  if (disparity.empty() || foreground.size() != disparity.size()) return points;
  cv::Mat1f magnitude;
  MaskImage contour;
  gradient_magnitude(disparity, magnitude);
  contours(magnitude, options, contour);
  MaskImage skeleton(foreground.size());
  std::transform(foreground.begin(), foreground.end(), contour.begin(), skeleton.begin(),
                 [](std::uint8_t f, std::uint8_t c) { return f != 0 && c == 0 ? std::uint8_t{255} : std::uint8_t{0}; });
  thin(skeleton);
  // Distance to the nearest contour pixel, and foreground pixels up to each corner.
  MaskImage free(contour.size());
  std::transform(contour.begin(), contour.end(), free.begin(),
                 [](std::uint8_t c) { return static_cast<std::uint8_t>(c == 0 ? 1 : 0); });
  cv::Mat1f distance;
  cv::distanceTransform(free, distance, cv::DIST_L2, 3);
  cv::Mat1i sums;
  cv::integral(foreground, sums, CV_32S);
  for (int y = 0; y < skeleton.rows; ++y) {
    for (int x = 0; x < skeleton.cols; ++x) {
      if (skeleton(y, x) == 0 || is_gap(disparity(y, x))) continue;
      const int radius = static_cast<int>(std::min(distance(y, x), 1e4F) * 0.7F);  // the square in the circle
      const int top = std::max(y - radius, 0), bottom = std::min(y + radius + 1, skeleton.rows);
      const int begin = std::max(x - radius, 0), end = std::min(x + radius + 1, skeleton.cols);
      const double inside = (sums(bottom, end) - sums(top, end) - sums(bottom, begin) + sums(top, begin)) / 255.0;
      const double outside = (bottom - top) * (end - begin) - inside;
      if (inside < static_cast<double>(options.least_foreground) * outside) continue;
      const double depth = metric_depth(static_cast<double>(disparity(y, x))) / 1000;
      const double right = (x - calibration.cx) / calibration.fx * depth;
      points.push_back({{x, y}, static_cast<float>(right), static_cast<float>(depth)});
    }
  }
  return points;
}

}  // namespace sherlog::rgbd
