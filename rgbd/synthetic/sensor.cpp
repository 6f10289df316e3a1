#include "rgbd/synthetic/sensor.h"

#include <cmath>
#include <limits>

#include "rgbd/depth/disparity.h"

namespace sherlog::rgbd {
namespace {

std::uint64_t mix(std::uint64_t z) {  // the finaliser of SplitMix64
  z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9U;
  z = (z ^ (z >> 27)) * 0x94D049BB133111EBU;
  return z ^ (z >> 31);
}

// Draws of one pixel.
class Draws {
 public:
  explicit Draws(std::uint64_t state) : state_(state) {}
  std::uint64_t bits() { return mix(state_ += 0x9E3779B97F4A7C15U); }
  double uniform() { return static_cast<double>(bits() >> 11) * 0x1p-53; }
  // Standard normal, nearly: the sum of four uniform numbers of 16 bits, whose variance is 4 / 12.
  double normal() {
    const std::uint64_t b = bits();
    const double sum = static_cast<double>((b & 0xFFFF) + (b >> 16 & 0xFFFF) + (b >> 32 & 0xFFFF) + (b >> 48));
    return (sum / 65536.0 - 2.0) * std::sqrt(3.0);
  }

 private:
  std::uint64_t state_;
};

// 255 where the projector's light reaches what the camera sees.
cv::Mat1b lit_by_projector(const View& view, const Calibration& c, double baseline) {
  cv::Mat1b lit(view.depth.size(), std::uint8_t{255});
  if (baseline <= 0) return lit;
  for (int y = 0; y < lit.rows; ++y) {
    double frontier = std::numeric_limits<double>::infinity();
    for (int x = lit.cols - 1; x >= 0; --x) {
      const double depth = static_cast<double>(view.depth(y, x));
      if (depth <= 0) continue;
      const double place = x - c.fx * baseline / depth;
      if (place > frontier + 0.5) {
        lit(y, x) = 0;
      } else {
        frontier = std::min(frontier, place);
      }
    }
  }
  return lit;
}

bool at_jump(const cv::Mat1f& index, int y, int x) {
  constexpr float kJump = 10;  // steps
  const auto differs = [&](int v, int u) {
    return v >= 0 && u >= 0 && v < index.rows && u < index.cols && std::abs(index(v, u) - index(y, x)) > kJump;
  };
  return differs(y, x - 1) || differs(y, x + 1) || differs(y - 1, x) || differs(y + 1, x);
}

}  // namespace

SensorModel perfect_sensor() {
  return {.disparity_sigma = 0,
          .baseline = 0,
          .nearest = 0,
          .farthest = 60,
          .least_facing = 0,
          .edge_loss = 0,
          .dropout = 0,
          .outliers = 0,
          .colour_sigma = 0};
}

Frame measure(const View& view, const Calibration& c, const SensorModel& sensor, std::uint64_t seed,
              std::uint64_t frame_number) {
  Frame frame{.time = 0, .depth = DepthImage(c.size(), std::uint16_t{0}), .colour = view.colour.clone(), .pose = {}};
  const bool exact = sensor.disparity_sigma == 0 && sensor.outliers == 0;
  const cv::Mat1b lit = lit_by_projector(view, c, sensor.baseline);
  cv::Mat1f index(c.size(), kNoDisparity);
  for (int y = 0; y < index.rows; ++y) {
    for (int x = 0; x < index.cols; ++x) {
      const double metres = static_cast<double>(view.depth(y, x));
      if (metres > 0) index(y, x) = static_cast<float>(normalised_disparity(metres * 1000));
    }
  }
  const std::uint64_t key = mix(mix(seed + 0x9E3779B97F4A7C15U) ^ frame_number);
  for (int y = 0; y < index.rows; ++y) {
    for (int x = 0; x < index.cols; ++x) {
      Draws draws(key ^ mix(static_cast<std::uint64_t>(y) * 65536 + static_cast<std::uint64_t>(x) + 1));
      if (sensor.colour_sigma > 0) {
        for (int k = 0; k < 3; ++k) {
          std::uint8_t& value = frame.colour(y, x)[k];
          value = cv::saturate_cast<std::uint8_t>(value + sensor.colour_sigma * draws.normal());
        }
      }
      const double metres = static_cast<double>(view.depth(y, x));
      const bool reached = metres >= sensor.nearest && metres <= sensor.farthest && metres > 0 &&
                           view.measurable(y, x) != 0 && lit(y, x) != 0 &&
                           static_cast<double>(view.facing(y, x)) >= sensor.least_facing;
      if (!reached || draws.uniform() < sensor.dropout) continue;
      if (sensor.edge_loss > 0 && at_jump(index, y, x) && draws.uniform() < sensor.edge_loss) continue;
      double millimetres = metres * 1000;
      if (!exact) {
        double measured = static_cast<double>(index(y, x)) + sensor.disparity_sigma * draws.normal();
        if (draws.uniform() < sensor.outliers) measured += 80 * draws.uniform() - 40;
        millimetres = metric_depth(std::min(std::round(measured), kA1 - 6));  // 6 steps from infinity: 57 m
      }
      const double rounded = std::round(millimetres);
      if (rounded >= 1 && rounded <= 65535) frame.depth(y, x) = static_cast<std::uint16_t>(rounded);
    }
  }
  return frame;
}

}  // namespace sherlog::rgbd
