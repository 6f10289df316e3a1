#include "perception_bridge/four_tables.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "perception_bridge/portable_random.h"

namespace sherlog {
namespace {

struct WorldObject {
  bool on_table = false;
  std::uint32_t table = 1;
  Position position{};
  Color color{};
};

class Simulation {
 public:
  Simulation(const FourTablesConfig& config, std::uint64_t seed, std::uint64_t number)
      : config_(config), random_(seed, number), objects_(config.objects), histories_(config.objects) {
    trial_.seed = seed;
    trial_.number = number;
    trial_.config = config;
  }

  FourTablesTrial run() && {
    set_up();
    for (std::uint32_t object : shuffled()) {
      if (objects_[object].on_table) trial_.old_clusters.push_back(observe(object));
    }
    const std::vector<WorldObject> before = objects_;
    for (std::uint32_t i = 0; i < config_.actions; ++i) act();
    stand_somewhere();
    for (std::uint32_t object : shuffled()) {
      const WorldObject& o = objects_[object];
      if (o.on_table && trial_.view.contains(o.table, o.position)) trial_.new_clusters.push_back(observe(object));
    }
    for (Observation& old : trial_.old_clusters) {
      old.out_of_view = !trial_.view.contains(old.table, old.position);
      old.place_in_view = trial_.view.contains(old.table, before[old.object].position);
    }
    trial_.truth = true_resolution(trial_, histories_);
    return std::move(trial_);
  }

 private:
  void set_up() {
    for (WorldObject& object : objects_) recolor(object);
    const auto filled = static_cast<std::size_t>(std::lround(config_.start_fill * config_.objects));
    const std::vector<std::uint32_t> order = shuffled();
    for (std::size_t i = 0; i < filled; ++i) place(objects_[order[i]]);
  }

  std::vector<std::uint32_t> shuffled() {
    std::vector<std::uint32_t> order(config_.objects);
    std::iota(order.begin(), order.end(), 0u);
    for (std::uint32_t i = config_.objects; i > 1; --i) std::swap(order[i - 1], order[random_.below(i)]);
    return order;
  }

  void recolor(WorldObject& object) {
    for (double& channel : object.color) channel = random_.uniform();
  }

  void place(WorldObject& object) {
    object.on_table = true;
    object.table = 1 + random_.below(config_.tables);
    object.position = {random_.uniform(0, config_.table_width), random_.uniform(0, config_.table_depth)};
  }

  // A kind by its weight among those that are possible, then an object to which it can happen.
  void act() {
    std::vector<std::uint32_t> on, off;
    for (std::uint32_t o = 0; o < config_.objects; ++o) (objects_[o].on_table ? on : off).push_back(o);
    const std::array<double, 4> weights = {off.empty() ? 0 : config_.put_weight, on.empty() ? 0 : config_.remove_weight,
                                           on.empty() ? 0 : config_.move_weight,
                                           on.empty() ? 0 : config_.change_weight};
    double point = random_.uniform() * (weights[0] + weights[1] + weights[2] + weights[3]);
    std::optional<std::size_t> kind;
    for (std::size_t k = 0; k < weights.size(); ++k) {
      if (weights[k] <= 0) continue;
      kind = k;
      if (point < weights[k]) break;
      point -= weights[k];
    }
    if (!kind) return;  // nothing can happen
    SimulatedAction action;
    action.kind = static_cast<ActionKind>(*kind);
    const std::vector<std::uint32_t>& candidates = action.kind == ActionKind::kPut ? off : on;
    action.object = candidates[random_.below(static_cast<std::uint32_t>(candidates.size()))];
    apply(action);
    trial_.actions.push_back(action);
  }

  void apply(const SimulatedAction& action) {
    WorldObject& object = objects_[action.object];
    ObjectHistory& history = histories_[action.object];
    switch (action.kind) {
      case ActionKind::kPut:
      case ActionKind::kMove:
        place(object);
        history.moved = true;
        break;
      case ActionKind::kRemove:
        object.on_table = false;
        break;
      case ActionKind::kChange:
        recolor(object);
        history.changed = true;
        break;
    }
  }

  void stand_somewhere() {
    View& view = trial_.view;
    view.table = 1 + random_.below(config_.tables);
    const double middle = 0.5 * config_.table_width + random_.uniform(-config_.sensor_range, config_.sensor_range);
    view.min = {std::max(0.0, middle - 0.5 * config_.view_width), 0.0};
    view.max = {std::min(config_.table_width, middle + 0.5 * config_.view_width), config_.table_depth};
  }

  Observation observe(std::uint32_t number) {
    const WorldObject& object = objects_[number];
    Observation seen;
    seen.object = number;
    seen.table = object.table;
    const Position size = {config_.table_width, config_.table_depth};
    for (std::size_t axis = 0; axis < size.size(); ++axis) {
      seen.position[axis] = measure(object.position[axis], size[axis]);
    }
    for (std::size_t channel = 0; channel < seen.color.size(); ++channel) {
      seen.color[channel] = measure(object.color[channel], 1.0);
    }
    return seen;
  }

  double measure(double value, double most) {
    return std::clamp(std::fma(config_.noise, random_.normal(), value), 0.0, most);
  }

  const FourTablesConfig& config_;
  PortableRandom random_;
  std::vector<WorldObject> objects_;
  std::vector<ObjectHistory> histories_;
  FourTablesTrial trial_;
};

}  // namespace

std::string_view to_string(ActionKind kind) {
  static constexpr std::array<std::string_view, 4> kNames = {"put", "remove", "move", "change"};
  return kNames[static_cast<std::size_t>(kind)];
}

std::string_view to_string(ClusterExplanation explanation) {
  static constexpr std::array<std::string_view, 6> kNames = {"stay",      "move",   "newview",
                                                             "disappear", "hidden", "appear"};
  return kNames[static_cast<std::size_t>(explanation)];
}

FourTablesTrial simulate_four_tables(const FourTablesConfig& config, std::uint64_t seed, std::uint64_t number) {
  return Simulation(config, seed, number).run();
}

Resolution true_resolution(const FourTablesTrial& trial, const std::vector<ObjectHistory>& histories) {
  Resolution truth;
  truth.association.resize(trial.new_clusters.size());
  for (std::uint32_t o = 0; o < trial.old_clusters.size(); ++o) {
    const Observation& old = trial.old_clusters[o];
    const auto seen =
        std::ranges::find_if(trial.new_clusters, [&](const Observation& n) { return n.object == old.object; });
    if (seen == trial.new_clusters.end()) {
      const bool in_view = trial.view.contains(old.table, old.position);
      truth.explanation.push_back(in_view ? ClusterExplanation::kDisappear : ClusterExplanation::kHidden);
      continue;
    }
    truth.association[static_cast<std::size_t>(seen - trial.new_clusters.begin())] = o;
    const ObjectHistory& history = histories[old.object];
    truth.explanation.push_back(history.moved     ? ClusterExplanation::kMove
                                : history.changed ? ClusterExplanation::kNewview
                                                  : ClusterExplanation::kStay);
  }
  return truth;
}

}  // namespace sherlog
