// Normalised disparity: depth in the sensor's own steps, where noise is the same near and far.
//
// Idea      The sensor measures disparity in eighths of a pixel and gives out millimetres. A step is 0.7 mm at half a
//           metre and 7 cm at five, so no threshold in millimetres is right everywhere. The map back to the number of
//           the step makes one threshold do; as depth has 16 bits, it is a table.
// Source    Stommel, Beetz, Xu: Inpainting of missing values in the Kinect sensor's depth maps based on background
//           estimates, 2013, Eq. 1. a2 / a4 is 8 sub-pixels x 75 mm x 570.1 pixels: depth is in
//           millimetres, and the index grows with depth although the paper calls it a disparity. a3 shifts all indices
//           by -0.0007 and is kept.
// Cost      O(1) a pixel
#pragma once

#include <opencv2/core.hpp>

#include "rgbd/frames/frame.h"

namespace sherlog::rgbd {

using DisparityImage = cv::Mat1f;  // index of the step, not rounded; kNoDisparity = gap

inline constexpr double kA1 = 828.6404, kA2 = 3.1992e5, kA3 = -1.93115e-9, kA4 = 0.9352;
// Nearer than anything, so that max() prefers everything else. Finite: differences of gaps stay numbers.
inline constexpr float kNoDisparity = -1e6F;
inline bool is_gap(float disparity) { return disparity <= kNoDisparity / 2; }

// Eq. 1. Requires millimetres > 0. Zero at 412.8 mm, negative below, less than kA1.
constexpr double normalised_disparity(double millimetres) {
  return kA1 - kA2 / (kA3 * millimetres * millimetres + kA4 * millimetres);
}
// The inverse. Requires index < kA1.
double metric_depth(double index);
// Millimetres from one step to the next, at a depth.
inline double disparity_step(double millimetres) {
  return metric_depth(normalised_disparity(millimetres) + 1) - millimetres;
}

// Of every depth by the table, and back, to the nearest millimetre; gaps stay gaps, what does not fit 16 bits becomes
// one. The result is made where it has another size.
void to_disparity(const DepthImage& depth, DisparityImage& disparity);
void to_depth(const DisparityImage& disparity, DepthImage& depth);

}  // namespace sherlog::rgbd
