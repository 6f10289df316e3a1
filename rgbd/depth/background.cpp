#include "rgbd/depth/background.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace sherlog::rgbd {
namespace {

// atan2 without a branch: the quotient of the smaller by the larger, an odd polynomial, and the octant.
inline float arc_tangent(float y, float x) {
  constexpr float kPi = std::numbers::pi_v<float>;
  const float ax = std::abs(x), ay = std::abs(y);
  const float large = std::max(ax, ay), small = std::min(ax, ay);
  const float q = small / (large + 1e-30F), s = q * q;
  // Abramowitz and Stegun 4.4.47, error at most 1e-5.
  float angle = q * (0.9998660F + s * (-0.3302995F + s * (0.1801410F + s * (-0.0851330F + s * 0.0208351F))));
  angle = ay > ax ? kPi / 2 - angle : angle;
  angle = x < 0 ? kPi - angle : angle;
  return y < 0 ? -angle : angle;
}

// Calls pixel(dx, dy, out) with the differences of every pixel of the row, halved where they are of two steps.
template <class Pixel>
void over_gradients(const DisparityImage& d, cv::Mat1f& result, Pixel pixel) {
  result.create(d.size());
  for (int y = 0; y < d.rows; ++y) {
    const int upper = std::max(y - 1, 0), lower = std::min(y + 1, d.rows - 1);
    const float *above = d[upper], *here = d[y], *below = d[lower];
    const float vertical = lower - upper == 2 ? 0.5F : 1.0F;
    float* __restrict out = result[y];
    const auto at_border = [&](int x) {
      const int left = std::max(x - 1, 0), right = std::min(x + 1, d.cols - 1);
      const float dx = (here[right] - here[left]) * (right - left == 2 ? 0.5F : 1.0F);
      out[x] = pixel(dx, (below[x] - above[x]) * vertical);
    };
    at_border(0);
    for (int x = 1; x + 1 < d.cols; ++x) {
      out[x] = pixel((here[x + 1] - here[x - 1]) * 0.5F, (below[x] - above[x]) * vertical);
    }
    at_border(d.cols - 1);
  }
}

}  // namespace

void gradient_direction(const DisparityImage& disparity, cv::Mat1f& direction) {
  if (disparity.empty()) return direction.release();
  over_gradients(disparity, direction, [](float dx, float dy) { return arc_tangent(dy, dx); });
}

void gradient_magnitude(const DisparityImage& disparity, cv::Mat1f& magnitude) {
  if (disparity.empty()) return magnitude.release();
  over_gradients(disparity, magnitude, [](float dx, float dy) { return std::sqrt(dx * dx + dy * dy); });
}

void vote_of_nine(const MaskImage& mask, const DepthImage& measured, MaskImage& result) {
  result.create(mask.size());
  const int width = mask.cols;
  std::vector<std::uint8_t> column(static_cast<std::size_t>(width) + 2, std::uint8_t{0});  // one to either side
  std::vector<std::uint8_t> needed(static_cast<std::size_t>(width));
  for (int y = 0; y < mask.rows; ++y) {
    const std::uint8_t* here = mask[y];
    const std::uint8_t *above = y > 0 ? mask[y - 1] : nullptr, *below = y + 1 < mask.rows ? mask[y + 1] : nullptr;
    std::uint8_t* sum = column.data() + 1;
    for (int x = 0; x < width; ++x) sum[x] = here[x] & 1;
    for (const std::uint8_t* row : {above, below}) {
      if (row == nullptr) continue;
      for (int x = 0; x < width; ++x) sum[x] = static_cast<std::uint8_t>(sum[x] + (row[x] & 1));
    }
    std::uint8_t* __restrict votes = needed.data();
    for (int x = 0; x < width; ++x) votes[x] = static_cast<std::uint8_t>(5 - 2 * (here[x] & 1));
    if (!measured.empty()) {
      const std::uint16_t* depth = measured[y];
      for (int x = 0; x < width; ++x) {
        const auto is_gap_outside = static_cast<std::uint8_t>((depth[x] == 0 ? 1 : 0) & ~here[x]);
        votes[x] = static_cast<std::uint8_t>(votes[x] - is_gap_outside);
      }
    }
    std::uint8_t* __restrict out = result[y];
    for (int x = 0; x < width; ++x) out[x] = sum[x - 1] + sum[x] + sum[x + 1] >= votes[x] ? 255 : 0;
  }
}

void BackgroundModel::start(const DisparityImage& disparity, const ColourImage& colour, const cv::Mat1f& direction) {
  disparity.copyTo(disparity_);
  disparity.copyTo(previous_);
  colour.convertTo(colour_, CV_32F);
  bins_.assign(disparity.total(), SlidingBins{});
  gap_runs_.create(disparity.size());
  gap_runs_.setTo(std::uint8_t{0});
  for (int y = 0; y < disparity.rows; ++y) {
    for (int x = 0; x < disparity.cols; ++x) {
      if (!is_gap(disparity(y, x))) row_of_bins(y)[x].add(direction(y, x));
    }
  }
}

