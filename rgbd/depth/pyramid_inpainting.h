// Filling gaps of a depth image from a pyramid of selective medians.
//
// Idea      A median of the valid ones among 3 x 3 pixels closes a small gap without a value that was not measured, so
//           no edge is blurred. For large gaps the image is smoothed and halved until one pixel is left; a gap takes
//           its value from the first level that has one at its place. Gaps in a level's pixel are left out (selective),
//           and it is a gap only where all its pixels are.
//           The window's median costs no branch: all nine are sorted by a network of minima and maxima with gaps as
//           zeros, which come first, and how many there are says where among the last five the middle is. The compiler
//           does that for eight pixels at a time.
// Source    inpainting paper, Alg. 1 (with the maximum norm: nine pixels as in its title) and Alg. 2; binomial and
//           diffusion are the variants of its section IV. The original image is the lowest level; the walk up the
//           levels for every gap is a walk down over all levels here, which gives the same values in O(pixels). The paper
//           ends at a row or column of pixels, over which a gap at its end would find nothing; we go on to a single one.
// Output    no gap, unless all of the image is one; without such, `depth` where it is valid
// Cost      O(pixels) time and memory
#pragma once

#include <vector>

#include "rgbd/frames/frame.h"

namespace sherlog::rgbd {

// Alg. 1: median of the valid depths among the 3 x 3 neighbours inside of the image; of an even number the nearer of
// the two in the middle. A gap where none is valid. The two must not share pixels.
void selective_median(const DepthImage& depth, DepthImage& smoothed);
// 50 %: median of the valid ones among 2 x 2 pixels, of an even number the nearer of the two in the middle. Sides are
// halved and rounded up.
void selective_halving(const DepthImage& depth, DepthImage& halved);

// The same with weighted means in place of medians, which make new values: 1 2 1 in each direction for smoothing.
void selective_binomial(const DepthImage& depth, DepthImage& smoothed);
void selective_mean_halving(const DepthImage& depth, DepthImage& halved);

enum class InpaintingFilter : std::uint8_t { kMedian, kBinomial };

// Keeps its memory from frame to frame.
class PyramidInpainting {
 public:
  explicit PyramidInpainting(InpaintingFilter filter = InpaintingFilter::kMedian) : filter_(filter) {}
  // Alg. 2. The image itself may be the result.
  void apply(const DepthImage& depth, DepthImage& filled);
  // Of the last image, the image itself first.
  const std::vector<DepthImage>& levels() const { return levels_; }

 private:
  InpaintingFilter filter_;
  std::vector<DepthImage> levels_, filled_;
  DepthImage smoothed_;
};

// The variant that only goes on from one side: row by row from below, left to right, a gap becomes the mean of those of
// its left, lower and lower left neighbours that have a value by then. Gaps at the lower left corner stay.
void inpaint_by_diffusion(const DepthImage& depth, DepthImage& filled);

}  // namespace sherlog::rgbd
