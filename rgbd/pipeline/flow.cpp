#include "rgbd/pipeline/flow.h"

#include <fmt/format.h>

#include <algorithm>
#include <boost/algorithm/string/predicate.hpp>
#include <limits>
#include <map>
#include <set>

#include "perception_bridge/annotation_types.h"

namespace sherlog::rgbd {
namespace {

using Positions = std::vector<std::size_t>;
using Names = std::vector<std::string>;

constexpr std::size_t kNever = std::numeric_limits<std::size_t>::max();

// Of images and clouds one is enough, of opinions none too many.
bool needs_one_writer(const std::string& name) {
  return !is_type_name(name) || name.starts_with("rs.cv.") || name.starts_with("rs.pcl.");
}

bool contains(std::span<const std::string> names, const std::string& name) {
  return std::ranges::find(names, name) != names.end();
}

void warn(Names& warnings, std::string text) {
  if (!contains(warnings, text)) warnings.push_back(std::move(text));
}

// The texts that it may write as this; none: any.
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

// Whether it writes one of the names and may say one of the values.
bool may_write(const Annotator& annotator, const Wanted& wanted) {
  const auto is_wanted = [&](const std::string& value) {
    return std::ranges::any_of(wanted.values, [&](const std::string& one) { return boost::iequals(one, value); });
  };
  return std::ranges::any_of(wanted.names, [&](const std::string& name) {
    if (!provides(annotator, name)) return false;
    const Names values = wanted.values.empty() ? Names() : values_written(annotator, name);
    return values.empty() || std::ranges::any_of(values, is_wanted);
  });
}

std::set<std::string> as_set(const Names& names) { return {names.begin(), names.end()}; }

// Who writes what is wanted: those who may say one of the values, and where there is none, all.
struct Writers {
  Positions positions;
  std::string unsaid;  // that there is none
};

// `reader`: who wants it, and does not count.
Writers find_writers(const Annotators& annotators, const Positions& among, const Wanted& wanted, std::size_t reader,
                     const std::string& who) {
  Writers writers;
  for (const std::size_t i : among) {
    if (i != reader && may_write(*annotators[i], wanted)) writers.positions.push_back(i);
  }
  if (!writers.positions.empty() || wanted.values.empty()) return writers;
  std::set<std::string> known;
  for (const std::size_t i : among) {
    if (i == reader || !may_write(*annotators[i], {wanted.names})) continue;
    writers.positions.push_back(i);
    for (const std::string& name : wanted.names) known.merge(as_set(values_written(*annotators[i], name)));
  }
  if (!writers.positions.empty()) {
    writers.unsaid =
        fmt::format("nobody finds the {} '{}', which {} needs; what can be found: {}", fmt::join(wanted.names, " or "),
                    fmt::join(wanted.values, "' or '"), who, fmt::join(known, ", "));
  }
  return writers;
}

std::string quoted(const std::string& name) { return fmt::format("'{}'", name); }

std::string nobody_writes(const Wanted& wanted, const std::string& who) {
  return fmt::format("nobody writes '{}', which {} needs", fmt::join(wanted.names, "' or '"), who);
}

std::vector<Wanted> needs_of(const Annotator& annotator) {
  std::vector<Wanted> needs;
  for (const std::string& name : annotator.reads()) needs.push_back({{name}, annotator.read_values(name)});
  return needs;
}

class Planner {
 public:
  Planner(const Annotators& annotators, std::span<const std::string> given) : annotators_(annotators), given_(given) {
    for (std::size_t i = 0; i < annotators.size(); ++i) all_.push_back(i);
    for (const auto& annotator : annotators) {
      needs_.emplace_back();
      for (Wanted& wanted : needs_of(*annotator)) {
        Need need{std::move(wanted), {}, {}};
        if (!is_given(need.wanted)) {
          // Who changes what is there needs others' first.
          need.writers = find_writers(annotators, all_, need.wanted, needs_.size() - 1, quoted(annotator->name()));
        }
        needs_.back().push_back(std::move(need));
      }
    }
    find_ranks();
  }

