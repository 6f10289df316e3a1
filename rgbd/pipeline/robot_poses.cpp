#include "rgbd/pipeline/robot_poses.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <unordered_map>
#include <utility>

#include "rgbd/frames/text_lines.h"

namespace sherlog::rgbd {
namespace {

constexpr std::pair<const char*, BodyShape> kShapes[] = {
    {"box", BodyShape::kBox}, {"cylinder", BodyShape::kCylinder}, {"capsule", BodyShape::kCapsule}};

// The words behind "link NAME"; nothing where they are not a body.
std::optional<Body> parse_body(std::span<const std::string> words) {
  if (words.size() != 4) return std::nullopt;
  const auto* shape = std::ranges::find(kShapes, words[0], [](const auto& named) { return named.first; });
  if (shape == std::end(kShapes)) return std::nullopt;
  Body body{.shape = shape->second};
  for (int axis = 0; axis < 3; ++axis) {
    if (!parse_number(words[static_cast<std::size_t>(axis) + 1], body.size[axis])) return std::nullopt;
  }
  const bool is_round = body.shape != BodyShape::kBox;
  if (body.size.minCoeff() <= 0 || (is_round && body.size.x() != body.size.y())) return std::nullopt;
  return body;
}

Eigen::Isometry3d between(const Eigen::Isometry3d& a, const Eigen::Isometry3d& b, double part) {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.translation() = a.translation() + part * (b.translation() - a.translation());
  pose.linear() = Eigen::Quaterniond(a.linear()).slerp(part, Eigen::Quaterniond(b.linear())).toRotationMatrix();
  return pose;
}

}  // namespace

std::optional<RobotPoses> RobotPoses::read(const std::filesystem::path& file, std::string& problem) {
  const auto lines = read_lines(file, problem);
  if (!lines) return std::nullopt;
  RobotPoses robot;
  std::vector<std::size_t> line_of;  // of each link
  std::unordered_map<std::string, std::size_t> number_of;
  const auto fail = [&](const Line& line, const std::string& what) {
    problem = at_line(file, line, what);
    return std::nullopt;
  };
  for (const Line& line : *lines) {
    const std::span words(line.words);
    if (words[0] == "link") {
      const auto body = words.size() < 2 ? std::nullopt : parse_body(words.subspan(2));
      if (!body) {
        return fail(line,
                    "a link has a name, a shape that is box, cylinder or capsule, and three positive numbers, of round "
                    "ones the diameter twice");
      }
      if (!number_of.emplace(words[1], robot.links_.size()).second)
        return fail(line, fmt::format("link '{}' is there a second time", words[1]));
      robot.links_.push_back({words[1], *body, {}, {}});
      line_of.push_back(line.number);
    } else if (words[0] == "pose") {
      double time = 0;
      const auto pose = words.size() < 3 ? std::nullopt : parse_pose(words.subspan(3));
      if (!pose || !parse_number(words[1], time)) {
        return fail(line, "a pose is a time, a link's name, a place and a unit quaternion");
      }
      const auto found = number_of.find(words[2]);
      if (found == number_of.end()) return fail(line, fmt::format("there is no link '{}' above", words[2]));
      Link& link = robot.links_[found->second];
      if (!link.times.empty() && time <= link.times.back()) {
        return fail(line, fmt::format("time {} after {}", words[1], link.times.back()));
      }
      link.times.push_back(time);
      link.poses.push_back(*pose);
    } else {
      return fail(line, fmt::format("a line begins with link or pose, and not with '{}'", words[0]));
    }
  }
  for (std::size_t i = 0; i < robot.links_.size(); ++i) {
    const Link& link = robot.links_[i];
    if (link.times.empty()) return fail({line_of[i], {}}, fmt::format("link '{}' has no pose", link.name));
  }
  return robot;
}

std::optional<std::vector<Body>> RobotPoses::at(double time, std::string& problem) const {
  std::vector<Body> bodies;
  for (const Link& link : links_) {
    const auto next = static_cast<std::size_t>(std::ranges::lower_bound(link.times, time) - link.times.begin());
    const bool has_next = next<link.times.size(), has_last = next> 0;
    const double ahead = has_next ? link.times[next] - time : INFINITY;
    const double behind = has_last ? time - link.times[next - 1] : INFINITY;
    bodies.push_back(link.body);
    if (ahead == 0 || (ahead <= behind && ahead <= kNear && ahead + behind > kGap)) {
      bodies.back().pose = link.poses[next];
    } else if (ahead + behind <= kGap) {
      bodies.back().pose = between(link.poses[next - 1], link.poses[next], behind / (ahead + behind));
    } else if (behind <= kNear) {
      bodies.back().pose = link.poses[next - 1];
    } else {
      problem = fmt::format("where the robot's link '{}' was then is not known", link.name);
      return std::nullopt;
    }
  }
  return bodies;
}

void RobotPosesWriter::add(double time, std::span<const Body> links) {
  const auto micrometres = [](double metres) { return std::round(metres * 1e6) / 1e6; };
  const bool is_first = links_.empty();
  for (std::size_t i = 0; i < links.size(); ++i) {
    const Body& link = links[i];
    const auto* shape = std::ranges::find(kShapes, link.shape, [](const auto& named) { return named.second; });
    if (is_first && shape != std::end(kShapes)) {
      links_ += fmt::format("link link_{} {} {} {} {}\n", i + 1, shape->first, micrometres(link.size.x()),
                            micrometres(link.size.y()), micrometres(link.size.z()));
    }
    if (shape != std::end(kShapes)) poses_ += fmt::format("pose {} link_{} {}\n", time, i + 1, pose_text(link.pose));
  }
}

}  // namespace sherlog::rgbd
