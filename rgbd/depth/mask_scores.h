// How well a mask says what is foreground, in pixels: summed over as many frames as one likes.
//
//   F = 2 hits / (2 hits + false alarms + misses),   overlap (intersection over union) = hits / (hits + false alarms + misses)
#pragma once

#include <opencv2/core.hpp>

#include "rgbd/frames/frame.h"

namespace sherlog::rgbd {

struct MaskScores {
  double hits = 0, false_alarms = 0, misses = 0, rejections = 0;

  void add(const MaskImage& said, const MaskImage& truth) {
    const double both = cv::countNonZero(said & truth);
    const double in_said = cv::countNonZero(said), in_truth = cv::countNonZero(truth);
    hits += both;
    false_alarms += in_said - both;
    misses += in_truth - both;
    rejections += static_cast<double>(truth.total()) - in_said - in_truth + both;
  }
  // Not a number where neither says that anything is there.
  double f_measure() const { return 2 * hits / (2 * hits + false_alarms + misses); }
  double overlap() const { return hits / (hits + false_alarms + misses); }
  double precision() const { return hits / (hits + false_alarms); }
  double recall() const { return hits / (hits + misses); }
  double accuracy() const { return (hits + rejections) / (hits + rejections + false_alarms + misses); }
};

}  // namespace sherlog::rgbd
