// Semantic maps and known things from JSON.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "rgbd/pipeline/object_annotators.h"

namespace sherlog::rgbd {
namespace {

// The numbers at a key, all finite; nothing where they are not so many.
std::optional<std::vector<double>> numbers_at(const Value& item, const char* key, std::size_t count) {
  const Value* value = item.find(key);
  auto numbers = value == nullptr ? std::nullopt : numbers_of(*value);
  if (!numbers || numbers->size() != count) return std::nullopt;
  return numbers;
}

std::optional<std::string> text_at(const Value& item, const char* key) {
  const Value* value = item.find(key);
  return value == nullptr || value->text() == nullptr ? std::nullopt : std::optional(*value->text());
}

const Value::List* list_at(const std::optional<Value>& document, const char* key, std::string& problem) {
  if (!document) return nullptr;
  const Value* value = document->find(key);
  if (value != nullptr && value->list() != nullptr) return value->list();
  problem = fmt::format("there is no list '{}'", key);
  return nullptr;
}

}  // namespace

std::optional<SemanticMap> parse_map(std::string_view text, std::string& problem) {
  const auto document = parse_json(text, problem);
  const auto* items = list_at(document, "surfaces", problem);
  if (items == nullptr) return std::nullopt;
  SemanticMap map;
  for (const Value& item : *items) {
    const auto name = text_at(item, "name");
    const auto low = numbers_at(item, "min", 2), high = numbers_at(item, "max", 2);
    const Value* height = item.find("height");
    const auto metres = height == nullptr ? std::nullopt : height->number();
    if (!name || !low || !high || !metres || !((*low)[0] < (*high)[0]) || !((*low)[1] < (*high)[1])) {
      problem = fmt::format(
          "surface {}: it takes a text 'name', 'min' and 'max' of two numbers each, the lower first, and "
          "a number 'height'",
          map.size() + 1);
      return std::nullopt;
    }
    map.push_back({*name, {(*low)[0], (*low)[1]}, {(*high)[0], (*high)[1]}, *metres});
  }
  return map;
}

std::optional<std::vector<PlacedMesh>> parse_structure(std::string_view text, std::string& problem) {
  const auto document = parse_json(text, problem);
  if (!document) return std::nullopt;
  std::vector<PlacedMesh> bodies;
  if (document->find("structure") == nullptr) return bodies;
  const auto* items = list_at(document, "structure", problem);
  if (items == nullptr) return std::nullopt;
  for (const Value& item : *items) {
    const auto shape = text_at(item, "shape");
    const auto size = numbers_at(item, "size", 3), place = numbers_at(item, "translation", 3);
    const auto turn = item.find("rotation") == nullptr
                          ? std::vector<double>{0, 0, 0, 1}
                          : numbers_at(item, "rotation", 4).value_or(std::vector<double>());
    const bool is_box = shape == "box", is_cylinder = shape == "cylinder";
    const bool is_sized = size && std::ranges::all_of(*size, [](double edge) { return edge > 0; });
    const Eigen::Quaterniond q =
        turn.size() == 4 ? Eigen::Quaterniond(turn[3], turn[0], turn[1], turn[2]) : Eigen::Quaterniond(0, 0, 0, 0);
    if ((!is_box && !is_cylinder) || !is_sized || !place || std::abs(q.norm() - 1) > 0.01) {
      problem = fmt::format(
          "structure {}: it takes a 'shape' that is box or cylinder, a 'size' of three positive numbers, a "
          "'translation' "
          "of three and, where it is turned, a 'rotation' that is a unit quaternion x, y, z, w",
          bodies.size() + 1);
      return std::nullopt;
    }
    PlacedMesh body{is_box ? box_mesh({(*size)[0], (*size)[1], (*size)[2]}) : cylinder_mesh((*size)[0], (*size)[2])};
    body.pose.linear() = q.normalized().toRotationMatrix();
    body.pose.translation() = Eigen::Vector3d((*place)[0], (*place)[1], (*place)[2]);
    bodies.push_back(std::move(body));
  }
  return bodies;
}

std::optional<std::vector<KnownThing>> parse_known_things(std::string_view text, std::string& problem) {
  const auto document = parse_json(text, problem);
  const auto* items = list_at(document, "things", problem);
  if (items == nullptr) return std::nullopt;
  std::vector<KnownThing> things;
  for (const Value& item : *items) {
    const auto name = text_at(item, "name"), shape = text_at(item, "shape");
    const auto size = numbers_at(item, "size", 3), colour = numbers_at(item, "color", 3);
    bool is_good = name && shape && size && colour;
    for (std::size_t i = 0; is_good && i < 3; ++i) {
      is_good = (*size)[i] > 0 && (*colour)[i] >= 0 && (*colour)[i] <= 1;
    }
    if (!is_good) {
      problem = fmt::format(
          "thing {}: it takes the texts 'name' and 'shape', a 'size' of three positive numbers and a "
          "'color' of three in [0, 1]",
          things.size() + 1);
      return std::nullopt;
    }
    things.push_back({*name, *shape, {(*size)[0], (*size)[1], (*size)[2]}, {(*colour)[0], (*colour)[1], (*colour)[2]}});
  }
  return things;
}

}  // namespace sherlog::rgbd
