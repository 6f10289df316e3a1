// From a depth frame to a thousand points on the middle of limbs and bodies.
//
// Idea      In normalised disparity people stand out by a jump that is the same near and far, so a threshold on the
//           gradient gives contours. What lies between contours and is foreground is thinned to lines a pixel wide:
//           they run along the middle of arms, legs and trunks, and where one person hides another the contour between
//           them keeps their lines apart.
// Source    Stommel, Beetz, Xu: Model-free detection, encoding, retrieval and visualisation of human poses from Kinect
//           data, section III.A. Thinning: Guo and Hall, Comm. ACM 32, 1989. We thin the foreground's pixels only:
//           those of the background would be thrown away by the pruning.
// Cost      O(pixels) and, for thinning, O(foreground pixels x radius of the thickest part)
#pragma once

#include <vector>

#include "rgbd/depth/disparity.h"
#include "rgbd/nearest/hilbert_curve.h"

namespace sherlog::rgbd {

struct KeypointOptions {
  float contour = 4.0F;             // steps a pixel of gradient; the paper gives none
  std::int32_t least_contour = 10;  // pixels of a connected component that stays
  float least_foreground = 0.2F;    // nearby foreground to nearby background pixels
};

// 255 where the gradient's magnitude is above the threshold, without components (of eight neighbours) of fewer pixels.
void contours(const cv::Mat1f& gradient_magnitude, const KeypointOptions& options, MaskImage& contour);
void remove_small_components(MaskImage& mask, std::int32_t least_pixels);
// Thins to lines a pixel wide; every component (of eight neighbours) stays one. The border of the image counts as
// outside.
void thin(MaskImage& mask);

struct Keypoint {
  Pixel pixel;
  float x = 0, depth = 0;  // metres: to the right of the axis, and along it
};

// Points of the skeleton, rows from above. Dropped: where foreground is less than a fifth of the background among the
// pixels that are nearer than the nearest contour pixel (counted in a square), and where there is no depth.
std::vector<Keypoint> keypoints(const DisparityImage& disparity, const MaskImage& foreground,
                                const Calibration& calibration, const KeypointOptions& options = {});

}  // namespace sherlog::rgbd
