// What form a thing on a table has, and the box around it: from the points that a camera sees of it.
//
// Idea      A camera that looks down on a table sees the tops of things and their near sides. The outermost points in
//           each direction from the middle are the outline, of the top where nothing else is seen. A circle and a
//           rectangle are fitted to it robustly, and whichever leaves more of it within a tolerance is the form of its
//           footprint. Low and wide is flat; a circle whose wall is upright or whose top is closed is a cylinder, an
//           open or bulging one is round, and so is what lies on a sphere that touches the table: a ball. A rectangle that is as high as wide, with points near a cylinder along it rather
//           than near its top and sides, is a cylinder that lies.
// Source    the four words and the 0.25 of flat from RoboSherlock's annotators; those take lines for box and circles
//           for round. There a carton that stands is flat when it is thin; here only what lies is
// Output    confidence: share of the outline on the figure, less that of the other figure where they are near each
//           other
// Cost      O(points)
#pragma once

#include <array>
#include <string>

#include "rgbd/objects/hypotheses.h"

namespace sherlog::rgbd {

struct Box {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();  // table frame
  Eigen::Vector3d size = Eigen::Vector3d::Zero();    // along its own axes, z up
  double heading = 0;                                // around z, in -pi/4 ... pi/4 of squares, -pi/2 ... pi/2 of others
};

struct CircleFit {
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();
  double radius = 0;
  double inliers = 0;  // share of the outline
};
struct RectangleFit {
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();
  Eigen::Vector2d size = Eigen::Vector2d::Zero();
  double heading = 0;
  double inliers = 0;
};

// Of the outermost points around the middle.
std::vector<Eigen::Vector2d> outline_of(const std::vector<Eigen::Vector3f>& points);
CircleFit fit_circle(const std::vector<Eigen::Vector2d>& outline, double tolerance);
RectangleFit fit_rectangle(const std::vector<Eigen::Vector2d>& outline, double tolerance);

inline constexpr std::array kShapes = {"box", "round", "flat", "cylinder"};

struct ShapeFit {
  std::string shape;  // one of kShapes; empty: too few points
  double confidence = 0;
  Box box;
  double box_share = 0, circle_share = 0;
};

// `error`: how far measurements are off there, metres.
ShapeFit fit_shape(const Hypothesis& thing, double error);

// Counts: distances from the axis, heights, and distances between pairs of points, 15 each.
std::vector<double> shape_features(const Hypothesis& thing);

// small < 0.0012 m^3 <= medium < 0.004 <= large. The confidence is 1/2 at a limit and grows away from it.
inline constexpr std::array kSizes = {"small", "medium", "large"};
struct SizeName {
  std::string name;  // one of kSizes
  double confidence = 0;
};
SizeName size_name(double cubic_metres);

}  // namespace sherlog::rgbd
