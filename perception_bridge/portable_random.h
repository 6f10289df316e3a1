// Normal variates with the same bits on every machine: those of <random> and of libm are not.
//
// Source    Marsaglia & Bray's polar method, SIAM Review 6, 1964; the logarithm by its series in (m-1)/(m+1), where every
//           rounding is spelled out (std::fma is correctly rounded, and so is std::sqrt).
#pragma once

#include <cmath>
#include <cstdint>

#include "inference/rng.h"

namespace sherlog {

// Natural logarithm of x > 0, normal; within some units in the last place.
inline double portable_log(double x) {
  int exponent = 0;
  double m = std::frexp(x, &exponent);  // in [1/2, 1)
  if (m < 0.70710678118654752) {
    m *= 2;
    --exponent;
  }
  const double t = (m - 1) / (m + 1);  // at most 0.172 in size: t^24 is below 1e-18
  const double t2 = t * t;
  double sum = 0;
  for (int k = 23; k >= 1; k -= 2) sum = std::fma(sum, t2, 1.0 / k);
  return std::fma(static_cast<double>(exponent), 0.69314718055994531, 2 * t * sum);
}

class PortableRandom {
 public:
  PortableRandom(std::uint64_t seed, std::uint64_t stream) : rng_(seed, stream) {}

  double uniform() { return rng_.uniform(); }
  double uniform(double low, double high) { return std::fma(high - low, rng_.uniform(), low); }
  std::uint32_t below(std::uint32_t n) { return rng_.below(n); }
  double normal() {
    if (has_spare_) {
      has_spare_ = false;
      return spare_;
    }
    double u = 0, v = 0, square = 0;
    do {
      u = uniform(-1, 1);
      v = uniform(-1, 1);
      const double vv = v * v;
      square = std::fma(u, u, vv);
    } while (square >= 1 || square == 0);
    const double factor = std::sqrt(-2 * portable_log(square) / square);
    spare_ = v * factor;
    has_spare_ = true;
    return u * factor;
  }

 private:
  Rng rng_;
  double spare_ = 0;
  bool has_spare_ = false;
};

}  // namespace sherlog