void BackgroundModel::update(const DisparityImage& disparity, const ColourImage& colour, const cv::Mat1f& direction,
                             const DepthImage& measured) {
  if (disparity_.size() != disparity.size()) return start(disparity, colour, direction);
  const float zeta = options_.hysteresis, tau = options_.tau;
  const std::uint8_t patience = options_.gap_patience;
  for (int y = 0; y < disparity.rows; ++y) {
    const float *now = disparity[y], *angle = direction[y];
    const cv::Vec3b* seen = colour[y];
    float *before = previous_[y], *estimate = disparity_[y];
    cv::Vec3f* shade = colour_[y];
    std::uint8_t* runs = gap_runs_[y];
    SlidingBins* bins = row_of_bins(y);
    const std::uint16_t* depth = measured.empty() ? nullptr : measured[y];
    for (int x = 0; x < disparity.cols; ++x) {
      const float d = now[x], old = estimate[x], last = before[x];
      if (depth != nullptr) {
        runs[x] = depth[x] != 0 ? std::uint8_t{0} : static_cast<std::uint8_t>(std::min(runs[x] + 1, 255));
        if (depth[x] == 0 && runs[x] <= patience && patience > 0) continue;
      }
      if (is_gap(d)) continue;
      before[x] = d;
      if (!(d > old - zeta)) continue;  // Eq. 3
      bins[x].add(angle[x]);
      if (is_gap(old)) {  // the first measurement here
        estimate[x] = d;
        shade[x] = cv::Vec3f(seen[x][0], seen[x][1], seen[x][2]);
      } else if (d > last) {                                                // Eq. 4
        estimate[x] = std::min(tau * old + (1 - tau) * d, old + zeta - 1);  // Eq. 2 with its upper limit
        for (int k = 0; k < 3; ++k) shade[x][k] = tau * shade[x][k] + (1 - tau) * static_cast<float>(seen[x][k]);
      }
    }
  }
}

void BackgroundModel::weigh(const DisparityImage& disparity, const ColourImage& colour, const cv::Mat1f& direction,
                            const ForegroundOptions& options, cv::Mat1f& weight) const {
  weight.create(disparity.size());
  if (disparity_.size() != disparity.size()) {
    weight.setTo(0.0F);
    return;
  }
  constexpr float kTurn = 2 * std::numbers::pi_v<float>;
  for (int y = 0; y < disparity.rows; ++y) {
    const float *d = disparity[y], *estimate = disparity_[y], *angle = direction[y];
    float* __restrict out = weight[y];
    for (int x = 0; x < disparity.cols; ++x) {
      const bool gap = d[x] <= kNoDisparity / 2 || estimate[x] <= kNoDisparity / 2;
      const float nearer = options.depth * (estimate[x] - d[x]);
      out[x] = gap ? 0.0F : std::max(nearer, -options.farther * nearer);
    }
    if (options.colour != 0) {
      const cv::Vec3b* seen = colour[y];
      const cv::Vec3f* shade = colour_[y];
      for (int x = 0; x < disparity.cols; ++x) {
        float sum = 0;
        for (int k = 0; k < 3; ++k) sum += std::abs(static_cast<float>(seen[x][k]) - shade[x][k]);
        out[x] += options.colour * sum;
      }
    }
    if (options.angle != 0) {
      const SlidingBins* bins = row_of_bins(y);
      for (int x = 0; x < disparity.cols; ++x) {
        if (is_gap(d[x])) continue;
        const float difference = std::abs(angle[x] - bins[x].reference);
        out[x] += options.angle * std::min(difference, kTurn - difference);
      }
    }
  }
}

const PreprocessedDepth& DepthPreprocessing::next(const DepthImage& depth, const ColourImage& colour) {
  const ColourImage* shown = &colour;
  if (colour.size() != depth.size()) {
    if (no_colour_.size() != depth.size()) no_colour_ = ColourImage(depth.size(), cv::Vec3b(0, 0, 0));
    shown = &no_colour_;
  }
  inpainting_.apply(depth, inpainted_);
  DisparityImage& d = result_.disparity;
  to_disparity(inpainted_, d);
  if (background_.disparity().size() == depth.size()) {  // gaps: the farther one of pyramid and background
    for (int y = 0; y < d.rows; ++y) {
      const std::uint16_t* measured = depth[y];
      const float* behind = background_.disparity()[y];
      float* out = d[y];
      for (int x = 0; x < d.cols; ++x) out[x] = measured[x] == 0 ? std::max(out[x], behind[x]) : out[x];
    }
  }
  gradient_direction(d, result_.direction);
  background_.update(d, *shown, result_.direction, depth);
  background_.weigh(d, *shown, result_.direction, foreground_, result_.weight);
  MaskImage& above = foreground_.vote ? above_ : result_.foreground;
  above.create(d.size());
  for (int y = 0; y < d.rows; ++y) {
    const float* weight = result_.weight[y];
    std::uint8_t* out = above[y];
    for (int x = 0; x < d.cols; ++x) out[x] = weight[x] > foreground_.threshold ? 255 : 0;
  }
  if (foreground_.vote) vote_of_nine(above_, depth, result_.foreground);
  return result_;
}

}  // namespace sherlog::rgbd
