// Text files of a recording: lines of words, numbers and poses.
#pragma once

#include <Eigen/Geometry>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace sherlog::rgbd {

struct Line {
  std::size_t number = 0;
  std::vector<std::string> words;  // one at least
};

// Lines that are neither empty nor comments (#), as words. Nothing where the file cannot be read, or is no text.
std::optional<std::vector<Line>> read_lines(const std::filesystem::path& file, std::string& problem);
// "file:line: what"
std::string at_line(const std::filesystem::path& file, const Line& line, const std::string& what);

// False: it is no finite number, or there is more.
bool parse_number(std::string_view text, double& value);
// Seven words: place and unit quaternion, tx ty tz qx qy qz qw.
std::optional<Eigen::Isometry3d> parse_pose(std::span<const std::string> words);
// The same seven, in as many digits as it takes to read them back.
std::string pose_text(const Eigen::Isometry3d& pose);

}  // namespace sherlog::rgbd
