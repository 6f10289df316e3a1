#include "rgbd/frames/text_lines.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <fstream>
#include <sstream>

#include "mln/lexer.h"

namespace sherlog::rgbd {

namespace fs = std::filesystem;

namespace {

constexpr std::size_t kLongestLine = 4096;

// What messages may repeat.
bool is_plain_text(std::string_view text) {
  const auto is_control = [](char c) {
    return (static_cast<unsigned char>(c) < 32 && c != '\t' && c != '\r') || c == 127;
  };
  return text.size() <= kLongestLine && std::ranges::none_of(text, is_control) &&
         find_invalid_utf8(text) == std::string_view::npos;
}

}  // namespace

std::optional<std::vector<Line>> read_lines(const fs::path& file, std::string& problem) {
  std::error_code error;
  // A pipe would be waited for.
  std::ifstream in;
  if (fs::is_regular_file(file, error)) in.open(file);
  if (!in.is_open()) {
    problem = file.string() + ": the file cannot be opened";
    return std::nullopt;
  }
  std::vector<Line> lines;
  std::string text;
  for (std::size_t number = 1; std::getline(in, text); ++number) {
    if (!is_plain_text(text)) {
      problem = at_line(file, {number, {}},
                        fmt::format("a line of UTF-8 text without control characters was expected, of at most {} bytes",
                                    kLongestLine));
      return std::nullopt;
    }
    std::istringstream words(text);
    Line line{number, {}};
    for (std::string word; words >> word;) line.words.push_back(std::move(word));
    if (!line.words.empty() && line.words[0][0] != '#') lines.push_back(std::move(line));
  }
  return lines;
}

bool parse_number(std::string_view text, double& value) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  return error == std::errc() && end == text.data() + text.size() && std::isfinite(value);
}

std::string at_line(const fs::path& file, const Line& line, const std::string& what) {
  return fmt::format("{}:{}: {}", file.string(), line.number, what);
}

std::optional<Eigen::Isometry3d> parse_pose(std::span<const std::string> words) {
  double v[7];
  if (words.size() != 7) return std::nullopt;
  for (std::size_t i = 0; i < 7; ++i) {
    if (!parse_number(words[i], v[i])) return std::nullopt;
  }
  Eigen::Quaterniond turn(v[6], v[3], v[4], v[5]);
  if (std::abs(turn.norm() - 1) > 0.01) return std::nullopt;
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.linear() = turn.normalized().toRotationMatrix();
  pose.translation() = Eigen::Vector3d(v[0], v[1], v[2]);
  return pose;
}

std::string pose_text(const Eigen::Isometry3d& pose) {
  const Eigen::Quaterniond q(pose.linear());
  const Eigen::Vector3d t = pose.translation();
  return fmt::format("{} {} {} {} {} {} {}", t.x(), t.y(), t.z(), q.x(), q.y(), q.z(), q.w());
}

}  // namespace sherlog::rgbd
