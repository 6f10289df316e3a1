// Where on a table there may be things: what stands out of it in depth, and what differs from it in colour.
//
// Idea      In depth a thing is a connected piece of points above the table's plane that stands on it. What is too
//           flat for the sensor (cutlery), or gives it nothing, has another colour than the table: such pieces are
//           hypotheses as well. And where two things touch, depth makes one of them; parts of one piece with different
//           colours that both stand on the table are two. So the result has at least what each way alone has.
//           What is a wall at the table's edge, and what is behind it, is no thing either: an upright plane with all of the
//           table on one side. What comes from beyond the table's edge (an arm) and what one can look through below (what an arm
//           holds) is no thing on the table. It is counted, so that one may wait until nobody reaches over it.
// Source    Beetz et al., RoboSherlock, ICRA 2015, section 4 and 8 (table-top and colour segmentation; "flat objects")
// Cost      O(pixels)
#pragma once

#include <vector>

#include "rgbd/objects/table_top.h"

namespace sherlog::rgbd {

struct Hypothesis {
  cv::Rect roi;                         // in the picture
  cv::Mat1b mask;                       // of the roi's size
  std::vector<Eigen::Vector3f> points;  // table frame; those of colour alone lie on the table
  bool from_colour = false;             // depth alone does not have it
  std::size_t table = 0;                // its number
};

struct Hypotheses {
  std::vector<Hypothesis> things;  // from left to right in the picture
  std::size_t reaching = 0;        // pieces that come from beyond the table's edge, or hover
  MaskImage reaching_mask;
};

struct HypothesisOptions {
  double least_height = 0.006;  // metres; at least so many errors of depth:
  double errors = 3;
  double most_height = 0.5;
  double gap = 0.015;          // between neighbours of one piece, metres; and errors of depth
  double least_area = 0.0004;  // square metres of surface that is seen
  double hover = 0.03;         // what is lower somewhere stands on the table
  double beyond = 0.15;    // share outside of the outline that makes it reach in; 0.01 where the picture cuts it off
  double overhang = 0.05;  // but not if it is on the table otherwise, and nowhere farther outside
  float colour_distance = 16;  // from the table's colour, in the a b plane of Lab with half of L
  float split_distance = 28;   // between colours of two things that touch
  double least_part = 0.12;    // share of a piece that may be a thing of its own
  bool use_depth = true, use_colour = true;
};

// `points` as of above_table(). Colour of the same size; of another one, or empty: depth alone.
Hypotheses find_hypotheses(const cv::Mat3f& points, const ColourImage& colour, const Table& table,
                           const Calibration& calibration, const HypothesisOptions& options = {});
// On several tables, `points` by table. `known`: pixels of the robot's own body, where nothing is looked for; empty: none. A body
// over a table reaches over it.
Hypotheses find_hypotheses(const std::vector<cv::Mat3f>& points, const ColourImage& colour,
                           const std::vector<Table>& tables, const Calibration& calibration,
                           const HypothesisOptions& options, const MaskImage& known);

}  // namespace sherlog::rgbd
