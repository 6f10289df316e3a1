#include "rgbd/objects/looks.h"

#include <algorithm>
#include <opencv2/imgproc.hpp>

namespace sherlog::rgbd {
namespace {

constexpr int kLeastValue = 60, kLeastSaturation = 60, kWhite = 120;

// `hsv`: hue in half degrees, as OpenCV has it.
std::size_t name_index(const cv::Vec3b& hsv) {
  if (hsv[2] <= kLeastValue) return 8;
  if (hsv[1] < kLeastSaturation) return hsv[2] > kWhite ? 6 : 7;
  return static_cast<std::size_t>((hsv[0] + 15) % 180 / 30);
}

// Of the pixels of the thing, one row.
cv::Mat3b hsv_of(const ColourImage& colour, const Hypothesis& thing) {
  std::vector<cv::Vec3b> pixels;
  for (int y = 0; y < thing.roi.height; ++y) {
    for (int x = 0; x < thing.roi.width; ++x) {
      if (thing.mask(y, x) != 0) pixels.push_back(colour(y + thing.roi.y, x + thing.roi.x));
    }
  }
  cv::Mat3b hsv;
  if (!pixels.empty())
    cv::cvtColor(cv::Mat3b(1, static_cast<int>(pixels.size()), pixels.data()), hsv, cv::COLOR_BGR2HSV);
  return hsv;
}

}  // namespace

std::string colour_name(const cv::Vec3b& bgr) {
  cv::Mat3b pixel(1, 1, bgr);
  cv::cvtColor(pixel, pixel, cv::COLOR_BGR2HSV);
  return kColours[name_index(pixel(0, 0))];
}

std::vector<ColourName> colour_names(const ColourImage& colour, const Hypothesis& thing) {
  const cv::Mat3b hsv = hsv_of(colour, thing);
  std::array<double, kColours.size()> counts{};
  for (const cv::Vec3b& pixel : hsv) counts[name_index(pixel)] += 1;
  std::vector<ColourName> names;
  for (std::size_t i = 0; i < kColours.size(); ++i) {
    if (counts[i] > 0) names.push_back({kColours[i], counts[i] / static_cast<double>(hsv.total())});
  }
  std::ranges::stable_sort(names, std::greater<>{}, &ColourName::share);
  return names;
}

std::vector<double> colour_histogram(const ColourImage& colour, const Hypothesis& thing) {
  std::vector<double> counts(256, 0.0);
  for (const cv::Vec3b& pixel : hsv_of(colour, thing)) {
    const auto hue = static_cast<std::size_t>(std::min(15, pixel[0] * 16 / 180));
    const std::size_t saturation = pixel[1] / 16U;
    counts[hue * 16 + saturation] += 1;
  }
  return counts;
}

std::array<double, 3> mean_colour(const ColourImage& colour, const Hypothesis& thing) {
  const cv::Scalar mean = cv::mean(colour(thing.roi), thing.mask);
  return {mean[2] / 255, mean[1] / 255, mean[0] / 255};
}

}  // namespace sherlog::rgbd
