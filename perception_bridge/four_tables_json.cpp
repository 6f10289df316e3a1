#include "perception_bridge/four_tables_json.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "perception_bridge/value.h"

namespace sherlog {
namespace {

using Json = nlohmann::ordered_json;

std::string old_id(std::size_t o) { return fmt::format("O{}", o + 1); }
std::string new_id(std::size_t n) { return fmt::format("N{}", n + 1); }

Json observation_json(const Observation& observation, std::string id) {
  Json json;
  json["id"] = std::move(id);
  json["object"] = observation.object;
  json["table"] = observation.table;
  json["position"] = observation.position;
  json["color"] = observation.color;
  return json;
}

Json resolution_json(const Resolution& resolution) {
  Json json;
  json["association"] = Json::object();
  json["explanation"] = Json::object();
  for (std::size_t n = 0; n < resolution.association.size(); ++n) {
    Json& partner = json["association"][new_id(n)];
    if (resolution.association[n]) partner = old_id(*resolution.association[n]);
  }
  for (std::size_t o = 0; o < resolution.explanation.size(); ++o) {
    json["explanation"][old_id(o)] = to_string(resolution.explanation[o]);
  }
  for (std::size_t n = 0; n < resolution.association.size(); ++n) {
    if (!resolution.association[n]) json["explanation"][new_id(n)] = to_string(ClusterExplanation::kAppear);
  }
  return json;
}

}  // namespace

std::string trial_line(const FourTablesTrial& trial, const MatcherAnswer& answer, bool with_seconds) {
  Json json;
  json["trial"] = trial.number;
  json["seed"] = trial.seed;
  json["objects"] = trial.config.objects;
  json["noise"] = trial.config.noise;
  json["view"] = {{"table", trial.view.table}, {"min", trial.view.min}, {"max", trial.view.max}};
  json["actions"] = Json::array();
  for (const SimulatedAction& action : trial.actions) {
    json["actions"].push_back({{"kind", to_string(action.kind)}, {"object", action.object}});
  }
  json["old"] = Json::array();
  for (std::size_t o = 0; o < trial.old_clusters.size(); ++o) {
    Json old = observation_json(trial.old_clusters[o], old_id(o));
    old["out_of_view"] = trial.old_clusters[o].out_of_view;
    json["old"].push_back(std::move(old));
  }
  json["new"] = Json::array();
  for (std::size_t n = 0; n < trial.new_clusters.size(); ++n) {
    json["new"].push_back(observation_json(trial.new_clusters[n], new_id(n)));
  }
  json["truth"] = resolution_json(trial.truth);
  json["result"] = resolution_json(answer.resolution);
  if (with_seconds) json["result"]["seconds"] = answer.seconds;
  return json.dump() + "\n";
}

namespace {

// Reads a line's values; the first one that is missing or of another kind is the problem.
class LineReader {
 public:
  explicit LineReader(std::string& problem) : problem_(problem) { problem_.clear(); }
  bool good() const { return problem_.empty(); }
  void fail(std::string text) {
    if (problem_.empty()) problem_ = std::move(text);
  }

  double number(const Value& object, const char* key) {
    const Value* value = object.find(key);
    const auto number = value == nullptr ? std::nullopt : value->number();
    if (!number) fail(fmt::format("a trial has no number '{}' where one is needed", key));
    return number.value_or(0);
  }
  template <class Number>
  Number count(const Value& object, const char* key) {
    // Seeds have 64 bits, of which a double has 53.
    if (const Value* whole = object.find(key); whole != nullptr) {
      const std::uint64_t* large = whole->large_number();
      const std::int64_t small = whole->whole_number().value_or(-1);
      const std::uint64_t exact =
          large != nullptr ? *large : static_cast<std::uint64_t>(std::max(small, std::int64_t{0}));
      if ((large != nullptr || small >= 0) && exact <= std::numeric_limits<Number>::max())
        return static_cast<Number>(exact);
    }
    const double value = number(object, key);
    if (value >= 0 && value == std::floor(value) && value <= 9007199254740992.0 &&
        value <= static_cast<double>(std::numeric_limits<Number>::max()))
      return static_cast<Number>(value);
    fail(fmt::format("'{}' is {}, but must be a whole number from 0 on", key, value));
    return 0;
  }
  template <std::size_t kSize>
  std::array<double, kSize> numbers(const Value& object, const char* key) {
    std::array<double, kSize> result{};
    const Value* value = object.find(key);
    const auto list = value == nullptr ? std::nullopt : numbers_of(*value);
    if (list && list->size() == kSize) {
      std::copy(list->begin(), list->end(), result.begin());
    } else {
      fail(fmt::format("a trial has no {} numbers '{}' where they are needed", kSize, key));
    }
    return result;
  }
  const Value::List& list(const Value& object, const char* key) {
    static const Value::List none;
    const Value* value = object.find(key);
    if (value != nullptr && value->list() != nullptr) return *value->list();
    fail(fmt::format("a trial has no list '{}'", key));
    return none;
  }

