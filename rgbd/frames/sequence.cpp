#include "rgbd/frames/sequence.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <map>
#include <set>
#include <span>
#include <utility>

#include "rgbd/frames/png.h"
#include "rgbd/frames/text_lines.h"

namespace sherlog::rgbd {
namespace {

namespace fs = std::filesystem;
constexpr double kPlainUnits = 1000, kTumUnits = 5000;  // a metre, where the calibration does not say it
constexpr double kPairing = 0.02;                       // seconds that the times of a pair may differ

std::optional<Calibration> read_calibration(const fs::path& file, double units_per_metre, std::string& problem) {
  const auto lines = read_lines(file, problem);
  if (!lines) return std::nullopt;
  Calibration c;
  c.units_per_metre = units_per_metre;
  double width = 0, height = 0;
  const std::map<std::string, double*, std::less<>> fields = {{"width", &width},
                                                              {"height", &height},
                                                              {"fx", &c.fx},
                                                              {"fy", &c.fy},
                                                              {"cx", &c.cx},
                                                              {"cy", &c.cy},
                                                              {"units_per_metre", &c.units_per_metre}};
  std::set<std::string> seen;
  for (const Line& line : *lines) {
    const auto field = fields.find(line.words[0]);
    if (field == fields.end()) {
      problem = at_line(file, line, fmt::format("unknown name '{}'", line.words[0]));
      return std::nullopt;
    }
    if (line.words.size() != 2 || !parse_number(line.words[1], *field->second)) {
      problem = at_line(file, line, fmt::format("'{}' takes one number", line.words[0]));
      return std::nullopt;
    }
    if (!seen.insert(line.words[0]).second) {
      problem = at_line(file, line, fmt::format("'{}' is there a second time", line.words[0]));
      return std::nullopt;
    }
  }
  for (const auto& [name, value] : fields) {
    if (name != "units_per_metre" && !seen.contains(name)) {
      problem = fmt::format("{}: '{}' is missing", file.string(), name);
      return std::nullopt;
    }
  }
  if (width != std::floor(width) || height != std::floor(height) || std::abs(width) > 1e6 || std::abs(height) > 1e6) {
    problem = fmt::format("{}: {} x {} is not the size of an image", file.string(), width, height);
    return std::nullopt;
  }
  c.width = static_cast<std::int32_t>(width);
  c.height = static_cast<std::int32_t>(height);
  if (const std::string wrong = problem_of(c); !wrong.empty()) {
    problem = fmt::format("{}: {}", file.string(), wrong);
    return std::nullopt;
  }
  return c;
}

struct Stamped {
  double time = 0;
  fs::path file;
  std::size_t line = 0;
};

// A list of TUM's: time file. Times increase strictly.
std::optional<std::vector<Stamped>> read_stamped(const fs::path& file, std::string& problem) {
  const auto lines = read_lines(file, problem);
  if (!lines) return std::nullopt;
  std::vector<Stamped> stamped;
  for (const Line& line : *lines) {
    Stamped entry;
    if (line.words.size() != 2 || !parse_number(line.words[0], entry.time)) {
      problem = at_line(file, line, "a line is a time and a file");
      return std::nullopt;
    }
    if (!stamped.empty() && entry.time <= stamped.back().time) {
      problem = at_line(file, line, fmt::format("time {} after {}", line.words[0], stamped.back().time));
      return std::nullopt;
    }
    entry.file = line.words[1];
    stamped.push_back(std::move(entry));
  }
  return stamped;
}

// Pairs (a, b) of indices by nearest times, each index once: all pairs that are near enough, the nearest first.
std::vector<std::pair<std::size_t, std::size_t>> pair_by_time(const std::vector<double>& a,
                                                              const std::vector<double>& b) {
  struct Candidate {
    double difference;
    std::size_t a, b;
  };
  std::vector<Candidate> candidates;
  std::size_t first = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    while (first < b.size() && b[first] < a[i] - kPairing) ++first;
    for (std::size_t j = first; j < b.size() && b[j] <= a[i] + kPairing; ++j) {
      candidates.push_back({std::abs(a[i] - b[j]), i, j});
    }
  }
  std::ranges::stable_sort(candidates, {}, &Candidate::difference);
  std::vector<bool> used_a(a.size()), used_b(b.size());
  std::vector<std::pair<std::size_t, std::size_t>> pairs;
  for (const Candidate& c : candidates) {
    if (used_a[c.a] || used_b[c.b]) continue;
    used_a[c.a] = used_b[c.b] = true;
    pairs.emplace_back(c.a, c.b);
  }
  std::ranges::sort(pairs);
  return pairs;
}

bool add_poses(const fs::path& file, std::vector<FrameEntry>& frames, std::string& problem) {
  const auto lines = read_lines(file, problem);
  if (!lines) return false;
  std::vector<double> times;
  std::vector<Eigen::Isometry3d> poses;
  for (const Line& line : *lines) {
    double time = 0;
    const auto pose = parse_pose(std::span(line.words).subspan(1));
    if (!parse_number(line.words[0], time) || !pose) {
      problem = at_line(file, line, "a line is a time, a place and a unit quaternion, eight numbers");
      return false;
    }
    if (!times.empty() && time <= times.back()) {
      problem = at_line(file, line, fmt::format("time {} after {}", line.words[0], times.back()));
      return false;
    }
    times.push_back(time);
    poses.push_back(*pose);
  }
  if (times.empty()) return true;
  for (FrameEntry& frame : frames) {
    auto next = static_cast<std::size_t>(std::ranges::lower_bound(times, frame.time) - times.begin());
    if (next == times.size() || (next > 0 && frame.time - times[next - 1] < times[next] - frame.time)) --next;
    if (std::abs(times[next] - frame.time) <= kPairing) frame.pose = poses[next];
  }
  return true;
}

bool read_associations(const fs::path& file, Sequence& sequence, std::string& problem) {
  const auto lines = read_lines(file, problem);
  if (!lines) return false;
  for (const Line& line : *lines) {
    double first = 0, second = 0;
    if (line.words.size() != 4 || !parse_number(line.words[0], first) || !parse_number(line.words[2], second)) {
      problem = at_line(file, line, "a line is time, file, time, file");
      return false;
    }
    const bool depth_first = line.words[1].find("depth") != std::string::npos;
    FrameEntry entry{.time = depth_first ? first : second,
                     .depth = line.words[depth_first ? 1 : 3],
                     .colour = line.words[depth_first ? 3 : 1],
                     .pose = {}};
    if (!sequence.frames.empty() && entry.time <= sequence.frames.back().time) {
      problem = at_line(file, line, fmt::format("time {} after {}", entry.time, sequence.frames.back().time));
      return false;
    }
    sequence.frames.push_back(std::move(entry));
  }
  return true;
}

// A link that leads nowhere is there: reading it says what is wrong.
bool is_there(const fs::path& path) {
  std::error_code error;
  return fs::exists(fs::symlink_status(path, error));
}

bool read_tum(Sequence& sequence, std::string& problem) {
  const fs::path& folder = sequence.folder;
  if (is_there(folder / "associations.txt")) {
    if (!read_associations(folder / "associations.txt", sequence, problem)) return false;
  } else {
    const auto depth = read_stamped(folder / "depth.txt", problem);
    if (!depth) return false;
    const auto colour = read_stamped(folder / "rgb.txt", problem);
    if (!colour) return false;
    std::vector<double> depth_times, colour_times;
    for (const Stamped& s : *depth) depth_times.push_back(s.time);
    for (const Stamped& s : *colour) colour_times.push_back(s.time);
    for (const auto& [d, c] : pair_by_time(depth_times, colour_times)) {
      sequence.frames.push_back(
          {.time = depth_times[d], .depth = (*depth)[d].file, .colour = (*colour)[c].file, .pose = {}});
    }
    sequence.unpaired = depth->size() - sequence.frames.size();
    if (sequence.frames.empty() && !depth->empty()) {
      problem = fmt::format("{}: no image in depth.txt has one in rgb.txt that was taken within {} s", folder.string(),
                            kPairing);
      return false;
    }
  }
  if (is_there(folder / "groundtruth.txt")) {
    if (!add_poses(folder / "groundtruth.txt", sequence.frames, problem)) return false;
    sequence.poses_missed =
        std::ranges::none_of(sequence.frames, [](const FrameEntry& f) { return f.pose.has_value(); });
  }
  if (is_there(folder / "calibration.txt")) {
    const auto calibration = read_calibration(folder / "calibration.txt", kTumUnits, problem);
    if (!calibration) return false;
    sequence.calibration = *calibration;
  } else {
    sequence.calibration = {
        .width = 640, .height = 480, .fx = 525, .fy = 525, .cx = 319.5, .cy = 239.5, .units_per_metre = kTumUnits};
  }
  return true;
}

bool read_plain(Sequence& sequence, std::string& problem) {
  const auto calibration = read_calibration(sequence.folder / "calibration.txt", kPlainUnits, problem);
  if (!calibration) return false;
  sequence.calibration = *calibration;
  const fs::path list = sequence.folder / "frames.txt";
  const auto lines = read_lines(list, problem);
  if (!lines) return false;
  for (const Line& line : *lines) {
    FrameEntry entry;
    if ((line.words.size() != 3 && line.words.size() != 10) || !parse_number(line.words[0], entry.time)) {
      problem = at_line(
          list, line, "a line is a time, a depth file, a colour file and, where it is known, a pose of seven numbers");
      return false;
    }
    if (!sequence.frames.empty() && entry.time <= sequence.frames.back().time) {
      problem = at_line(list, line, fmt::format("time {} after {}", line.words[0], sequence.frames.back().time));
      return false;
    }
    entry.depth = line.words[1];
    entry.colour = line.words[2];
    if (line.words.size() == 10) {
      entry.pose = parse_pose(std::span(line.words).subspan(3));
      if (!entry.pose) {
        problem = at_line(list, line, "a pose is a place and a unit quaternion, seven numbers");
        return false;
      }
    }
    sequence.frames.push_back(std::move(entry));
  }
  return true;
}

}  // namespace

