// How much a sensor's depth varies from frame to frame: of recorded or simulated frames of a scene where nothing moves.
//
// Source    inpainting paper, section II.A and Figs. 1 and 2: pixels that are valid in more than half of the frames,
//           mean and standard deviation of each, and the deviation by depth
// Cost      O(pixels) a frame, 20 bytes a pixel
#pragma once

#include <vector>

#include "rgbd/depth/disparity.h"

namespace sherlog::rgbd {

class NoiseStatistics {
 public:
  // In millimetres, or in steps of normalised disparity.
  explicit NoiseStatistics(bool in_steps) : in_steps_(in_steps) {}

  // False: of another size than the frames before.
  bool add(const DepthImage& depth);
  std::size_t frames() const { return frames_; }

  // Of pixels that were valid in more than half of the frames; -1 elsewhere.
  cv::Mat1d mean() const;
  cv::Mat1d deviation() const;

  // Mean deviation of the pixels whose mean depth is in each stretch of so many millimetres.
  struct AtDepth {
    double millimetres = 0;  // middle of the stretch
    double deviation = 0;
    std::size_t pixels = 0;
  };
  std::vector<AtDepth> by_depth(double stretch) const;

 private:
  bool in_steps_;
  std::size_t frames_ = 0;
  cv::Mat1i count_;
  cv::Mat1d mean_, squares_, millimetres_;  // running mean and sum of squared differences from it (Welford)
};

}  // namespace sherlog::rgbd
