#include "perception_bridge/open_question.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>

#include "perception_bridge/annotation_types.h"

namespace sherlog {
namespace {

constexpr SceneLimits kNoLimits{std::numeric_limits<std::size_t>::max(), std::numeric_limits<std::size_t>::max()};

}  // namespace

std::vector<Cluster> OpenQuestion::old_looks() const {
  std::vector<Cluster> looks;
  for (const Old& old : olds) looks.push_back(old.look);
  return looks;
}

std::vector<bool> OpenQuestion::out_of_view() const {
  std::vector<bool> out;
  for (const Old& old : olds) out.push_back(old.out_of_view);
  return out;
}

const OpenQuestion::Old* OpenQuestion::old_of(const std::string& object) const {
  const auto found = std::ranges::find(olds, object, &Old::object);
  return found == olds.end() ? nullptr : &*found;
}

bool complete_look(Cluster& earlier, const Cluster& later) {
  const std::vector<Annotation> before = earlier.annotations;
  for (const Annotation& annotation : later.annotations) {
    const auto type = full_type_name(annotation.type);
    const bool known =
        std::ranges::any_of(before, [&](const Annotation& other) { return full_type_name(other.type) == type; });
    if (!is_of_the_moment(type) && !known) earlier.annotations.push_back(annotation);
  }
  return earlier.annotations.size() > before.size();
}

Value question_to_json(const OpenQuestion& question) {
  Value::List olds, objects, open;
  for (const OpenQuestion::Old& old : question.olds) {
    olds.emplace_back(Value::Object{
        {"object", Value(old.object)}, {"look", designator_to_json(old.look)}, {"outOfView", Value(old.out_of_view)}});
  }
  for (const std::string& object : question.objects) objects.emplace_back(object);
  for (const bool flag : question.open) open.emplace_back(flag);
  return Value(Value::Object{{"scene", scene_to_json(question.scene)},
                             {"olds", Value(std::move(olds))},
                             {"objects", Value(std::move(objects))},
                             {"open", Value(std::move(open))}});
}

std::optional<OpenQuestion> question_from_json(const Value& document, std::string& problem) {
  const Value none;
  const auto part = [&](const Value& value, const char* key) -> const Value& {
    const Value* found = value.find(key);
    return found == nullptr ? none : *found;
  };
  SceneMessages messages;
  OpenQuestion question;
  auto scene = scene_from_json(part(document, "scene"), messages, kNoLimits);
  const Value::List* olds = part(document, "olds").list();
  const Value::List* objects = part(document, "objects").list();
  const Value::List* open = part(document, "open").list();
  bool good = scene && olds != nullptr && objects != nullptr && open != nullptr &&
              objects->size() == scene->clusters.size() && open->size() == scene->clusters.size();
  if (good) {
    question.scene = std::move(*scene);
    for (const Value& item : *olds) {
      auto look = designator_from_json(part(item, "look"), messages, kNoLimits);
      const std::string* object = part(item, "object").text();
      const bool* out_of_view = part(item, "outOfView").flag();
      good = good && look && object != nullptr && out_of_view != nullptr;
      if (good) question.olds.push_back({*object, std::move(*look), *out_of_view});
    }
    for (std::size_t n = 0; n < objects->size(); ++n) {
      const std::string* object = (*objects)[n].text();
      const bool* flag = (*open)[n].flag();
      good = good && object != nullptr && flag != nullptr;
      if (good) question.objects.push_back(*object), question.open.push_back(*flag);
    }
  }
  if (good) return question;
  problem = "an open question is not as it was written";
  if (!messages.errors.empty()) problem += ": " + messages.errors.front();
  return std::nullopt;
}

}  // namespace sherlog