  std::optional<Flow> plan(std::span<const Wanted> wanted, std::string& problem) {
    is_careful_.assign(annotators_.size(), false);
    while (true) {
      if (!take_all(wanted, problem)) return std::nullopt;
      if (auto flow = in_order()) return flow;
      // Nobody can begin the circle: its members read what could be written before them, and cheapest or not.
      for (std::size_t i = 0; i < annotators_.size(); ++i) {
        if (is_waiting(i) && waited_for(i) != kNever) is_careful_[i] = true;
      }
    }
  }

 private:
  struct Need {
    Wanted wanted;
    Writers writers;
    Positions chosen;  // of the writers
  };

  bool is_given(const Wanted& wanted) const {
    return std::ranges::any_of(wanted.names, [&](const std::string& name) { return contains(given_, name); });
  }

  // Who is needed, from what is wanted back.
  bool take_all(std::span<const Wanted> wanted, std::string& problem) {
    warnings_.clear();
    is_taken_.assign(annotators_.size(), false);
    Positions stack;
    for (const Wanted& one : wanted) {
      if (is_given(one)) continue;
      const Writers writers = find_writers(annotators_, all_, one, kNever, "the request");
      const Positions chosen = choose(one, writers, kNever);
      for (const std::size_t i : chosen) take(i, stack);
      if (!chosen.empty()) continue;
      const std::string why = reason(one, writers, "the request");
      if (one.is_needed) return problem = why, false;
      warn(warnings_, fmt::format("{} is not found: {}", fmt::join(one.names, " or "), why));
    }
    while (!stack.empty()) {
      const std::size_t i = stack.back();
      stack.pop_back();
      for (Need& need : needs_[i]) {
        if (is_given(need.wanted)) continue;
        need.chosen = choose(need.wanted, need.writers, is_careful_[i] ? rank_[i] : kNever);
        for (const std::size_t writer : need.chosen) take(writer, stack);
      }
    }
    return true;
  }

  // In how many rounds it could run, if each round all ran that have what they need. kNever: it cannot run.
  void find_ranks() {
    rank_.assign(annotators_.size(), kNever);
    std::vector<std::vector<std::pair<std::size_t, std::size_t>>> used_by(annotators_.size());  // whose need
    Positions missing(annotators_.size(), 0), round, next;
    for (std::size_t i = 0; i < annotators_.size(); ++i) {
      for (std::size_t n = 0; n < needs_[i].size(); ++n) {
        missing[i] += is_given(needs_[i][n].wanted) ? 0U : 1U;
        for (const std::size_t writer : needs_[i][n].writers.positions) used_by[writer].emplace_back(i, n);
      }
      if (missing[i] == 0) next.push_back(i);
    }
    std::set<std::pair<std::size_t, std::size_t>> met;
    for (std::size_t rank = 0; !next.empty(); ++rank) {
      round.swap(next);
      next.clear();
      for (const std::size_t i : round) rank_[i] = rank;
      for (const std::size_t i : round) {
        for (const auto& need : used_by[i]) {
          if (met.insert(need).second && --missing[need.first] == 0) next.push_back(need.first);
        }
      }
    }
  }

  // Of those who can run: the cheapest one of a view, all of a type. `before`: of a view, only who could run earlier than that.
  Positions choose(const Wanted& wanted, const Writers& writers, std::size_t before) {
    Positions able;
    for (const std::size_t i : writers.positions) {
      if (rank_[i] != kNever) able.push_back(i);
    }
    if (able.empty()) return able;
    if (!writers.unsaid.empty()) warn(warnings_, writers.unsaid);
    for (const std::size_t i : writers.positions) {
      if (rank_[i] == kNever) warn(warnings_, fmt::format("'{}' is left out: {}", annotators_[i]->name(), reason(i)));
    }
    if (!std::ranges::all_of(wanted.names, needs_one_writer)) return able;
    std::erase_if(able, [&](std::size_t i) { return rank_[i] >= before; });
    return {*std::ranges::min_element(able, {}, [&](std::size_t i) { return annotators_[i]->cost(); })};
  }

  void take(std::size_t i, Positions& stack) {
    if (is_taken_[i]) return;
    is_taken_[i] = true;
    stack.push_back(i);
  }

