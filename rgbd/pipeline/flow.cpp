#include "rgbd/pipeline/flow.h"

#include <fmt/format.h>

#include <algorithm>

#include "perception_bridge/annotation_types.h"

namespace sherlog::rgbd {
namespace {

using Positions = std::vector<std::size_t>;

bool provides(const Annotator& annotator, const std::string& name) {
  const auto writes = annotator.writes();
  return std::ranges::any_of(writes, [&](const std::string& written) {
    return is_type_name(name) ? is_annotation_of(written, name) : written == name;
  });
}

Positions writers_of(const Annotators& annotators, const std::string& name) {
  Positions writers;
  for (std::size_t i = 0; i < annotators.size(); ++i) {
    if (provides(*annotators[i], name)) writers.push_back(i);
  }
  return writers;
}

// Goes back from what is wanted; `state` marks those on the way (a second visit is a cycle) and those that are done.
class Planner {
 public:
  Planner(const Annotators& annotators, std::span<const std::string> given)
      : annotators_(annotators), given_(given), state_(annotators.size(), kNew) {}

  bool want(const std::string& name, const std::string& who) {
    if (std::ranges::find(given_, name) != given_.end()) return true;
    Positions writers = writers_of(annotators_, name);
    if (writers.empty()) {
      problem = fmt::format("nobody writes '{}', which {} needs", name, who);
      return false;
    }
    if (is_type_name(name)) {
      return std::ranges::all_of(writers, [&](std::size_t writer) { return take(writer); });
    }
    return take(
        *std::ranges::min_element(writers, {}, [&](std::size_t writer) { return annotators_[writer]->cost(); }));
  }

  std::string problem;
  Positions chosen() const {
    Positions result;
    for (std::size_t i = 0; i < state_.size(); ++i) {
      if (state_[i] == kDone) result.push_back(i);
    }
    return result;
  }

 private:
  enum State : char { kNew, kOnTheWay, kDone };

  bool take(std::size_t position) {
    if (state_[position] == kDone) return true;
    const Annotator& annotator = *annotators_[position];
    if (state_[position] == kOnTheWay) {
      const auto from = std::ranges::find(way_, position);
      std::string names;
      for (auto i = from; i != way_.end(); ++i) names += annotators_[*i]->name() + " -> ";
      problem =
          fmt::format("the flow goes in a circle: {}{} (each reads what the next one writes)", names, annotator.name());
      return false;
    }
    state_[position] = kOnTheWay;
    way_.push_back(position);
    for (const std::string& name : annotator.reads()) {
      if (!want(name, fmt::format("'{}'", annotator.name()))) return false;
    }
    way_.pop_back();
    state_[position] = kDone;
    return true;
  }

  const Annotators& annotators_;
  std::span<const std::string> given_;
  std::vector<State> state_;
  Positions way_;
};

// Of each in `order` who else in it writes what it reads.
std::vector<Positions> dependencies(const Annotators& annotators, const Positions& order) {
  std::vector<Positions> after(order.size());
  for (std::size_t i = 0; i < order.size(); ++i) {
    for (const std::string& name : annotators[order[i]]->reads()) {
      for (std::size_t j = 0; j < order.size(); ++j) {
        if (j != i && provides(*annotators[order[j]], name)) after[i].push_back(j);
      }
    }
    std::ranges::sort(after[i]);
    after[i].erase(std::unique(after[i].begin(), after[i].end()), after[i].end());
  }
  return after;
}

}  // namespace

Annotation make_annotation(std::string type, std::string source, Value::Object fields,
                           std::optional<double> confidence) {
  Annotation annotation;
  annotation.type = std::move(type);
  annotation.source = std::move(source);
  annotation.confidence = confidence;
  annotation.fields = std::move(fields);
  return annotation;
}

std::optional<Flow> plan_flow(const Annotators& annotators, std::span<const std::string> given,
                              std::span<const std::string> wanted, std::string& problem) {
  Planner planner(annotators, given);
  for (const std::string& name : wanted) {
    if (planner.want(name, "the request")) continue;
    problem = planner.problem;
    return std::nullopt;
  }
  Positions rest = planner.chosen();
  // The first of the list whose needs are met, again and again. There is one: circles were refused above.
  Flow flow;
  const std::vector<Positions> needs = dependencies(annotators, rest);
  std::vector<bool> is_placed(rest.size(), false);
  while (flow.order.size() < rest.size()) {
    for (std::size_t i = 0; i < rest.size(); ++i) {
      const auto placed = [&](std::size_t j) { return static_cast<bool>(is_placed[j]); };
      if (is_placed[i] || !std::ranges::all_of(needs[i], placed)) continue;
      is_placed[i] = true;
      flow.order.push_back(rest[i]);
      break;
    }
  }
  flow.after = dependencies(annotators, flow.order);
  return flow;
}

std::optional<Flow> fixed_flow(const Annotators& annotators, std::span<const std::string> given,
                               std::span<const std::string> names, std::string& problem) {
  Flow flow;
  for (const std::string& name : names) {
    const auto found = std::ranges::find_if(annotators, [&](const auto& a) { return a->name() == name; });
    if (found == annotators.end()) return problem = fmt::format("there is no annotator '{}'", name), std::nullopt;
    const auto position = static_cast<std::size_t>(found - annotators.begin());
    if (std::ranges::find(flow.order, position) != flow.order.end()) {
      return problem = fmt::format("'{}' is in the flow twice", name), std::nullopt;
    }
    flow.order.push_back(position);
  }
  flow.after = dependencies(annotators, flow.order);
  for (std::size_t i = 0; i < flow.order.size(); ++i) {
    const Annotator& annotator = *annotators[flow.order[i]];
    for (const std::size_t j : flow.after[i]) {
      if (j < i) continue;
      problem = fmt::format("'{}' runs before '{}', whose results it reads", annotator.name(),
                            annotators[flow.order[j]]->name());
      return std::nullopt;
    }
    for (const std::string& name : annotator.reads()) {
      const bool is_given = std::ranges::find(given, name) != given.end();
      const bool is_written =
          std::ranges::any_of(flow.after[i], [&](std::size_t j) { return provides(*annotators[flow.order[j]], name); });
      if (is_given || is_written) continue;
      problem = fmt::format("nobody in the flow writes '{}', which '{}' needs", name, annotator.name());
      return std::nullopt;
    }
  }
  return flow;
}

}  // namespace sherlog::rgbd
