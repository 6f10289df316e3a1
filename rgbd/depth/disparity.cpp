#include "rgbd/depth/disparity.h"

#include <cmath>
#include <vector>

namespace sherlog::rgbd {
namespace {

// Eq. 1 of every depth.
const std::vector<float>& table() {
  static const std::vector<float> values = [] {
    std::vector<float> t(65536, kNoDisparity);
    for (std::size_t millimetres = 1; millimetres < t.size(); ++millimetres) {
      t[millimetres] = static_cast<float>(normalised_disparity(static_cast<double>(millimetres)));
    }
    return t;
  }();
  return values;
}

}  // namespace

double metric_depth(double index) {
  // a3 d^2 + a4 d = a2 / (a1 - index), the smaller root written so that nothing cancels.
  const double c = kA2 / (kA1 - index);
  return 2 * c / (kA4 + std::sqrt(kA4 * kA4 + 4 * kA3 * c));
}

void to_disparity(const DepthImage& depth, DisparityImage& disparity) {
  disparity.create(depth.size());
  const float* values = table().data();
  for (int y = 0; y < depth.rows; ++y) {
    const std::uint16_t* in = depth[y];
    float* out = disparity[y];
    for (int x = 0; x < depth.cols; ++x) out[x] = values[in[x]];
  }
}

void to_depth(const DisparityImage& disparity, DepthImage& depth) {
  depth.create(disparity.size());
  // Without a3, which is 1e-9 of a4: exact to far less than a millimetre, and no square root.
  constexpr float kScale = static_cast<float>(kA2 / kA4), kTop = static_cast<float>(kA1);
  for (int y = 0; y < disparity.rows; ++y) {
    const float* in = disparity[y];
    std::uint16_t* out = depth[y];
    for (int x = 0; x < disparity.cols; ++x) {
      const float rest = kTop - in[x];
      const float millimetres = kScale / rest + 0.5F;
      const bool valid = in[x] > kNoDisparity / 2 && rest > 0.0F && millimetres < 65535.5F;
      out[x] = static_cast<std::uint16_t>(valid ? static_cast<std::int32_t>(millimetres) : 0);
    }
  }
}

}  // namespace sherlog::rgbd