  // Why what is wanted cannot be had: nobody of its writers can run.
  std::string reason(const Wanted& wanted, const Writers& writers, const std::string& who) const {
    return writers.positions.empty() ? nobody_writes(wanted, who) : reason(writers.positions.front());
  }

  // Why it cannot run: down to what nobody writes, or round a circle.
  std::string reason(std::size_t i) const {
    Positions way;
    while (std::ranges::find(way, i) == way.end()) {
      way.push_back(i);
      const auto unmet = std::ranges::find_if(needs_[i], [&](const Need& need) {
        return !is_given(need.wanted) &&
               std::ranges::all_of(need.writers.positions, [&](std::size_t writer) { return rank_[writer] == kNever; });
      });
      if (unmet->writers.positions.empty()) return nobody_writes(unmet->wanted, quoted(annotators_[i]->name()));
      i = unmet->writers.positions.front();
    }
    Names names;
    for (auto member = std::ranges::find(way, i); member != way.end(); ++member) {
      names.push_back(annotators_[*member]->name());
    }
    return fmt::format("the flow goes in a circle: {} -> {} (each reads what the next one writes)",
                       fmt::join(names, " -> "), names.front());
  }

  // Those that are taken. Nothing: a circle that nobody can begin.
  std::optional<Flow> in_order() {
    Flow flow;
    flow.warnings = warnings_;
    step_.assign(annotators_.size(), kNever);
    const auto taken = static_cast<std::size_t>(std::ranges::count(is_taken_, true));
    while (flow.order.size() < taken) {
      std::size_t next = 0;
      while (next < annotators_.size() && !(is_waiting(next) && has_all(next))) ++next;
      if (next == annotators_.size()) next = beginning_of_a_circle();
      if (next == kNever) return std::nullopt;
      flow.inputs.push_back(inputs_of(next));
      step_[next] = flow.order.size();
      flow.order.push_back(next);
    }
    return flow;
  }

  bool is_waiting(std::size_t i) const { return is_taken_[i] && step_[i] == kNever; }

  bool has_all(std::size_t i) const {
    return std::ranges::all_of(needs_[i], [&](const Need& need) {
      return std::ranges::all_of(need.chosen, [&](std::size_t writer) { return step_[writer] != kNever; });
    });
  }

  bool has_one_of_each(std::size_t i) const {
    return std::ranges::all_of(needs_[i], [&](const Need& need) {
      return need.chosen.empty() ||
             std::ranges::any_of(need.chosen, [&](std::size_t writer) { return step_[writer] != kNever; });
    });
  }

  // The first of the list that can go on, in a circle that waits for nobody outside. kNever: there is none.
  std::size_t beginning_of_a_circle() const {
    std::size_t best = kNever, least = kNever;
    for (std::size_t i = 0; i < annotators_.size(); ++i) {
      if (!is_waiting(i)) continue;
      // Of those that wait for themselves, whoever waits for the fewest is in such a circle, which is all that it waits for.
      const std::size_t count = waited_for(i);
      if (count == kNever) continue;
      const bool is_ready = has_one_of_each(i);
      if (count < least || (count == least && best == kNever && is_ready)) {
        best = is_ready ? i : kNever;
        least = count;
      }
    }
    return best;
  }

  // How many, itself too. kNever: it does not wait for itself.
  std::size_t waited_for(std::size_t start) const {
    std::vector<bool> is_met(annotators_.size(), false);
    Positions stack = {start};
    std::size_t count = 0;
    while (!stack.empty()) {
      const std::size_t i = stack.back();
      stack.pop_back();
      for (const Need& need : needs_[i]) {
        for (const std::size_t writer : need.chosen) {
          if (!is_waiting(writer) || is_met[writer]) continue;
          is_met[writer] = true;
          ++count;
          stack.push_back(writer);
        }
      }
    }
    return is_met[start] ? count : kNever;
  }

  std::vector<Flow::Input> inputs_of(std::size_t i) const {
    std::map<std::size_t, Names> names;  // by step
    for (const Need& need : needs_[i]) {
      for (const std::size_t writer : need.chosen) {
        if (step_[writer] != kNever) names[step_[writer]].push_back(need.wanted.names.front());
      }
    }
    std::vector<Flow::Input> inputs;
    for (auto& [from, list] : names) inputs.push_back({from, std::move(list)});
    return inputs;
  }

