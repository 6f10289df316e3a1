// Whether what is seen over a table stands on it, by what one sees of the table around and below it.
//
// Idea      What stands on a table hides the table below its middle, as far as it goes, and all that is between. What an arm
//           holds does not: somewhere below it one looks through, at the table or beyond. Where its lowest visible part is
//           tells nothing: of a ball, or of what is seen from above, it is high, and so it is where depth is too coarse to
//           tell the lowest part from the table or is not measured at all.
// Source    ours
// Cost      O(pixels of the piece)
#pragma once

#include "rgbd/objects/hypotheses.h"

namespace sherlog::rgbd {

class Standing {
 public:
  // All are kept by reference. `points` as of above_table().
  Standing(const cv::Mat3f& points, const Table& table, const Calibration& calibration,
           const HypothesisOptions& options);

  // Where a piece would stand, in the table's frame.
  struct Foot {
    Eigen::Vector2d middle, away;  // of what is seen; away: from the camera, of length one
    double depth = 0;              // of what is seen, from near to far
    double lowest = 0, highest = 0;
  };
  // Requires pixels that are measured.
  Foot foot_of(const std::vector<cv::Point>& pixels) const;
  bool hovers(const Foot& foot) const;
  // Over the table's edge, but not from beyond it: its middle is on the table, and all of it close by.
  bool hangs_over(const std::vector<cv::Point>& pixels, const Foot& foot);

 private:
  enum class View { kOpen, kClosed, kUnknown };
  bool is_open(const Foot& foot, double along) const;
  View view_through(const Eigen::Vector2d& column, double height) const;
  double range(const cv::Vec3f& at) const { return depth_row_.dot(Eigen::Vector4d(at[0], at[1], at[2], 1)); }

  const cv::Mat3f& points_;
  const Table& table_;
  const Calibration& calibration_;
  const HypothesisOptions& options_;
  Eigen::Vector3d eye_;  // the camera, in the table's frame
  Eigen::RowVector4d depth_row_;
  cv::Mat1f beyond_;  // cells from the outline, where the table's raster is; empty: not needed yet
};

}  // namespace sherlog::rgbd
