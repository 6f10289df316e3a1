// What is believed of a weight before the data: a Gaussian, a Laplacian (L1), or nothing.
//
//   log P(w) = - (w - mean)^2 / (2 stdev^2) - l1 |w|     (without the constant)
#pragma once

#include <algorithm>
#include <cmath>

namespace sherlog {

struct Prior {
  double mean = 0.0;
  double stdev = 10.0;  // > 0; infinity: no Gaussian
  double l1 = 0.0;      // >= 0

  double precision() const { return std::isinf(stdev) ? 0.0 : 1.0 / (stdev * stdev); }
  // The smooth part.
  double log_density(double w) const { return -0.5 * precision() * (w - mean) * (w - mean); }
  // The weight of largest density; 0 where nothing is believed.
  double mode() const {
    if (precision() == 0.0) return 0.0;
    return std::copysign(std::max(0.0, std::abs(mean) - l1 * stdev * stdev), mean);
  }
  double slope(double w) const { return -precision() * (w - mean); }
};

}  // namespace sherlog
