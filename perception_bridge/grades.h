// From distances to grades in [0, 1]: how similar two looks are, how close two places.
#pragma once

#include <cmath>

#include "perception_bridge/four_tables.h"

namespace sherlog {

// Eq. 1 of the paper as printed, exp(-(x / 2 sigma)^2). The usual Gaussian has 2 sigma^2 for 4 sigma^2; but x is the difference
// of two measurements with sigma each, whose variance is 2 sigma^2.
inline double printed_g(double x, double sigma) {
  const double scaled = x / (2 * sigma);
  return std::exp(-scaled * scaled);
}
inline double gaussian_g(double x, double sigma) {
  const double scaled = x / sigma;
  return std::exp(-0.5 * scaled * scaled);
}

inline double color_distance(const Observation& a, const Observation& b) {
  double square = 0;
  for (std::size_t c = 0; c < a.color.size(); ++c) square += (a.color[c] - b.color[c]) * (a.color[c] - b.color[c]);
  return std::sqrt(square);
}

// In the room, where the tables stand in a row.
inline double position_distance(const Observation& a, const Observation& b, const FourTablesConfig& config) {
  const double apart =
      (static_cast<double>(a.table) - static_cast<double>(b.table)) * (config.table_width + config.table_gap);
  const double x = a.position[0] - b.position[0] + apart, y = a.position[1] - b.position[1];
  return std::sqrt(x * x + y * y);
}

}  // namespace sherlog