std::optional<Sequence> open_sequence(const fs::path& folder, std::string& problem) {
  Sequence sequence;
  sequence.folder = folder;
  std::error_code error;
  const fs::file_type type = fs::status(folder, error).type();
  if (type != fs::file_type::directory) {
    problem = folder.string() + ": ";
    if (type == fs::file_type::not_found) {
      problem += "there is no such folder";
    } else {
      problem += error ? error.message() : "this is no folder; a recording is one";
    }
    return std::nullopt;
  }
  if (fs::directory_iterator(folder, error); error) {
    problem = fmt::format("{}: {}", folder.string(), error.message());
    return std::nullopt;
  }
  const bool plain = is_there(folder / "frames.txt");
  if (!plain && !is_there(folder / "depth.txt") && !is_there(folder / "associations.txt")) {
    problem = folder.string() + ": neither frames.txt nor depth.txt is there, so this is no recorded sequence";
    return std::nullopt;
  }
  sequence.layout = plain ? SequenceLayout::kPlain : SequenceLayout::kTum;
  if (!(plain ? read_plain(sequence, problem) : read_tum(sequence, problem))) return std::nullopt;
  if (sequence.frames.empty()) {
    problem = folder.string() + ": there is no frame";
    return std::nullopt;
  }
  return sequence;
}

