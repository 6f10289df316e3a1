#include "perception_bridge/concepts.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <set>

#include "perception_bridge/value.h"

namespace sherlog {
namespace {

std::string lower(std::string_view text) {
  std::string result(text);
  std::transform(result.begin(), result.end(), result.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return result;
}

bool read_members(const Value& value, Concepts& concepts, std::string& problem) {
  if (value.object() == nullptr) return problem = "'concepts' is not an object", false;
  for (const auto& [name, list] : *value.object()) {
    std::vector<std::string>& members = concepts.members[lower(name)];
    const bool good =
        list.list() != nullptr && std::all_of(list.list()->begin(), list.list()->end(), [&](const Value& item) {
          if (item.text() != nullptr) members.push_back(*item.text());
          return item.text() != nullptr;
        });
    if (!good) return problem = fmt::format("the concept '{}' is not a list of names", name), false;
  }
  return true;
}

}  // namespace

std::optional<Concepts> parse_concepts(std::string_view text, std::string& problem) {
  const auto document = parse_json(text, problem);
  if (!document) return std::nullopt;
  Concepts concepts;
  if (document->object() == nullptr) {
    problem = "a concept file is an object with 'concepts' and 'belongs'";
    return std::nullopt;
  }
  for (const auto& [key, value] : *document->object()) {
    if (key == "concepts") {
      if (!read_members(value, concepts, problem)) return std::nullopt;
    } else if (key == "belongs") {
      const bool good = value.object() != nullptr &&
                        std::all_of(value.object()->begin(), value.object()->end(), [&](const auto& entry) {
                          if (entry.second.text() != nullptr)
                            concepts.belongs[lower(entry.first)] = *entry.second.text();
                          return entry.second.text() != nullptr;
                        });
      if (!good) {
        problem = "'belongs' is not an object of names";
        return std::nullopt;
      }
    } else if (key != "schema") {
      problem = fmt::format("'{}' is none of concepts, belongs", key);
      return std::nullopt;
    }
  }
  return concepts;
}

std::vector<std::string> names_of(const Concepts& concepts, std::string_view name) {
  std::vector<std::string> names = {std::string(name)};
  std::set<std::string> seen = {lower(name)};
  for (std::size_t next = 0; next < names.size(); ++next) {
    const auto found = concepts.members.find(lower(names[next]));
    if (found == concepts.members.end()) continue;
    for (const std::string& member : found->second) {
      if (seen.insert(lower(member)).second) names.push_back(member);
    }
  }
  return names;
}

std::optional<std::string> place_for(const Concepts& concepts, std::string_view name) {
  std::vector<std::string> level = {lower(name)};
  std::set<std::string> seen(level.begin(), level.end());
  while (!level.empty()) {
    std::vector<std::string> above;
    for (const std::string& word : level) {
      const auto said = concepts.belongs.find(word);
      if (said != concepts.belongs.end()) return said->second;
      for (const auto& [concept_name, members] : concepts.members) {
        const bool is_member = std::any_of(members.begin(), members.end(),
                                           [&](const std::string& member) { return lower(member) == word; });
        if (is_member && seen.insert(concept_name).second) above.push_back(concept_name);
      }
    }
    level = std::move(above);
  }
  return std::nullopt;
}

}  // namespace sherlog
