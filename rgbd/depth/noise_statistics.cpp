#include "rgbd/depth/noise_statistics.h"

#include <cmath>
#include <map>

namespace sherlog::rgbd {

bool NoiseStatistics::add(const DepthImage& depth) {
  if (frames_ == 0) {
    count_.create(depth.size());
    count_.setTo(0);
    for (cv::Mat1d* image : {&mean_, &squares_, &millimetres_}) {
      image->create(depth.size());
      image->setTo(0.0);
    }
  }
  if (count_.size() != depth.size()) return false;
  ++frames_;
  for (int y = 0; y < depth.rows; ++y) {
    for (int x = 0; x < depth.cols; ++x) {
      const std::uint16_t measured = depth(y, x);
      if (measured == 0) continue;
      const double value = in_steps_ ? normalised_disparity(measured) : measured;
      const double count = ++count_(y, x), difference = value - mean_(y, x);
      mean_(y, x) += difference / count;
      squares_(y, x) += difference * (value - mean_(y, x));
      millimetres_(y, x) += (measured - millimetres_(y, x)) / count;
    }
  }
  return true;
}

cv::Mat1d NoiseStatistics::mean() const {
  cv::Mat1d result(count_.size(), -1.0);
  for (int y = 0; y < result.rows; ++y) {
    for (int x = 0; x < result.cols; ++x) {
      if (2 * static_cast<std::size_t>(count_(y, x)) > frames_) result(y, x) = mean_(y, x);
    }
  }
  return result;
}

cv::Mat1d NoiseStatistics::deviation() const {
  cv::Mat1d result(count_.size(), -1.0);
  for (int y = 0; y < result.rows; ++y) {
    for (int x = 0; x < result.cols; ++x) {
      if (2 * static_cast<std::size_t>(count_(y, x)) > frames_) {
        result(y, x) = std::sqrt(squares_(y, x) / count_(y, x));
      }
    }
  }
  return result;
}

std::vector<NoiseStatistics::AtDepth> NoiseStatistics::by_depth(double stretch) const {
  std::map<std::int64_t, AtDepth> stretches;
  const cv::Mat1d deviations = deviation();
  for (int y = 0; y < deviations.rows; ++y) {
    for (int x = 0; x < deviations.cols; ++x) {
      if (deviations(y, x) < 0) continue;
      const double number = std::floor(millimetres_(y, x) / stretch);
      AtDepth& at = stretches[static_cast<std::int64_t>(number)];
      at.millimetres = (number + 0.5) * stretch;
      at.deviation += deviations(y, x);
      ++at.pixels;
    }
  }
  std::vector<AtDepth> result;
  for (auto& [number, at] : stretches) {
    at.deviation /= static_cast<double>(at.pixels);
    result.push_back(at);
  }
  return result;
}

}  // namespace sherlog::rgbd
