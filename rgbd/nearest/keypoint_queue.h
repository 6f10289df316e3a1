// The k keypoints that are nearest to a pixel along the Hilbert curve.
//
// Idea      The keypoints stand in the order of the curve; a van Emde Boas set finds the first one at or behind the query's
//           place. From there its predecessors and successors are merged outwards by their distance on the curve, so that any
//           k, odd or even, near an end or not, gives the k nearest (of equal distance, the one before).
// Source    Stommel et al. 2013, theorem 2; merging outwards in place of (k - 1) / 2 to each side is ours.
// Cost      O(n log n) to make (sorting; n log log C without), O(log log C + k) a query; C numbers of memory
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "rgbd/nearest/hilbert_curve.h"
#include "rgbd/nearest/van_emde_boas.h"

namespace sherlog::rgbd {

class KeypointQueue {
 public:
  // `map` is kept by reference.
  explicit KeypointQueue(const HilbertMap& map);

  // False, and nothing is changed: a keypoint lies outside of the image.
  bool assign(std::span<const Pixel> keypoints);

  // Numbers of the min(k, n) nearest keypoints, nearest first, appended to `found`.
  // Requires that the image contains q.
  void nearest(Pixel q, std::size_t k, std::vector<std::uint32_t>& found) const;

 private:
  const HilbertMap& map_;
  VanEmdeBoasSet occupied_;
  std::vector<std::uint32_t> first_;   // by index on the curve: position of its first keypoint, where occupied
  std::vector<std::uint64_t> sorted_;  // index on the curve << 32 | number
};

// The direction of the line that the k nearest keypoints of each keypoint lie along, itself included: radians in (-pi/2, pi/2].
// Keypoints whose neighbours have no direction (one of them, or all in one place) get 0. Requires the queue to hold them.
std::vector<double> local_directions(const KeypointQueue& queue, std::span<const Pixel> keypoints, std::size_t k);

}  // namespace sherlog::rgbd
