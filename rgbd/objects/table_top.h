// The table tops in a depth image: their planes, their outlines, and how high everything is above them.
//
// Idea      Most of what a camera over a table measures is the table. A plane through three points that most others
//           agree with is found, whatever stands on it (RANSAC; every other time the three are neighbours, which finds
//           small tables in large rooms), and fitted anew to those that agree (a fixed number of rounds with a weight
//           that falls to zero). Errors of depth grow with its square, so agreement is counted in the sensor's steps.
//           The outline is the convex hull of the largest connected piece; other pieces of the plane that are large
//           enough, tables of the same height, count as surface too. Where the camera's pose is known, tables of other
//           heights, parallel to the first, are then looked for in what is neither on such a plane nor above such an
//           outline.
// Source    Fischler and Bolles, Random sample consensus, 1981; Beaton and Tukey's weights, 1974; deliverable 3.3
//           (table tops)
// Frames    the table's: z up from its surface, origin in the middle of its outline. x is the world's as far as
//           possible, so that things keep their headings while the camera moves.
// Random    a fixed seed: the same plane for the same image
// Cost      O(pixels) for each plane + 400 trials on at most 4,000 of them
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "rgbd/depth/disparity.h"
#include "rgbd/frames/frame.h"

namespace sherlog::rgbd {

// Points in the camera's frame, metres; z = 0 is a gap.
using Cloud = cv::Mat3f;
Cloud cloud_of(const DepthImage& depth, const Calibration& calibration);

// How far a measurement is off, metres: half a step of the sensor's disparity.
inline double depth_error(double metres) {
  // Without a3, which is 1e-9 of a4, a step at d is d r / (1 - r).
  const double millimetres = metres > 0.3 ? metres * 1000 : 300, r = millimetres * (kA4 / kA2);
  return millimetres * r / (1 - r) / 2000;
}

struct TableOptions {
  double most_tilt = 0.26;  // radians, from the horizontal; where the camera's pose is known
  // Where the camera's pose is known: tables are so high above z = 0, or lower than that nowhere.
  std::vector<double> heights = {};
  double least_height = 0.3, height_error = 0.06;
  double least_area = 0.05;         // square metres
  double least_further_area = 0.2;  // of the second height and on, where `heights` does not name them
  std::size_t most_heights = 4;
  double agreement = 3;  // errors of depth
  double cell = 0.005;   // of the outline's raster, metres
  std::size_t trials = 400;
};

struct Table {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();  // to the camera's frame
  Eigen::Isometry3d in_world =
      Eigen::Isometry3d::Identity();  // to the world; to the camera's frame where no pose is known
  bool has_world = false;
  std::vector<Eigen::Vector2d> outline;  // of the largest piece: convex, counter-clockwise, table frame
  MaskImage surface;                     // pixels that measure it
  double area = 0;

  // Within the outline of a piece: its number, from 1; else 0.
  std::size_t piece(double x, double y) const;
  bool has(double x, double y) const { return piece(x, y) != 0; }
  cv::Mat1b raster;  // of the outlines: the pieces' numbers
  Eigen::Vector2d raster_origin = Eigen::Vector2d::Zero();
  double cell = 0.005;
};

// By height; the one that most of the picture shows first. `camera`: to the world, where known: then tables are level, and without it
// there is one at most. Empty, and a sentence, where there is none.
std::vector<Table> find_tables(const Cloud& cloud, const std::optional<Eigen::Isometry3d>& camera,
                               const TableOptions& options, std::string& problem);

// Points in the table's frame; z = -10 in gaps.
cv::Mat3f above_table(const Cloud& cloud, const Table& table);

// By table, the pixels that measure something on another one: over its outline, and not over one that is between. `points`: of
// above_table(), by table. One table: no pixels.
std::vector<MaskImage> on_other_tables(const std::vector<cv::Mat3f>& points, const std::vector<Table>& tables);

}  // namespace sherlog::rgbd
