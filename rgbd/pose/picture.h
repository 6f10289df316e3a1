// Many poses in one picture: a spanning tree of likeness, and an order of poses that puts alike ones side by side.
//
// Idea      A minimum spanning tree of 1 - correlation (a minimum tree of the correlation itself, as printed, joins
//           what is least alike) has each pose next to the one that is most like it. Walked in preorder from an end of
//           its longest path, children by weight, it is a sequence, and along a Hilbert curve that sequence fills a
//           square: 256 poses are 16 x 16 tiles, 4,096 are 64 x 64. The tree itself is drawn with its longest path as
//           a straight line and everything else as branches to both sides of it.
//           The graph is complete, so the 8.4 million edges of 4,096 poses are never stored: Prim's algorithm looks at
//           the edges of one pose after another, and those are one product of a matrix with a vector. Kruskal's on a
//           list of all edges gives the same tree, in five times the time and 300 MB.
// Source    pose paper, section III.C, Figs. 4 and 5; fractal nearest-neighbour paper, Fig. 7. Root and order of the
//           children are not given there.
// Cost      tree O(n^2) comparisons of poses and O(n) memory beside the descriptors; all else O(n log n)
#pragma once

#include <span>
#include <string>
#include <vector>

#include "rgbd/pose/descriptor.h"

namespace sherlog::rgbd {

struct PoseEdge {
  std::size_t a = 0, b = 0;  // a < b
  double weight = 0;         // 1 - correlation
};

// n - 1 edges, by weight, then by number.
std::vector<PoseEdge> spanning_tree(std::span<const PoseDescriptor> poses);

// Of a tree over poses 0 ... count - 1. The longest path by weight, from one end to the other; the first is the root.
std::vector<std::size_t> longest_path(std::size_t count, std::span<const PoseEdge> tree);
// Numbers of the poses in preorder.
std::vector<std::size_t> preorder(std::size_t count, std::span<const PoseEdge> tree);

// SVG pictures; a pose is a small grid of strokes, those of at least a quarter of its greatest number.
// Poses in this order along a Hilbert curve.
std::string pose_picture(std::span<const PoseDescriptor> poses, std::span<const std::size_t> order);
// The tree: its longest path from left to right, branches above and below. No two poses overlap, no two edges cross.
std::string tree_picture(std::span<const PoseDescriptor> poses, std::span<const PoseEdge> tree);

}  // namespace sherlog::rgbd