std::optional<Frame> read_frame(const Sequence& sequence, std::size_t index, std::string& problem) {
  if (index >= sequence.frames.size()) {
    problem = fmt::format("{}: there is no frame {} of {}", sequence.folder.string(), index, sequence.frames.size());
    return std::nullopt;
  }
  const FrameEntry& entry = sequence.frames[index];
  Frame frame{.time = entry.time, .depth = {}, .colour = {}, .pose = entry.pose};
  const cv::Mat depth = read_png(sequence.folder / entry.depth, CV_16UC1, problem);
  if (depth.empty()) return std::nullopt;
  const cv::Mat colour = read_png(sequence.folder / entry.colour, CV_8UC3, problem);
  if (colour.empty()) return std::nullopt;
  const cv::Size expected = sequence.calibration.size();
  for (const auto& [image, file] : {std::pair{&depth, &entry.depth}, {&colour, &entry.colour}}) {
    if (image->size() != expected) {
      problem =
          fmt::format("{}: the image has {} x {} pixels, the calibration {} x {}", (sequence.folder / *file).string(),
                      image->cols, image->rows, expected.width, expected.height);
      return std::nullopt;
    }
  }
  frame.colour = colour;
  frame.depth = depth;
  const double scale = 1000 / sequence.calibration.units_per_metre;
  if (scale != 1) {
    for (std::uint16_t& value : frame.depth) {
      const double millimetres = std::round(value * scale);
      value = millimetres <= 65535 ? static_cast<std::uint16_t>(millimetres) : std::uint16_t{0};
    }
  }
  return frame;
}

