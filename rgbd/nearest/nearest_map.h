// All nearest neighbours: for every pixel of an image the keypoint that is nearest along the Hilbert curve.
//
// Idea      Nearest along a curve is simple: between two keypoints that follow each other on it, the first half of the cells
//           belongs to the one, the second half to the other. So the keypoints are sorted along the curve and each
//           writes its number into the pixels of its stretch, which lie together in the image as well.
//           Theorem 1 of the paper does the same by a forward and a backward pass over all indices; its "zero if there is no
//           preceding keypoint" has to read "none".
// Source    Stommel et al. 2013, theorem 1.
// Cost      O(pixels + n log n) to make, O(1) a query; memory of a number for each pixel
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "rgbd/nearest/hilbert_curve.h"

namespace sherlog::rgbd {

class NearestMap {
 public:
  // `map` is kept by reference.
  explicit NearestMap(const HilbertMap& map) : map_(map), nearest_(map.pixels.size()) {}

  // False, and nothing is changed: there is no keypoint, or one lies outside of the image. Of equal keypoints the first
  // counts; a pixel in the middle belongs to the keypoint that comes first on the curve.
  bool assign(std::span<const Pixel> keypoints);

  // Number of the keypoint, by pixel y * width + x. Requires an assign() that was true.
  std::span<const std::uint32_t> nearest() const { return nearest_; }
  std::uint32_t nearest(Pixel p) const {
    return nearest_[static_cast<std::size_t>(p.y) * static_cast<std::size_t>(map_.width) +
                    static_cast<std::size_t>(p.x)];
  }

 private:
  const HilbertMap& map_;
  std::vector<std::uint32_t> nearest_;
  std::vector<std::uint64_t> sorted_;  // index on the curve << 32 | number, kept for its memory
};

}  // namespace sherlog::rgbd
