// Mode of a stream of angles by three sliding bins.
//
// Idea      A histogram of three bins a third of a turn apart, which slides: where values fall to the reference bin, it
//           moves to their mean and the others with it. A place and four counts: a mixture
//           of three kinds of angles in constant memory.
//           As printed nothing lets the reference go where it started too far from the mode; here the bin that has
//           overtaken it becomes the reference, and its mean starts anew with the value that did it. Means are
//           circular: by the difference to the mean, in -pi ... pi. Counts are halved when one reaches 255, so the
//           estimate can follow a change and fits bytes.
// Source    inpainting paper, section II.C; erratum: "2 pi / 3s" is 2 pi / 3
// Cost      O(1) a value
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>

namespace sherlog::rgbd {

// An angle in -3 pi ... 3 pi to -pi ... pi.
inline float wrapped(float angle) {
  constexpr float kPi = std::numbers::pi_v<float>;
  angle = angle > kPi ? angle - 2 * kPi : angle;
  return angle < -kPi ? angle + 2 * kPi : angle;
}

// Eight bytes.
struct SlidingBins {
  float reference = 0;                   // radians, -pi ... pi: the mode
  std::array<std::uint8_t, 3> counts{};  // of the reference, of it + 2 pi / 3, of it - 2 pi / 3
  std::uint8_t mean_count = 0;           // values that the reference is the mean of

  // `angle` in -pi ... pi.
  void add(float angle) {
    constexpr float kThird = 2 * std::numbers::pi_v<float> / 3;
    const float difference = wrapped(angle - reference);
    const std::size_t bin = std::abs(difference) <= kThird / 2 ? 0U : difference > 0 ? 1U : 2U;
    if (++counts[bin] == 255) {
      for (std::uint8_t& count : counts) count = static_cast<std::uint8_t>(count / 2);
    }
    if (bin == 0) {
      if (mean_count < 64) ++mean_count;  // later ones count 1/64: a running mean
      reference = wrapped(reference + difference / static_cast<float>(mean_count));
    } else if (counts[bin] > counts[0]) {
      // The bin's neighbours are, in its sense of turning, the third bin and the old reference.
      reference = angle;
      counts = bin == 1 ? std::array{counts[1], counts[2], counts[0]} : std::array{counts[2], counts[0], counts[1]};
      mean_count = 1;
    }
  }
};

static_assert(sizeof(SlidingBins) == 8);

}  // namespace sherlog::rgbd
