// Where the parts of a robot were while frames were recorded, for taking them out of what the camera sees.
//
// robot.txt, beside the frames; '#' begins a comment line:
//   link NAME SHAPE X Y Z                       box (edges), cylinder or capsule (diameter twice; height; of a capsule
//                                               between the centres of its ends), metres, along its own z axis
//   pose TIME NAME tx ty tz qx qy qz qw         its middle in the world at a time of the frames' clock
// Idea      What any robot can write down from its joints: forward kinematics has been done when it comes here.
//           Between two poses a link is on the straight way from one to the other.
// Errors    "file:line: sentence"; of a moment for which a link has no pose, its name
#pragma once

#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "rgbd/synthetic/scene.h"

namespace sherlog::rgbd {

class RobotPoses {
 public:
  static constexpr double kNear = 0.02;  // seconds that one pose may be off
  static constexpr double kGap = 0.15;   // seconds between two poses that a moment may lie between

  static std::optional<RobotPoses> read(const std::filesystem::path& file, std::string& problem);
  // All links. Nothing where one of them has no pose near enough.
  std::optional<std::vector<Body>> at(double time, std::string& problem) const;

 private:
  struct Link {
    std::string name;
    Body body;
    std::vector<double> times;  // increase strictly
    std::vector<Eigen::Isometry3d> poses;
  };
  std::vector<Link> links_;
};

// The file for these links, each of which is the same body in all moments.
class RobotPosesWriter {
 public:
  void add(double time, std::span<const Body> links);
  bool empty() const { return links_.empty(); }
  std::string text() const { return links_ + poses_; }

 private:
  std::string links_, poses_;
};

}  // namespace sherlog::rgbd
