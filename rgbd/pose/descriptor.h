// A pose as 324 numbers, comparison, retrieval, and an order of many poses.
//
// Idea      A grid of 9 x 9 cells over the box around a person's keypoints; in each cell a histogram of the direction
//           in which the skeleton's branch runs there, in four bins, smoothed a little over the cells. Place and size
//           fall out by the box; two descriptors are compared by their correlation. No graph is matched, no end point
//           is looked for. The direction at a keypoint is the main axis of its nearest keypoints along the Hilbert
//           curve. Poses in an order: a minimum spanning tree of 1 - correlation (a minimum tree of the correlation
//           itself, as printed, joins what is least alike), walked in preorder from an end of its longest path,
//           children by weight.
// Source    pose paper, section III.C and IV.B; fractal nearest-neighbour paper, Fig. 7
// Cost      description O(keypoints), comparison 324 multiplications, order O(n^2 log n)
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
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

struct PoseEdge {
  std::size_t a = 0, b = 0;
  double weight = 0;  // 1 - correlation
};
// n - 1 edges, by weight (Kruskal; ties by index).
std::vector<PoseEdge> spanning_tree(std::span<const PoseDescriptor> poses);
// Numbers of the poses in preorder.
std::vector<std::size_t> preorder(std::size_t count, std::span<const PoseEdge> tree);
// Poses in this order along a Hilbert curve, each a small grid of strokes, as an SVG picture.
std::string pose_picture(std::span<const PoseDescriptor> poses, std::span<const std::size_t> order);

}  // namespace sherlog::rgbd
