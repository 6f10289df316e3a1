#include "rgbd/pipeline/recorder.h"

#include <fmt/format.h>

#include <array>
#include <fstream>

#include "perception_bridge/value.h"

namespace sherlog::rgbd {
namespace {

Value numbers(const Eigen::Ref<const Eigen::VectorXd>& values) {
  return number_list(std::vector<double>(values.data(), values.data() + values.size()));
}

std::string map_text(const FrameSource& source) {
  Value::List surfaces, structure;
  for (const Surface& surface : source.knowledge.map) {
    surfaces.push_back(Value(Value::Object{{"name", Value(surface.name)},
                                           {"min", numbers(surface.low)},
                                           {"max", numbers(surface.high)},
                                           {"height", Value(surface.height)}}));
  }
  for (const Body& body : source.structure) {
    if (body.shape != BodyShape::kBox && body.shape != BodyShape::kCylinder) continue;
    const Eigen::Quaterniond turn(body.pose.linear());
    structure.push_back(Value(Value::Object{{"shape", Value(body.shape == BodyShape::kBox ? "box" : "cylinder")},
                                            {"size", numbers(body.size)},
                                            {"translation", numbers(body.pose.translation())},
                                            {"rotation", numbers(turn.coeffs())}}));
  }
  return json_text(Value(Value::Object{{"surfaces", Value(surfaces)}, {"structure", Value(structure)}})) + "\n";
}

std::string known_text(const FrameSource& source) {
  Value::List things;
  for (const KnownThing& thing : source.knowledge.things) {
    things.push_back(Value(Value::Object{{"name", Value(thing.name)},
                                         {"shape", Value(thing.shape)},
                                         {"size", numbers(thing.size)},
                                         {"color", number_list({thing.colour[0], thing.colour[1], thing.colour[2]})}}));
  }
  return json_text(Value(Value::Object{{"things", Value(things)}})) + "\n";
}

}  // namespace

Recorder::Recorder(const std::filesystem::path& folder, const FrameSource& source)
    : folder_(folder), source_(source), writer_(folder, source.calibration) {}

bool Recorder::add(const Frame& frame, std::size_t index) {
  if (!writer_.add(frame)) return false;
  if (source_.robot) robot_.add(frame.time, source_.robot(index));
  return true;
}

bool Recorder::finish() {
  const bool has_map = !source_.knowledge.map.empty() || !source_.structure.empty();
  return writer_.finish() && (robot_.empty() || write("robot.txt", robot_.text())) &&
         (!has_map || write("map.json", map_text(source_))) &&
         (source_.knowledge.things.empty() || write("known.json", known_text(source_)));
}

bool Recorder::write(const char* name, const std::string& text) {
  std::ofstream out(folder_ / name);
  out << text;
  out.flush();
  if (!out) problem_ = fmt::format("{}: the file cannot be written", (folder_ / name).string());
  return problem_.empty();
}

}  // namespace sherlog::rgbd
