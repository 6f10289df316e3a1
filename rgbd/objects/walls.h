// Walls at the edge of a table: counters stand against them.
//
// Idea      Depth puts half of a wall's points in front of it, over the table, and what touches the wall is one piece with
//           it. So a wall is looked for first, as a line in the picture from above: through two points at the table's
//           rim or beyond it, with all of the table on one side, that many points over a good width and height are
//           near to (RANSAC).
// Source    Fischler and Bolles, Random sample consensus, 1981
// Random    a fixed seed
// Cost      O(pixels) + 120 trials on at most 20,000 of them for each wall, of which there are three at most
#pragma once

#include "rgbd/objects/table_top.h"

namespace sherlog::rgbd {

// Pixels of the walls, and of what is behind them. `points` as of above_table().
MaskImage behind_walls(const cv::Mat3f& points, const Table& table);

}  // namespace sherlog::rgbd
