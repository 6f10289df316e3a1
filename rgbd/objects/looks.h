// The colours of a thing: names with their shares, a histogram, a mean.
//
// Source    defaults of RoboSherlock's colour annotator: hue names where value and saturation are above 60 of 255,
//           else black up to a value of 60, white above 120, grey between; a histogram of 16 hues by 16 saturations;
//           shares above 0.2 are reported
// Cost      O(pixels of the thing)
#pragma once

#include <array>
#include <string>
#include <vector>

#include "rgbd/objects/hypotheses.h"

namespace sherlog::rgbd {

inline constexpr double kReportedShare = 0.2;

inline constexpr std::array kColours = {"red", "yellow", "green", "cyan", "blue", "magenta", "white", "grey", "black"};

struct ColourName {
  std::string name;  // one of kColours
  double share = 0;
};

std::string colour_name(const cv::Vec3b& bgr);
// All that occur, the largest share first.
std::vector<ColourName> colour_names(const ColourImage& colour, const Hypothesis& thing);
// Row by row: hue, then saturation.
std::vector<double> colour_histogram(const ColourImage& colour, const Hypothesis& thing);
// Red, green, blue in [0, 1].
std::array<double, 3> mean_colour(const ColourImage& colour, const Hypothesis& thing);

}  // namespace sherlog::rgbd
