// The one table of FourTablesConfig's members: their names in JSON, their ranges.
#include <fmt/format.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "perception_bridge/four_tables.h"
#include "perception_bridge/value.h"

namespace sherlog {
namespace {

using Json = nlohmann::ordered_json;

struct RealMember {
  const char* name;
  double FourTablesConfig::*member;
  double least, most;
};
struct WholeMember {
  const char* name;
  std::uint32_t FourTablesConfig::*member;
  std::uint32_t least, most;
};

constexpr WholeMember kWhole[] = {
    {"tables", &FourTablesConfig::tables, 1, 1000},
    {"objects", &FourTablesConfig::objects, 0, 1000},
    {"actions", &FourTablesConfig::actions, 0, 100000},
};
constexpr RealMember kReal[] = {
    {"table_width", &FourTablesConfig::table_width, 1e-3, 1e3},
    {"table_depth", &FourTablesConfig::table_depth, 1e-3, 1e3},
    {"view_width", &FourTablesConfig::view_width, 1e-3, 1e3},
    {"noise", &FourTablesConfig::noise, 1e-6, 10},
    {"start_fill", &FourTablesConfig::start_fill, 0, 1},
    {"sensor_range", &FourTablesConfig::sensor_range, 0, 1e3},
    {"table_gap", &FourTablesConfig::table_gap, 0, 1e3},
    {"put_weight", &FourTablesConfig::put_weight, 0, 1e6},
    {"remove_weight", &FourTablesConfig::remove_weight, 0, 1e6},
    {"move_weight", &FourTablesConfig::move_weight, 0, 1e6},
    {"change_weight", &FourTablesConfig::change_weight, 0, 1e6},
};

std::string read_member(const std::string& name, const Json& value, FourTablesConfig& config) {
  for (const WholeMember& m : kWhole) {
    if (name != m.name) continue;
    if (!value.is_number_unsigned() || value.get<std::uint64_t>() > m.most) {
      return fmt::format("'{}' is {}, but must be a whole number from {} to {}", name, value.dump(), m.least, m.most);
    }
    config.*m.member = value.get<std::uint32_t>();
    return {};
  }
  for (const RealMember& m : kReal) {
    if (name != m.name) continue;
    if (!value.is_number()) return fmt::format("'{}' is {}, but must be a number", name, value.dump());
    config.*m.member = value.get<double>();
    return {};
  }
  std::string known;
  for (const WholeMember& m : kWhole) known += std::string(known.empty() ? "" : ", ") + m.name;
  for (const RealMember& m : kReal) known += std::string(", ") + m.name;
  return fmt::format("unknown parameter '{}'; there are {}", name, known);
}

}  // namespace

std::string validate(const FourTablesConfig& config) {
  const auto check = [](const char* name, double value, double least, double most) -> std::string {
    if (value >= least && value <= most) return {};
    return fmt::format("'{}' is {}, but must be from {} to {}", name, value, least, most);
  };
  for (const WholeMember& m : kWhole) {
    if (std::string problem = check(m.name, config.*m.member, m.least, m.most); !problem.empty()) return problem;
  }
  for (const RealMember& m : kReal) {
    if (std::string problem = check(m.name, config.*m.member, m.least, m.most); !problem.empty()) return problem;
  }
  // Otherwise the robot may stand beside the table and see none of it.
  if (config.sensor_range >= 0.5 * (config.table_width + config.view_width)) {
    return fmt::format("'sensor_range' is {}, but must be below {}: the robot has to see some of the table",
                       config.sensor_range, 0.5 * (config.table_width + config.view_width));
  }
  return {};
}

std::string read_config(std::string_view json, FourTablesConfig& config) {
  std::string problem;
  if (!parse_json(json, problem)) return problem;  // which refuses keys that appear twice
  Json document;
  try {
    document = Json::parse(json);
  } catch (const Json::exception& error) {
    return error.what();
  }
  if (!document.is_object()) return "expected a JSON object";
  FourTablesConfig read = config;
  for (const auto& [name, value] : document.items()) {
    problem = read_member(name, value, read);
    if (!problem.empty()) return problem;
  }
  problem = validate(read);
  if (!problem.empty()) return problem;
  config = read;
  return {};
}

std::string to_json(const FourTablesConfig& config) {
  Json document;
  for (const WholeMember& m : kWhole) document[m.name] = config.*m.member;
  for (const RealMember& m : kReal) document[m.name] = config.*m.member;
  return document.dump(2) + "\n";
}

}  // namespace sherlog
