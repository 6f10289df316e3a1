#include "rgbd/pipeline/request.h"

#include <fmt/format.h>

#include <algorithm>
#include <boost/property_tree/ini_parser.hpp>
#include <boost/property_tree/ptree.hpp>
#include <cctype>
#include <iterator>
#include <sstream>

namespace sherlog::rgbd {
namespace {

constexpr std::string_view kVerbs[] = {"detect", "inspect", "scan", "track"};  // in the order of Request::Verb

std::string lower(std::string_view text) {
  std::string result(text);
  std::ranges::transform(result, result.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return result;
}

using Keys = std::vector<RequestKey>;

std::string key_names(const Keys& keys) {
  std::vector<std::string_view> names;
  for (const RequestKey& known : keys) {
    if (std::ranges::find(names, known.key) == names.end()) names.push_back(known.key);
  }
  return fmt::format("{}", fmt::join(names, ", "));
}

std::optional<Request::Condition> parse_condition(const std::string& key, const Value& value, const Keys& keys,
                                                  std::string& problem) {
  Request::Condition condition{key, {}};
  if (std::ranges::find(keys, key, &RequestKey::key) == keys.end()) {
    return problem = fmt::format("a request has no key '{}'; there are {}", key, key_names(keys)), std::nullopt;
  }
  const Value::List one = {value};
  for (const Value& item : value.list() == nullptr ? one : *value.list()) {
    if (item.text() == nullptr) {
      return problem = fmt::format("'{}' takes a text or a list of texts, not {}", key, item.kind()), std::nullopt;
    }
    condition.values.push_back(lower(*item.text()));
  }
  if (condition.values.empty()) return problem = fmt::format("'{}' has an empty list", key), std::nullopt;
  return condition;
}

bool holds(const Request::Condition& condition, const Keys& keys, const Cluster& cluster) {
  for (const RequestKey& known : keys) {
    if (known.key != condition.key) continue;
    for (const Annotation* annotation : annotations_of(cluster.annotations, known.type)) {
      for (const Value* value : select(annotation->fields, known.pointer)) {
        if (value->text() == nullptr) continue;
        if (std::ranges::find(condition.values, lower(*value->text())) != condition.values.end()) return true;
      }
    }
  }
  return false;
}

std::string trimmed(std::string_view text) {
  constexpr std::string_view kBlanks = " \t\r\n";
  const std::size_t first = text.find_first_not_of(kBlanks);
  return first == text.npos ? "" : std::string(text.substr(first, text.find_last_not_of(kBlanks) - first + 1));
}

}  // namespace

const std::vector<RequestKey>& request_keys() {
  static const std::vector<RequestKey> kKeys = {
      {"shape", "rs.annotation.Shape", "/shape"},
      {"size", "rs.annotation.SemanticSize", "/size"},
      {"color", "rs.annotation.SemanticColor", "/color"},
      {"location", "rs.annotation.TFLocation", "/frame_id"},
      {"class", "rs.annotation.Classification", "/classname"},
      {"type", "rs.annotation.Classification", "/classname"},
      {"detection", "rs.annotation.Detection", "/name"},
      {"cad-model", "rs.annotation.Detection", "/name"},
  };
  return kKeys;
}

std::optional<std::vector<RequestKey>> parse_request_keys(const std::string& text, std::string& problem) {
  boost::property_tree::ptree document;
  std::istringstream in(text);
  try {
    boost::property_tree::read_ini(in, document);
  } catch (const boost::property_tree::ini_parser_error& error) {
    return problem = fmt::format("line {}: {}", error.line(), error.message()), std::nullopt;
  }
  Keys keys;
  for (const auto& [section, entries] : document) {
    const auto location = entries.find("location");
    if (location == entries.not_found()) continue;  // [keys], which says the types once more
    std::istringstream alternatives(location->second.data());
    for (std::string alternative; std::getline(alternatives, alternative, '|');) {
      const std::string path = trimmed(alternative);
      const std::size_t star = path.find("/*/");
      if (!path.starts_with('/') || star == path.npos) {
        problem = fmt::format("[{}]: '{}' is no place of the form /type/*/field", section, path);
        return std::nullopt;
      }
      keys.push_back({section, path.substr(1, star - 1), path.substr(star + 2)});
    }
  }
  if (keys.empty()) return problem = "there is no section with a 'location'", std::nullopt;
  return keys;
}

std::vector<Wanted> Request::wanted() const {
  std::vector<Wanted> wanted;
  for (const Condition& condition : conditions) {
    wanted.push_back({{}, condition.values});
    for (const RequestKey& known : keys) {
      if (known.key == condition.key) wanted.back().names.push_back(known.type);
    }
  }
  return wanted;
}

bool Request::accepts(const Cluster& cluster) const {
  return std::ranges::all_of(conditions, [&](const Condition& condition) { return holds(condition, keys, cluster); });
}

std::optional<Request> parse_request(std::string_view text, std::string& problem, const Keys& keys) {
  const auto document = parse_json(text, problem);
  if (!document) return std::nullopt;
  const auto* verbs = document->object();
  if (verbs == nullptr || verbs->size() != 1) {
    return problem = R"(a request is an object with one verb, such as {"detect": {"shape": "box"}})", std::nullopt;
  }
  const auto& [verb, conditions] = verbs->front();
  const auto known = std::ranges::find(kVerbs, verb);
  if (known == std::end(kVerbs)) {
    return problem = fmt::format("there is no verb '{}'; there are {}", verb, fmt::join(kVerbs, ", ")), std::nullopt;
  }
  if (conditions.object() == nullptr) {
    return problem = fmt::format("'{}' takes an object, not {}", verb, conditions.kind()), std::nullopt;
  }
  Request request;
  request.keys = keys;
  request.verb = static_cast<Request::Verb>(known - std::begin(kVerbs));
  for (const auto& [key, value] : *conditions.object()) {
    if (request.verb == Request::Verb::kScan && key != "location") {
      return problem = fmt::format("'scan' takes a 'location' and no '{}'; 'inspect' takes it", key), std::nullopt;
    }
    auto condition = parse_condition(key, value, keys, problem);
    if (!condition) return std::nullopt;
    request.conditions.push_back(std::move(*condition));
  }
  return request;
}

Value answer_to(const Request& request, const sherlog::Scene& scene) {
  Value::List designators;
  for (const Cluster& cluster : scene.clusters) {
    if (request.accepts(cluster)) designators.push_back(designator_to_json(cluster));
  }
  return Value(std::move(designators));
}

}  // namespace sherlog::rgbd