 private:
  std::string& problem_;
};

Observation observation_from(const Value& value, LineReader& read) {
  Observation observation;
  observation.object = read.count<std::uint32_t>(value, "object");
  observation.table = read.count<std::uint32_t>(value, "table");
  observation.position = read.numbers<2>(value, "position");
  observation.color = read.numbers<3>(value, "color");
  if (const Value* out = value.find("out_of_view"); out != nullptr && out->flag() != nullptr)
    observation.out_of_view = *out->flag();
  return observation;
}

template <class Word>
std::optional<Word> word_from(const Value* value, Word last) {
  for (std::uint8_t i = 0; value != nullptr && value->text() != nullptr && i <= static_cast<std::uint8_t>(last); ++i) {
    if (to_string(static_cast<Word>(i)) == *value->text()) return static_cast<Word>(i);
  }
  return std::nullopt;
}

Resolution resolution_from(const Value& value, std::size_t olds, std::size_t news, LineReader& read) {
  Resolution resolution;
  const Value* association = value.find("association");
  const Value* explanation = value.find("explanation");
  for (std::size_t n = 0; n < news; ++n) {
    const Value* partner = association == nullptr ? nullptr : association->find(new_id(n));
    std::optional<std::uint32_t> old;
    for (std::size_t o = 0; partner != nullptr && partner->text() != nullptr && o < olds; ++o) {
      if (*partner->text() == old_id(o)) old = static_cast<std::uint32_t>(o);
    }
    if (partner == nullptr || (!partner->is_null() && !old))
      read.fail(fmt::format("the truth does not say what '{}' is", new_id(n)));
    resolution.association.push_back(old);
  }
  for (std::size_t o = 0; o < olds; ++o) {
    const auto why =
        word_from(explanation == nullptr ? nullptr : explanation->find(old_id(o)), ClusterExplanation::kHidden);
    if (!why) read.fail(fmt::format("the truth does not explain '{}'", old_id(o)));
    resolution.explanation.push_back(why.value_or(ClusterExplanation::kHidden));
  }
  return resolution;
}

}  // namespace

std::optional<FourTablesTrial> trial_from_line(std::string_view line, const FourTablesConfig& config,
                                               std::string& problem) {
  const auto document = parse_json(line, problem);
  if (!document) return std::nullopt;
  LineReader read(problem);
  FourTablesTrial trial;
  trial.config = config;
  trial.number = read.count<std::uint64_t>(*document, "trial");
  trial.seed = read.count<std::uint64_t>(*document, "seed");
  trial.config.objects = read.count<std::uint32_t>(*document, "objects");
  trial.config.noise = read.number(*document, "noise");
  const Value* view = document->find("view");
  const Value none;
  trial.view.table = read.count<std::uint32_t>(view == nullptr ? none : *view, "table");
  trial.view.min = read.numbers<2>(view == nullptr ? none : *view, "min");
  trial.view.max = read.numbers<2>(view == nullptr ? none : *view, "max");
  for (const Value& action : read.list(*document, "actions")) {
    const auto kind = word_from(action.find("kind"), ActionKind::kChange);
    if (!kind) read.fail("an action has no 'kind' that is put, remove, move or change");
    trial.actions.push_back({kind.value_or(ActionKind::kMove), read.count<std::uint32_t>(action, "object")});
  }
  trial.config.actions = static_cast<std::uint32_t>(trial.actions.size());
  for (const Value& old : read.list(*document, "old")) trial.old_clusters.push_back(observation_from(old, read));
  for (const Value& now : read.list(*document, "new")) trial.new_clusters.push_back(observation_from(now, read));
  const Value* truth = document->find("truth");
  if (read.good())
    trial.truth =
        resolution_from(truth == nullptr ? none : *truth, trial.old_clusters.size(), trial.new_clusters.size(), read);
  if (read.good()) problem = validate(trial.config);
  return read.good() ? std::optional(std::move(trial)) : std::nullopt;
}

}  // namespace sherlog
