// Mode of a stream of angles by three sliding bins.
//
// Idea      A histogram of three bins a third of a turn apart, which slides: where values fall to the reference bin, it
//           moves toward them and the others with it. A place and four counts: a mixture of three kinds of angles in
//           constant memory.
//           As printed nothing lets the reference go where it started too far from the mode; here the bin that has
//           overtaken it becomes the reference, and starts anew with the value that did it. Counts are halved when one
//           reaches 255, so the estimate can follow a change and fits bytes.
//           As printed the reference is the mean of its bin, which any other kind of angle within 60 degrees of the
//           mode pulls away: with 70, 20 and 10 % at three random angles it is more than 5 degrees off in 30 % of all
//           cases. Here it is the median: value number n moves it by at most 60 degrees / n. What has more than half of
//           the values has the median, wherever the rest is.
// Holds     after 200 values of a mixture of 70, 20 and 10 % at any three angles, from any start, the reference is
//           within 5 degrees of the first: always but for 1 in 10,000 cases with angles that are exact to a degree, and
//           for 1 in 4,000 with 3 degrees of noise; with 60 % for 1 in 150. Where no kind has more than half of the
//           values nothing is promised: two others that share a bin outweigh it.
// Source    inpainting paper, section II.C; erratum: "2 pi / 3s" is 2 pi / 3
// Cost      O(1) a value
#pragma once

#include <algorithm>
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
  std::uint8_t moves = 0;                // values that the reference has been moved by, 255 and more

  // `angle` in -pi ... pi.
  void add(float angle) {
    constexpr float kThird = 2 * std::numbers::pi_v<float> / 3;
    const float difference = wrapped(angle - reference);
    const std::size_t bin = std::abs(difference) <= kThird / 2 ? 0U : difference > 0 ? 1U : 2U;
    if (++counts[bin] == 255) {
      for (std::uint8_t& count : counts) count = static_cast<std::uint8_t>(count / 2);
    }
    if (bin == 0) {
      if (moves < 255) ++moves;
      const float most = kThird / 2 / static_cast<float>(moves);
      reference = wrapped(reference + std::clamp(difference, -most, most));
    } else if (counts[bin] > counts[0]) {
      // The bin's neighbours are, in its sense of turning, the third bin and the old reference.
      reference = angle;
      counts = bin == 1 ? std::array{counts[1], counts[2], counts[0]} : std::array{counts[2], counts[0], counts[1]};
      moves = 1;
    }
  }
};

static_assert(sizeof(SlidingBins) == 8);

}  // namespace sherlog::rgbd
