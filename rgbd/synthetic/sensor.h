// A Kinect's errors on a perfect view.
//
// Idea      The sensor measures disparity, so that is where noise and rounding belong: far surfaces become coarse by
//           themselves. Gaps come from where they come in the real one: surfaces that give nothing, what the projector
//           beside the camera does not reach (shadows), grazing rays, edges, range, and now and then nothing at all.
//           A pixel is in the shadow where another one to its right, nearer, is lit by the same ray of the projector:
//           going from the right to the left of a row, a pixel is lit where its place in the projector's image is
//           beyond all before.
// Source    facts: section I of the inpainting paper (baseline 7.5 cm, an eighth of a pixel, range, what gives no
//           depth). Rates are ours.
// Random    every pixel's draws come from (seed, frame, pixel) alone: the same on all machines, in any order
#pragma once

#include "rgbd/synthetic/scene.h"

namespace sherlog::rgbd {

struct SensorModel {
  double disparity_sigma = 0.5;  // steps of an eighth of a pixel
  double baseline = 0.075;       // metres, the projector to the right of the camera; 0: no shadows
  double nearest = 0.4;          // metres
  double farthest = 9.0;
  double least_facing = 0.08;  // cosine below which a surface gives nothing
  double edge_loss = 0.25;     // chance of a gap at a jump of depth
  double dropout = 0.002;      // chance of a gap anywhere
  double outliers = 0.0005;    // chance of a wrong disparity, up to 40 steps off
  double colour_sigma = 2.0;   // levels of 256
};

// None of it: depth rounded to a millimetre, gaps where nothing can be measured.
SensorModel perfect_sensor();

// Depth and colour as the sensor gives them; time and pose are left to the caller.
Frame measure(const View& view, const Calibration& calibration, const SensorModel& sensor, std::uint64_t seed,
              std::uint64_t frame);

}  // namespace sherlog::rgbd
