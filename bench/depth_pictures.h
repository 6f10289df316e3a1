// The pictures of the depth paper, from simulated sequences: noise (Figs. 1 and 2), foreground of several methods
// (Fig. 5) and three ways to fill gaps (Fig. 6).
#pragma once

#include <fmt/format.h>

#include <filesystem>
#include <limits>
#include <opencv2/imgproc.hpp>
#include <set>
#include <string>
#include <vector>

#include "bench/background_rivals.h"
#include "bench/chart.h"
#include "rgbd/depth/noise_statistics.h"
#include "rgbd/frames/png.h"
#include "rgbd/synthetic/sequences.h"

namespace sherlog::rgbd {

inline bool write_picture(const std::filesystem::path& file, const cv::Mat3b& picture) {
  std::string problem;
  const bool is_written = write_png(file, picture, problem);
  if (!is_written) fmt::print(stderr, "{}\n", problem);
  return is_written;
}

// Red is near, blue is far, black is a gap.
inline cv::Mat3b depth_picture(const DepthImage& depth, double nearest, double farthest) {
  const double low = normalised_disparity(nearest), high = normalised_disparity(farthest);
  cv::Mat3b picture(depth.size(), cv::Vec3b(0, 0, 0));
  for (int y = 0; y < depth.rows; ++y) {
    for (int x = 0; x < depth.cols; ++x) {
      if (depth(y, x) == 0) continue;
      const double share = std::clamp((normalised_disparity(depth(y, x)) - low) / (high - low), 0.0, 1.0);
      for (int k = 0; k < 3; ++k) {  // blue, green, red
        const double value = 1.5 - std::abs(4 * share - 3 + k);
        picture(y, x)[k] = cv::saturate_cast<std::uint8_t>(255 * value);
      }
    }
  }
  return picture;
}

inline cv::Mat3b grey_picture(const cv::Mat1d& values, double white) {
  cv::Mat3b picture(values.size());
  std::ranges::transform(values, picture.begin(), [white](double v) {
    const auto grey = cv::saturate_cast<std::uint8_t>(255 * v / white);
    return v < 0 ? cv::Vec3b(90, 20, 20) : cv::Vec3b(grey, grey, grey);
  });
  return picture;
}

inline cv::Mat3b mask_picture(const MaskImage& mask) {
  cv::Mat3b picture;
  cv::cvtColor(mask, picture, cv::COLOR_GRAY2BGR);
  return picture;
}

// Tiles of one size in rows, a white line between them.
inline cv::Mat3b tiled(const std::vector<std::vector<cv::Mat3b>>& rows) {
  const cv::Size tile = rows[0][0].size(), step = {tile.width + 2, tile.height + 2};
  const cv::Size all(step.width * static_cast<int>(rows[0].size()) - 2,
                     step.height * static_cast<int>(rows.size()) - 2);
  cv::Mat3b picture(all, cv::Vec3b(255, 255, 255));
  for (std::size_t r = 0; r < rows.size(); ++r) {
    for (std::size_t c = 0; c < rows[r].size(); ++c) {
      const cv::Point place(step.width * static_cast<int>(c), step.height * static_cast<int>(r));
      rows[r][c].copyTo(picture(cv::Rect(place, tile)));
    }
  }
  return picture;
}

// --- E4: the room of `hall` without people, from 0.8 m on, in 2,500 frames

inline bool write_noise(const std::filesystem::path& folder) {
  constexpr std::uint64_t kFrames = 2500;
  const auto room = make_sequence("hall", {.width = 320, .height = 240});
  const View view = render(room->scenery(), room->calibration(), look_at({0, 0, 0.45}, {0, 2, 0.05}));
  NoiseStatistics before(false), after(true);
  for (std::uint64_t i = 0; i < kFrames; ++i) {
    const Frame frame = measure(view, room->calibration(), {}, 1, i);
    before.add(frame.depth);
    after.add(frame.depth);
  }
  ChartPanel metric{
      "Before Eq. 1", "depth, m", "standard deviation, mm", {{"2,500 frames", {}}, {"a step of the sensor", {}, true}},
      false,          true};
  ChartPanel steps{"After Eq. 1", "depth, m", "standard deviation, steps", {{"2,500 frames", {}}}};
  std::string csv = "metres,pixels,before_mm,after_steps\n";
  const auto by_depth = before.by_depth(250), by_depth_in_steps = after.by_depth(250);
  double least[] = {1e9, 1e9}, most[] = {0, 0};
  for (std::size_t i = 0; i < by_depth.size(); ++i) {
    const auto &a = by_depth[i], &b = by_depth_in_steps[i];
    if (a.pixels < 30) continue;
    const double metres = a.millimetres / 1000;
    metric.lines[0].points.emplace_back(metres, a.deviation);
    metric.lines[1].points.emplace_back(metres, disparity_step(a.millimetres));
    steps.lines[0].points.emplace_back(metres, b.deviation);
    csv += fmt::format("{},{},{:.3f},{:.4f}\n", metres, a.pixels, a.deviation, b.deviation);
    for (const auto& [which, deviation] : {std::pair{0, a.deviation}, {1, b.deviation}}) {
      least[which] = std::min(least[which], deviation), most[which] = std::max(most[which], deviation);
    }
  }
  fmt::print("Noise by depth, {} frames: {:.1f} to {:.1f} mm (a factor of {:.0f}), {:.2f} to {:.2f} steps ({:.2f})\n",
             kFrames, least[0], most[0], most[0] / least[0], least[1], most[1], most[1] / least[1]);
  const int row = view.depth.rows / 6;  // through the windows
  const cv::Mat1d mean = before.mean(), in_mm = before.deviation(), in_steps = after.deviation();
  ChartPanel line_depth{"Scanline: depth", "column", "mean, m", {{"", {}}}};
  ChartPanel line_metric{"Before Eq. 1", "column", "standard deviation, mm", {{"", {}}}, false, true};
  ChartPanel line_steps{"After Eq. 1", "column", "standard deviation, steps", {{"", {}}}, false, true};
  std::string line_csv = "column,mean_mm,before_mm,after_steps\n";
  for (int x = 0; x < mean.cols; ++x) {
    const double gap = mean(row, x) < 0 ? std::numeric_limits<double>::quiet_NaN() : 0;
    line_depth.lines[0].points.emplace_back(x, mean(row, x) / 1000 + gap);
    line_metric.lines[0].points.emplace_back(x, in_mm(row, x) + gap);
    line_steps.lines[0].points.emplace_back(x, in_steps(row, x) + gap);
    if (mean(row, x) < 0) continue;
    line_csv += fmt::format("{},{:.1f},{:.3f},{:.4f}\n", x, mean(row, x), in_mm(row, x), in_steps(row, x));
  }
  return write_text(folder / "noise_by_depth.svg", chart({metric, steps})) &&
         write_text(folder / "noise_by_depth.csv", csv) &&
         write_text(folder / "noise_scanline.svg", chart({line_depth, line_metric, line_steps}, 340, 280)) &&
         write_text(folder / "noise_scanline.csv", line_csv) &&
         write_picture(folder / "noise_pixels.png", tiled({{grey_picture(in_mm, 150), grey_picture(in_steps, 1.5)}}));
}

// --- E7: three ways to fill gaps

// From a step of 1 to 3 m with a gap of 24 x 24 pixels across it: pixels in a row of the gap with another value.
inline double blur_of_step(const DepthImage& filled) {
  return static_cast<double>(std::ranges::count_if(filled, [](std::uint16_t d) { return d != 1000 && d != 3000; })) /
         24;
}

// Share of the filled pixels with a depth that was measured nowhere in the frame: the sensor's steps are few.
inline double share_of_new_depths(const DepthImage& measured, const DepthImage& filled) {
  const std::set<std::uint16_t> there(measured.begin(), measured.end());
  double gaps = 0, news = 0;
  for (int y = 0; y < measured.rows; ++y) {
    for (int x = 0; x < measured.cols; ++x) {
      if (measured(y, x) != 0 || filled(y, x) == 0) continue;
      gaps += 1;
      news += there.contains(filled(y, x)) ? 0 : 1;
    }
  }
  return news / gaps;
}

inline bool write_inpaintings(const std::filesystem::path& folder) {
  const auto fill = [](const DepthImage& depth) {
    std::vector<DepthImage> filled(3);
    PyramidInpainting(InpaintingFilter::kMedian).apply(depth, filled[0]);
    PyramidInpainting(InpaintingFilter::kBinomial).apply(depth, filled[1]);
    inpaint_by_diffusion(depth, filled[2]);
    return filled;
  };
  DepthImage step(64, 64, std::uint16_t{1000});
  step(cv::Rect(32, 0, 32, 64)).setTo(3000);
  step(cv::Rect(20, 20, 24, 24)).setTo(0);
  const auto sequence = make_sequence("window", {.width = 320, .height = 240});
  const TrueFrame t = sequence->frame(100);
  const auto steps = fill(step), frames = fill(t.frame.depth);
  std::vector<cv::Mat3b> row = {depth_picture(t.frame.depth, 1500, 7000)};
  fmt::print(
      "Inpainting: pixels a row between the two sides of a step, share of filled pixels at depths that are not "
      "there\n");
  for (std::size_t i = 0; i < 3; ++i) {
    constexpr const char* kNames[] = {"median pyramid", "binomial pyramid", "diffusion"};
    fmt::print("  {:16} {:5.2f}  {:5.1f} %\n", kNames[i], blur_of_step(steps[i]),
               100 * share_of_new_depths(t.frame.depth, frames[i]));
    row.push_back(depth_picture(frames[i], 1500, 7000));
  }
  return write_picture(folder / "inpainting.png", tiled({row}));
}

// --- E13: masks at five moments of `hall`

inline bool write_masks(const std::filesystem::path& folder) {
  const std::set<std::size_t> shown = {0, 23, 45, 68, 89};
  const auto sequence = make_sequence("hall", {.width = 320, .height = 240, .frames = 90});
  DepthPreprocessing ours;
  Rivals rivals;
  std::vector<std::vector<cv::Mat3b>> rows;
  for (std::size_t i = 0; i < sequence->size(); ++i) {
    const TrueFrame t = sequence->frame(i);
    const PreprocessedDepth& result = ours.next(t.frame.depth, t.frame.colour);
    const std::vector<MaskImage>& masks = rivals.next(t.frame, result.disparity);
    if (!shown.contains(i)) continue;
    std::vector<cv::Mat3b> row = {t.frame.colour, depth_picture(t.frame.depth, 1500, 9000), mask_picture(t.foreground),
                                  mask_picture(result.foreground)};
    for (const std::size_t rival : {0U, 2U, 4U, 6U}) row.push_back(mask_picture(masks[rival]));
    for (cv::Mat3b& tile : row) cv::resize(tile, tile, {160, 120}, 0, 0, cv::INTER_AREA);
    rows.push_back(std::move(row));
  }
  return write_picture(folder / "masks.png", tiled(rows));
}

inline bool write_depth_pictures(const std::filesystem::path& folder) {
  return write_noise(folder) && write_inpaintings(folder) && write_masks(folder);
}

}  // namespace sherlog::rgbd
