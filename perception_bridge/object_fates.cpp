#include "perception_bridge/object_fates.h"

#include <cmath>
#include <vector>

namespace sherlog {
namespace {

// What has happened to the object so far: three bits.
constexpr std::size_t kOn = 1, kMoved = 2, kChanged = 4, kStates = 8;

// probability[state][objects on tables]
using Distribution = std::vector<std::vector<double>>;

Distribution after_one_action(const Distribution& before, const FourTablesConfig& config) {
  const std::size_t objects = config.objects;
  Distribution after(kStates, std::vector<double>(objects + 1, 0.0));
  for (std::size_t state = 0; state < kStates; ++state) {
    for (std::size_t on = 0; on <= objects; ++on) {
      const double p = before[state][on];
      if (p <= 0) continue;
      const std::size_t off = objects - on;
      const double put = off > 0 ? config.put_weight : 0, remove = on > 0 ? config.remove_weight : 0;
      const double move = on > 0 ? config.move_weight : 0, change = on > 0 ? config.change_weight : 0;
      const double total = put + remove + move + change;
      if (total <= 0) {
        after[state][on] += p;
        continue;
      }
      const bool is_on = (state & kOn) != 0;
      // The share of each kind's objects that this one is.
      const double me_on = is_on ? 1.0 / static_cast<double>(on) : 0,
                   me_off = is_on ? 0 : 1.0 / static_cast<double>(off);
      const auto go = [&](std::size_t next, std::size_t next_on, double share) {
        if (share > 0) after[next][next_on] += p * share / total;
      };
      go(state | kOn | kMoved, on + 1, put * me_off);
      go(state, on + 1, put * (1 - me_off));
      go(state & ~kOn, on - 1, remove * me_on);
      go(state, on - 1, remove * (1 - me_on));
      go(state | kMoved, on, move * me_on);
      go(state | kChanged, on, change * me_on);
      go(state, on, (move + change) * (1 - me_on));
    }
  }
  return after;
}

}  // namespace

ObjectFates object_fates(const FourTablesConfig& config) {
  const auto filled = static_cast<std::size_t>(std::lround(config.start_fill * config.objects));
  const auto final_states = [&](bool on_at_first) {
    Distribution d(kStates, std::vector<double>(config.objects + 1, 0.0));
    d[on_at_first ? kOn : 0][filled] = 1.0;
    for (std::uint32_t i = 0; i < config.actions; ++i) d = after_one_action(d, config);
    std::vector<double> sums(kStates, 0.0);
    for (std::size_t state = 0; state < kStates; ++state) {
      for (double p : d[state]) sums[state] += p;
    }
    return sums;
  };
  ObjectFates fates;
  if (filled > 0) {
    const std::vector<double> p = final_states(true);
    fates.untouched = p[kOn];
    fates.moved = p[kOn | kMoved];
    fates.changed = p[kOn | kChanged];
    fates.moved_and_changed = p[kOn | kMoved | kChanged];
    fates.gone = 1 - fates.untouched - fates.moved - fates.changed - fates.moved_and_changed;
  }
  if (filled < config.objects) {
    const std::vector<double> p = final_states(false);
    for (std::size_t state = 0; state < kStates; ++state) fates.put += (state & kOn) != 0 ? p[state] : 0.0;
  }
  return fates;
}

}  // namespace sherlog
