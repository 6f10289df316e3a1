// A background model of the papers that the depth paper compares with: histograms of quantised values in each pixel.
//
// Idea      What a pixel shows is quantised into a feature. Each pixel holds a list of features with weights that sum to
//           one: how often each was seen, the past fading out. A frame's feature is background with the probability
//           that its weight gives it in Bayes' formula; foreground is what has more than the threshold for not being.
//           The first frames only fill the histograms.
// Source    Godbehere, Matsukawa, Goldberg: Visual tracking of human visitors under variable-lighting conditions for a
//           responsive audio art installation, 2012. Its tracker and Kalman filters are left out. Weights are learned in
//           every pixel, foreground or not, as is usual; learning only where the background was seen is an option.
// Cost      O(features) a pixel and frame, most of the time a few
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "rgbd/frames/frame.h"

namespace sherlog::rgbd {

struct GmgOptions {
  std::size_t first_frames = 20;   // 120 in the paper: more than half of our sequences
  std::size_t most_features = 64;  // of a pixel; the least gives way
  float learning_rate = 0.025F;
  float background = 0.8F;  // prior
  float threshold = 0.8F;   // of the probability of foreground
  bool is_selective = false;
};

class Gmg {
 public:
  explicit Gmg(const GmgOptions& options = {}) : options_(options) {}

  // One feature for each pixel. Foreground is empty during the first frames.
  void next(const cv::Mat1i& features, MaskImage& foreground) {
    if (frames_ == 0) histograms_.resize(features.total());
    foreground.create(features.size());
    foreground.setTo(std::uint8_t{0});
    const bool is_learning = frames_ < options_.first_frames;
    // While learning all frames count the same.
    const float rate = is_learning ? 1.0F / static_cast<float>(frames_ + 1) : options_.learning_rate;
    std::size_t pixel = 0;
    for (int y = 0; y < features.rows; ++y) {
      for (int x = 0; x < features.cols; ++x) {
        std::vector<Feature>& histogram = histograms_[pixel++];
        const std::int32_t value = features(y, x);
        const auto found = std::ranges::find(histogram, value, &Feature::value);
        const float weight = found == histogram.end() ? 0 : found->weight;
        const float seen = weight * options_.background;
        const float is_background = seen / (seen + (1 - weight) * (1 - options_.background));
        const bool is_foreground = !is_learning && 1 - is_background > options_.threshold;
        if (is_foreground) foreground(y, x) = 255;
        if (!is_foreground || !options_.is_selective) learn(histogram, value, rate);
      }
    }
    ++frames_;
  }

 private:
  struct Feature {
    std::int32_t value;
    float weight;
  };

  void learn(std::vector<Feature>& histogram, std::int32_t value, float rate) const {
    for (Feature& feature : histogram) feature.weight *= 1 - rate;
    auto found = std::ranges::find(histogram, value, &Feature::value);
    if (found == histogram.end()) {
      if (histogram.size() < options_.most_features) {
        histogram.push_back({value, 0});
        found = histogram.end() - 1;
      } else {
        found = std::ranges::min_element(histogram, {}, &Feature::weight);
        *found = {value, 0};
      }
    }
    found->weight += rate;
  }

  GmgOptions options_;
  std::size_t frames_ = 0;
  std::vector<std::vector<Feature>> histograms_;
};

// 16 levels of each channel, as in the paper.
inline void colour_features(const ColourImage& colour, cv::Mat1i& features) {
  features.create(colour.size());
  std::transform(colour.begin(), colour.end(), features.begin(),
                 [](const cv::Vec3b& c) { return c[0] / 16 + 16 * (c[1] / 16) + 256 * (c[2] / 16); });
}

// So many steps of disparity each; a gap is a feature of its own.
inline void disparity_features(const cv::Mat1f& disparity, float steps, cv::Mat1i& features) {
  features.create(disparity.size());
  std::transform(disparity.begin(), disparity.end(), features.begin(),
                 [steps](float d) { return d < -1000 ? -1000 : static_cast<std::int32_t>(std::floor(d / steps)); });
}

}  // namespace sherlog::rgbd
