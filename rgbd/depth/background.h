// The background behind everything that moves, and what stands in front of it.
//
// Idea      People and things come and go; the wall behind them is the farthest that a pixel ever measures, again and
//           again. So the estimate follows a pixel only where it is not nearer than the estimate (less a hysteresis)
//           and is going away, and never by more than the hysteresis at once, so that an outlier does little. What
//           differs from it in depth, colour and the direction of the surface is foreground. All in normalised
//           disparity, where one threshold is right near and far. Gaps of a frame take the farther one of pyramid and
//           background: a window behind a person belongs to the room, not to the person.
// Source    inpainting paper, section III: Eqs. 2-6 and Alg. 3. Read as: both conditions (Eqs. 3 and 4) have to hold;
//           valid pixels are mapped as well as gaps; gaps are those of the measured image; the first frame is the first
//           estimate.
// Cost      O(1) time and 29 bytes of memory a pixel
#pragma once

#include <vector>

#include "rgbd/depth/disparity.h"
#include "rgbd/depth/pyramid_inpainting.h"
#include "rgbd/depth/sliding_bins.h"

namespace sherlog::rgbd {

struct BackgroundOptions {
  float tau = 0.2F;         // share of the old estimate in the new one (Eq. 2 as printed)
  float hysteresis = 5.0F;  // zeta, steps; the paper gives none. More than 1
  // Values in gaps are learned from only after so many frames of nothing but gap; 0 as printed. At the edge of a thing
  // that stands still a gap comes and goes, and what the pyramid puts there is as often what lies behind.
  std::uint8_t gap_patience = 5;
};

// Eq. 6. w = colour |dp| + depth |dd| + angle |dphi|, foreground where w > threshold.
struct ForegroundOptions {
  float colour = 1.0F;       // for each level of each of the three channels
  float depth = 1.0F;        // for each step
  float angle = 57.29578F;   // beta, for each radian: degrees
  float threshold = 200.0F;  // eta
  // Share of the depth's weight that counts where a pixel is farther than the background: 1 as printed. Nothing can be
  // there, it is the estimate that still has to follow.
  float farther = 1.0F;
  bool vote = false;  // vote_of_nine on what is above the threshold: not in the paper
};

// Eq. 6 as printed: colour, steps and degrees count the same.
inline ForegroundOptions printed_weights() { return {}; }
// For depth alone: 4 steps, eight times the noise. Colour and the direction of walls, which is noise, would only blur
// it.
inline ForegroundOptions depth_weights() {
  return {.colour = 0.0F, .depth = 50.0F, .angle = 0.0F, .threshold = 200.0F, .farther = 0.0F, .vote = true};
}

// Eq. 5, radians, by central differences, one-sided at the border; 0 for a plane that faces the camera. The polynomial
// for the arc tangent is right to 0.0003.
void gradient_direction(const DisparityImage& disparity, cv::Mat1f& direction);
void gradient_magnitude(const DisparityImage& disparity, cv::Mat1f& magnitude);  // steps a pixel

// Closes holes and removes specks of a mask: 255 where enough of the 3 x 3 pixels are. One that is itself needs two
// more, one that is not needs five. A gap of `measured` (empty: there is none) needs four: it has been taken for
// background, but a quarter of an outline's pixels are gaps, and beside a straight outline no more than three pixels are
// of the mask. Outside of the image there is nothing. Mask and result must not share pixels.
void vote_of_nine(const MaskImage& mask, const DepthImage& measured, MaskImage& result);

class BackgroundModel {
 public:
  explicit BackgroundModel(const BackgroundOptions& options = {}) : options_(options) {}

  // Eqs. 2-5 on a frame of disparities; starts anew where the size changes. Gaps change nothing. `measured` tells what
  // was not put into a gap (see gap_patience); empty: all.
  void update(const DisparityImage& disparity, const ColourImage& colour, const cv::Mat1f& direction,
              const DepthImage& measured = {});
  // Eq. 6 against the estimate. Before the first update: nothing is foreground. Gaps weigh nothing in depth and
  // direction.
  void weigh(const DisparityImage& disparity, const ColourImage& colour, const cv::Mat1f& direction,
             const ForegroundOptions& options, cv::Mat1f& weight) const;

  bool empty() const { return disparity_.empty(); }
  const DisparityImage& disparity() const { return disparity_; }  // the background's
  const cv::Mat3f& colour() const { return colour_; }
  float direction(int y, int x) const { return row_of_bins(y)[x].reference; }
  const BackgroundOptions& options() const { return options_; }

 private:
  void start(const DisparityImage& disparity, const ColourImage& colour, const cv::Mat1f& direction);
  std::size_t first_of_row(int y) const {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(disparity_.cols);
  }
  SlidingBins* row_of_bins(int y) { return bins_.data() + first_of_row(y); }
  const SlidingBins* row_of_bins(int y) const { return bins_.data() + first_of_row(y); }

  BackgroundOptions options_;
  DisparityImage disparity_, previous_;
  cv::Mat3f colour_;
  std::vector<SlidingBins> bins_;
  MaskImage gap_runs_;  // frames that a pixel has been a gap for
};

// What Alg. 3 makes of a frame.
struct PreprocessedDepth {
  DisparityImage disparity;  // without gaps, unless the sequence has begun with nothing but gaps
  cv::Mat1f direction;       // of its gradient
  cv::Mat1f weight;          // Eq. 6
  MaskImage foreground;      // weight above the threshold, by vote where asked for
};

// Alg. 3 with the segmentation: the whole chain, frame after frame. Keeps its memory.
class DepthPreprocessing {
 public:
  explicit DepthPreprocessing(const BackgroundOptions& background = {},
                              const ForegroundOptions& foreground = depth_weights(),
                              InpaintingFilter filter = InpaintingFilter::kMedian)
      : foreground_(foreground), inpainting_(filter), background_(background) {}

  // The result lives until the next call. Colour has the depth's size; of another one, or empty, it is all one.
  const PreprocessedDepth& next(const DepthImage& depth, const ColourImage& colour);
  const BackgroundModel& background() const { return background_; }
  const DepthImage& inpainted() const { return inpainted_; }  // Alg. 2 alone, millimetres

 private:
  ForegroundOptions foreground_;
  PyramidInpainting inpainting_;
  BackgroundModel background_;
  DepthImage inpainted_;
  ColourImage no_colour_;
  MaskImage above_;  // the threshold
  PreprocessedDepth result_;
};

}  // namespace sherlog::rgbd