  const Annotators& annotators_;
  std::span<const std::string> given_;
  Positions all_;
  std::vector<std::vector<Need>> needs_;  // of each annotator
  Positions rank_;
  Names warnings_;
  std::vector<bool> is_careful_, is_taken_;
  Positions step_;  // in the flow
};

// The positions of the names. Nothing: one is unknown, or there twice.
std::optional<Positions> positions_of(const Annotators& annotators, std::span<const std::string> names,
                                      std::string& problem) {
  Positions order;
  for (const std::string& name : names) {
    const auto found = std::ranges::find_if(annotators, [&](const auto& a) { return a->name() == name; });
    if (found == annotators.end()) return problem = fmt::format("there is no annotator '{}'", name), std::nullopt;
    const auto position = static_cast<std::size_t>(found - annotators.begin());
    if (std::ranges::find(order, position) != order.end()) {
      return problem = fmt::format("'{}' is in the flow twice", name), std::nullopt;
    }
    order.push_back(position);
  }
  return order;
}

// The first after the step who may write what it needs, and does not need that itself. Nothing: there is none.
const Annotator* find_late(const Annotators& annotators, const Positions& order, std::size_t step, const Wanted& need) {
  for (std::size_t later = step + 1; later < order.size(); ++later) {
    const Annotator& annotator = *annotators[order[later]];
    if (may_write(annotator, need) && !contains(annotator.reads(), need.names.front())) return &annotator;
  }
  return nullptr;
}

}  // namespace

bool provides(const Annotator& annotator, const std::string& name) {
  const auto writes = annotator.writes();
  return std::ranges::any_of(writes, [&](const std::string& written) {
    return is_type_name(name) ? is_annotation_of(written, name) : written == name;
  });
}

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
  return Planner(annotators, given).plan(wanted, problem);
}

std::optional<Flow> fixed_flow(const Annotators& annotators, std::span<const std::string> given,
                               std::span<const std::string> names, std::span<const Wanted> wanted,
                               std::string& problem) {
  const auto order = positions_of(annotators, names, problem);
  if (!order) return std::nullopt;
  Flow flow;
  Positions before;
  for (std::size_t step = 0; step < order->size(); ++step) {
    const Annotator& annotator = *annotators[(*order)[step]];
    std::map<std::size_t, Names> inputs;
    for (const Wanted& need : needs_of(annotator)) {
      if (contains(given, need.names.front())) continue;
      Writers writers = find_writers(annotators, before, need, kNever, quoted(annotator.name()));
      const Annotator* late = find_late(annotators, *order, step, need);
      if (late != nullptr && (writers.positions.empty() || !writers.unsaid.empty())) {
        problem = fmt::format("'{}' runs before '{}', whose results it reads", annotator.name(), late->name());
        return std::nullopt;
      }
      if (writers.positions.empty()) {
        problem = fmt::format("nobody in the flow writes '{}', which '{}' needs", need.names.front(), annotator.name());
        return std::nullopt;
      }
      if (!writers.unsaid.empty()) warn(flow.warnings, writers.unsaid);
      if (late != nullptr && !needs_one_writer(need.names.front())) {
        warn(flow.warnings, fmt::format("'{}' runs before '{}', whose {} it could read", annotator.name(), late->name(),
                                        need.names.front()));
      }
      if (needs_one_writer(need.names.front())) writers.positions = {writers.positions.back()};
      for (const std::size_t writer : writers.positions) {
        inputs[static_cast<std::size_t>(std::ranges::find(before, writer) - before.begin())].push_back(
            need.names.front());
      }
    }
    flow.inputs.emplace_back();
    for (auto& [from, list] : inputs) flow.inputs.back().push_back({from, std::move(list)});
    before.push_back((*order)[step]);
  }
  for (const Wanted& one : wanted) {
    const Writers writers = find_writers(annotators, before, one, kNever, "the request");
    if (writers.positions.empty()) warn(flow.warnings, "in the flow " + nobody_writes(one, "the request"));
    if (!writers.unsaid.empty()) warn(flow.warnings, writers.unsaid);
  }
  flow.order = *order;
  return flow;
}

}  // namespace sherlog::rgbd
