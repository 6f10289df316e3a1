// A pose as 324 numbers, comparison, and retrieval.
//
// Idea      A grid of 9 x 9 cells over the box around a person's keypoints; in each cell a histogram of the direction
//           in which the skeleton's branch runs there, in four bins, smoothed a little over the cells. Place and size
//           fall out by the box; two descriptors are compared by their correlation. No graph is matched, no end point
//           is looked for. The direction at a keypoint is the main axis of its nearest keypoints along the Hilbert
//           curve.
// Source    pose paper, section III.C and IV.B
// Cost      description O(keypoints), comparison 324 multiplications
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <unordered_set>
#include <vector>

#include "rgbd/nearest/keypoint_queue.h"

namespace sherlog::rgbd {

inline constexpr std::size_t kPoseCells = 9, kPoseDirections = 4;
inline constexpr std::size_t kPoseLength = kPoseCells * kPoseCells * kPoseDirections;  // 324
// Cell by cell, rows from above; in a cell the bins of 0, 45, 90 and 135 degrees (counter-clockwise, 0 to the right).
using PoseDescriptor = std::array<float, kPoseLength>;

struct PoseOptions {
  double smoothing = 0.7;        // sigma of the Gaussian, cells; the paper says mild
  std::uint32_t neighbours = 6;  // keypoints that a direction is taken from
};

// Direction of the branch at each keypoint, radians in [0, pi). `map` is of the image's size. Nothing: there is no
// keypoint, or one lies outside.
std::optional<std::vector<float>> branch_directions(const HilbertMap& map, std::span<const Pixel> points,
                                                    std::uint32_t neighbours);
// Of points with directions. Nothing: fewer than two points, or as many directions as points are not given.
std::optional<PoseDescriptor> describe_pose(std::span<const Pixel> points, std::span<const float> directions,
                                            const PoseOptions& options = {});

// Normalised correlation, -1 ... 1; 0 where one of them is constant.
double correlation(const PoseDescriptor& a, const PoseDescriptor& b);
// 0 ... 100, 50 for no correlation, 75 for a good match.
inline double similarity(double correlation) { return 50 * (1 + correlation); }

struct PoseMatch {
  std::size_t pose = 0;
  double correlation = 0;
};

// Poses that were seen, each once.
class PoseLibrary {
 public:
  // False: a pose with the same CRC-32 of its descriptor is there.
  bool add(const PoseDescriptor& pose);
  std::size_t size() const { return poses_.size(); }
  const PoseDescriptor& operator[](std::size_t pose) const { return poses_[pose]; }
  // Best first; those below `least` are left out.
  std::vector<PoseMatch> find(const PoseDescriptor& pose, double least = 0.5) const;

 private:
  std::vector<PoseDescriptor> poses_;
  std::unordered_set<std::uint32_t> sums_;
};

}  // namespace sherlog::rgbd
