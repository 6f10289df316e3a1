#include "rgbd/frames/frame.h"

#include <fmt/format.h>

#include <cmath>

namespace sherlog::rgbd {

Calibration kinect_calibration(std::int32_t width, std::int32_t height) {
  // 57 degrees are 589 pixels at 640; Eq. 1 of the inpainting paper has 342087 = 8 x 75 mm x 570 pixels in it. Its
  // disparities are what the simulated sensor measures, so 570 it is.
  const double focal = 570.1 * width / 640.0;
  return {
      .width = width, .height = height, .fx = focal, .fy = focal, .cx = (width - 1) / 2.0, .cy = (height - 1) / 2.0};
}

std::string problem_of(const Calibration& c) {
  if (c.width < 1 || c.height < 1 || c.width > 16384 || c.height > 16384) {
    return fmt::format("an image of {} x {} pixels; each side has to be in 1 ... 16384", c.width, c.height);
  }
  constexpr double kMostSides = 100;  // a view of half a degree; and of 179
  for (const double focal : {c.fx, c.fy}) {
    if (!(focal > 0) || !std::isfinite(focal)) return fmt::format("focal length {}, which has to be positive", focal);
    if (focal > kMostSides * c.width || focal < c.width / kMostSides)
      return fmt::format("focal length {} for an image that is {} pixels wide", focal, c.width);
  }
  const auto outside = [](double centre, std::int32_t side) { return !(centre > -side && centre < 2.0 * side); };
  if (outside(c.cx, c.width) || outside(c.cy, c.height)) {
    return fmt::format("the optical axis at pixel {}, {} of an image of {} x {}", c.cx, c.cy, c.width, c.height);
  }
  if (!(c.units_per_metre > 0) || !std::isfinite(c.units_per_metre)) {
    return fmt::format("{} units per metre, which has to be positive", c.units_per_metre);
  }
  return {};
}

}  // namespace sherlog::rgbd