SequenceWriter::SequenceWriter(fs::path folder, const Calibration& calibration, SequenceLayout layout)
    : folder_(std::move(folder)), calibration_(calibration), layout_(layout) {
  calibration_.units_per_metre = layout == SequenceLayout::kTum ? kTumUnits : kPlainUnits;
  problem_ = problem_of(calibration_);
}

bool SequenceWriter::make_folders() {
  for (const char* sub : {"depth", layout_ == SequenceLayout::kTum ? "rgb" : "colour"}) {
    std::error_code error;
    fs::create_directories(folder_ / sub, error);
    if (error) problem_ = fmt::format("{}: the folder cannot be made", (folder_ / sub).string());
  }
  return problem_.empty();
}

bool SequenceWriter::add(const Frame& frame) {
  if (!problem_.empty()) return false;
  for (const cv::Size size : {frame.depth.size(), frame.colour.size()}) {
    if (size == calibration_.size()) continue;
    problem_ = fmt::format("{}: frame {} has {} x {} pixels, the calibration {} x {}", folder_.string(), frames_.size(),
                           size.width, size.height, calibration_.width, calibration_.height);
    return false;
  }
  if (!frames_.empty() && frame.time <= frames_.back().time) {
    problem_ = fmt::format("{}: frame {} has time {} after {}", folder_.string(), frames_.size(), frame.time,
                           frames_.back().time);
    return false;
  }
  if (frames_.empty() && !make_folders()) return false;
  const bool tum = layout_ == SequenceLayout::kTum;
  const std::string name = tum ? fmt::format("{:.6f}.png", frame.time) : fmt::format("{:06}.png", frames_.size());
  FrameEntry entry{.time = frame.time,
                   .depth = fs::path("depth") / name,
                   .colour = fs::path(tum ? "rgb" : "colour") / name,
                   .pose = frame.pose};
  cv::Mat depth = frame.depth;
  if (tum) {  // five units a millimetre; beyond 13 m there is no room
    cv::Mat1w scaled(frame.depth.size());
    std::transform(frame.depth.begin(), frame.depth.end(), scaled.begin(), [](std::uint16_t millimetres) {
      return millimetres <= 65535 / 5 ? static_cast<std::uint16_t>(5 * millimetres) : std::uint16_t{0};
    });
    depth = scaled;
  }
  if (!write_png(folder_ / entry.depth, depth, problem_)) return false;
  if (!write_png(folder_ / entry.colour, frame.colour, problem_)) return false;
  frames_.push_back(std::move(entry));
  return true;
}

bool SequenceWriter::finish() { return problem_.empty() && write_lists(); }

bool SequenceWriter::write_lists() {
  const auto write = [&](const char* name, const std::string& text) {
    std::ofstream out(folder_ / name);
    out << text;
    out.flush();
    if (!out) problem_ = fmt::format("{}: the file cannot be written", (folder_ / name).string());
    return problem_.empty();
  };
  const Calibration& c = calibration_;
  if (!write("calibration.txt", fmt::format("width {}\nheight {}\nfx {}\nfy {}\ncx {}\ncy {}\nunits_per_metre {}\n",
                                            c.width, c.height, c.fx, c.fy, c.cx, c.cy, c.units_per_metre))) {
    return false;
  }
  std::string plain = "# time depth colour [tx ty tz qx qy qz qw]\n";
  std::string depth = "# time file\n", colour = depth, poses = "# time tx ty tz qx qy qz qw\n";
  bool has_poses = false;
  for (const FrameEntry& f : frames_) {
    plain += fmt::format("{} {} {}{}\n", f.time, f.depth.generic_string(), f.colour.generic_string(),
                         f.pose ? " " + pose_text(*f.pose) : "");
    depth += fmt::format("{:.6f} {}\n", f.time, f.depth.generic_string());
    colour += fmt::format("{:.6f} {}\n", f.time, f.colour.generic_string());
    if (f.pose) poses += fmt::format("{:.6f} {}\n", f.time, pose_text(*f.pose));
    has_poses = has_poses || f.pose.has_value();
  }
  if (layout_ == SequenceLayout::kPlain) return write("frames.txt", plain);
  return write("depth.txt", depth) && write("rgb.txt", colour) && (!has_poses || write("groundtruth.txt", poses));
}

}  // namespace sherlog::rgbd
