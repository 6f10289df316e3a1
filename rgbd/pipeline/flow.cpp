#include "rgbd/pipeline/flow.h"

#include <fmt/format.h>

#include <algorithm>
#include <boost/algorithm/string/predicate.hpp>
#include <set>

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

// Of images and clouds one is enough, of opinions none too many. RoboSherlock's types of images and clouds are views here.
bool needs_one_writer(const std::string& name) {
  return !is_type_name(name) || name.starts_with("rs.cv.") || name.starts_with("rs.pcl.");
}

using Names = std::vector<std::string>;

// Of the texts that it may write as this; none: any.
Names values_written(const Annotator& annotator, const std::string& name) {
  Names values;
  for (const std::string& written : annotator.writes()) {
    if (!is_type_name(written) || !is_annotation_of(written, name)) continue;
    const Names more = annotator.written_values(written);
    if (more.empty()) return {};
    values.insert(values.end(), more.begin(), more.end());
  }
  return values;
}

// Goes back from what is wanted; `state` marks those on the way (a second visit is a cycle) and those that are done.
class Planner {
 public:
  Planner(const Annotators& annotators, std::span<const std::string> given)
      : annotators_(annotators), given_(given), state_(annotators.size(), kNew) {}

  bool want(const Wanted& wanted, const std::string& who) {
    if (std::ranges::find(given_, wanted.name) != given_.end()) return true;
    Positions writers = writers_of(annotators_, wanted.name);
    // Who changes what is there comes after those that make it.
    if (!way_.empty() && writers.size() > 1) std::erase(writers, way_.back());
    if (writers.empty()) {
      problem = fmt::format("nobody writes '{}', which {} needs", wanted.name, who);
      return false;
    }
    if (!wanted.values.empty()) keep_able(writers, wanted, who);
    if (!needs_one_writer(wanted.name)) {
      return std::ranges::all_of(writers, [&](std::size_t writer) { return take(writer); });
    }
    return take(
        *std::ranges::min_element(writers, {}, [&](std::size_t writer) { return annotators_[writer]->cost(); }));
  }

  Names warnings;
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

  // Only those that may write one of the values, if there are any.
  void keep_able(Positions& writers, const Wanted& wanted, const std::string& who) {
    Positions able;
    std::set<std::string> known;
    for (const std::size_t writer : writers) {
      const Names values = values_written(*annotators_[writer], wanted.name);
      const auto is_wanted = [&](const std::string& value) {
        return std::ranges::any_of(wanted.values, [&](const std::string& one) { return boost::iequals(one, value); });
      };
      if (values.empty() || std::ranges::any_of(values, is_wanted)) able.push_back(writer);
      known.insert(values.begin(), values.end());
    }
    if (able.empty()) {
      warnings.push_back(fmt::format("nobody finds the {} '{}', which {} needs: there are {}", wanted.name,
                                     fmt::join(wanted.values, "' or '"), who, fmt::join(known, ", ")));
    } else {
      writers = std::move(able);
    }
  }

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
      if (!want({name, annotator.read_values(name)}, fmt::format("'{}'", annotator.name()))) return false;
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

// Whether all that `reader` has from `writer`, which comes later, is images and clouds that another one writes before.
bool is_late(const Annotators& annotators, const Positions& order, std::size_t reader, std::size_t writer) {
  const Names reads = annotators[order[reader]]->reads();
  return std::ranges::all_of(reads, [&](const std::string& name) {
    if (!provides(*annotators[order[writer]], name)) return true;
    return needs_one_writer(name) && std::any_of(order.begin(), order.begin() + static_cast<std::ptrdiff_t>(reader),
                                                 [&](std::size_t i) { return provides(*annotators[i], name); });
  });
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
                              std::span<const Wanted> wanted, std::string& problem) {
  Planner planner(annotators, given);
  for (const Wanted& one : wanted) {
    if (planner.want(one, "the request")) continue;
    problem = planner.problem;
    return std::nullopt;
  }
  const Positions rest = planner.chosen();
  // The first of the list whose needs are met, again and again.
  Flow flow;
  const std::vector<Positions> needs = dependencies(annotators, rest);
  std::vector<bool> is_placed(rest.size(), false);
  while (flow.order.size() < rest.size()) {
    const auto is_ready = [&](std::size_t i) {
      return !is_placed[i] && std::ranges::all_of(needs[i], [&](std::size_t j) -> bool { return is_placed[j]; });
    };
    std::size_t next = 0;
    while (next < rest.size() && !is_ready(next)) ++next;
    if (next == rest.size()) {
      // Each in turn is needed by the one before: of two writers of a view, the one that was not taken for it.
      Names left;
      for (std::size_t i = 0; i < rest.size(); ++i) {
        if (!is_placed[i]) left.push_back(annotators[rest[i]]->name());
      }
      problem = fmt::format("the flow goes in a circle among {}", fmt::join(left, ", "));
      return std::nullopt;
    }
    is_placed[next] = true;
    flow.order.push_back(rest[next]);
  }
  flow.after = dependencies(annotators, flow.order);
  flow.warnings = std::move(planner.warnings);
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
    std::erase_if(flow.after[i], [&](std::size_t j) { return j > i && is_late(annotators, flow.order, i, j); });
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
