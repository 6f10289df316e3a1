#include "rgbd/synthetic/random_kitchen.h"

#include <algorithm>
#include <numeric>
#include <random>

#include "rgbd/synthetic/kitchen.h"

namespace sherlog::rgbd {
namespace {

using Placed = RandomKitchen::Placed;

double unit(std::mt19937_64& random) { return static_cast<double>(random() >> 11) * 0x1p-53; }

// At a place that nobody has, if there is one.
void put(std::vector<Placed>& now, std::size_t kind, std::mt19937_64& random) {
  constexpr int kTrials = 200;
  constexpr double kApart = 0.02;
  for (int trial = 0; trial < kTrials; ++trial) {
    const double x = -0.45 + 0.9 * unit(random), y = 0.95 + 0.45 * unit(random), heading = 3 * unit(random) - 1.5;
    const Placed placed{kind, {x, y, kTableHeight}, heading};
    const bool is_free = std::ranges::all_of(now, [&](const Placed& other) {
      const double reach = (things()[kind].size.head<2>().norm() + things()[other.kind].size.head<2>().norm()) / 2;
      return (placed.foot - other.foot).norm() > reach + kApart;
    });
    if (is_free) return now.push_back(placed);
  }
}

}  // namespace

Scene RandomKitchen::scene(std::size_t step) const {
  Scene scene;
  for (const Placed& placed : steps[step]) {
    const Thing& thing = things()[placed.kind];
    const bool was_here = std::ranges::any_of(steps.front(), [&](const Placed& first) {
      return first.kind == placed.kind && first.foot == placed.foot && first.heading == placed.heading;
    });
    add_thing(scene, thing, thing.object_class, placed.foot, placed.heading, !was_here);
  }
  return scene;
}

RandomKitchen random_kitchen(std::uint64_t seed, std::size_t steps) {
  constexpr std::size_t kFirst = 6;
  std::mt19937_64 random(seed);
  std::vector<std::size_t> kinds(things().size());
  std::iota(kinds.begin(), kinds.end(), 0U);
  for (std::size_t i = kinds.size() - 1; i > 0; --i) std::swap(kinds[i], kinds[random() % (i + 1)]);
  RandomKitchen kitchen;
  std::vector<Placed> now;
  for (std::size_t i = 0; i < kFirst; ++i) put(now, kinds[i], random);
  kitchen.steps.push_back(now);
  while (kitchen.steps.size() < steps) {
    const std::size_t which = random() % kinds.size();
    const auto at = std::ranges::find(now, kinds[which], &Placed::kind);
    const bool is_there = at != now.end();
    if (is_there) now.erase(at);
    if (!is_there || random() % 10 < 6) put(now, kinds[which], random);
    kitchen.steps.push_back(now);
  }
  return kitchen;
}

}  // namespace sherlog::rgbd
