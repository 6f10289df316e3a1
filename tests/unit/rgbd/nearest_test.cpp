#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>
#include <random>
#include <set>
#include <vector>

#include "rgbd/nearest/hilbert_curve.h"
#include "rgbd/nearest/keypoint_queue.h"
#include "rgbd/nearest/nearest_map.h"
#include "rgbd/nearest/van_emde_boas.h"

namespace sherlog::rgbd {
namespace {

using Random = std::mt19937_64;

Pixel random_pixel(Random& random, std::int32_t width, std::int32_t height) {
  return {static_cast<std::int32_t>(random() % static_cast<std::uint64_t>(width)),
          static_cast<std::int32_t>(random() % static_cast<std::uint64_t>(height))};
}

std::vector<Pixel> random_pixels(Random& random, std::size_t count, std::int32_t width, std::int32_t height) {
  std::vector<Pixel> pixels;
  for (std::size_t i = 0; i < count; ++i) pixels.push_back(random_pixel(random, width, height));
  return pixels;
}

double distance(Pixel a, Pixel b) { return std::hypot(a.x - b.x, a.y - b.y); }

// --- the curve

TEST(HilbertCurve, VisitsEachCellOnceAndGoesToNeighboursOnly) {
  for (std::uint32_t order = 0; order <= 11; ++order) {
    SCOPED_TRACE(order);
    const std::int32_t side = std::int32_t{1} << order;
    std::vector<bool> seen(static_cast<std::size_t>(side) * static_cast<std::size_t>(side));
    Pixel before{-1, 0};
    bool steps = true, inverse = true;
    for (std::uint32_t i = 0; i < seen.size(); ++i) {
      const Pixel p = hilbert_pixel(order, i);
      ASSERT_TRUE(p.x >= 0 && p.y >= 0 && p.x < side && p.y < side);
      seen[static_cast<std::size_t>(p.y * side + p.x)] = true;
      inverse = inverse && hilbert_index(order, p) == i;
      steps = steps && std::abs(p.x - before.x) + std::abs(p.y - before.y) == 1;
      before = p;
    }
    EXPECT_TRUE(steps && inverse);
    EXPECT_TRUE(std::ranges::all_of(seen, [](bool b) { return b; }));
  }
}

TEST(HilbertCurve, TablesAreTheCurveInsideOfTheImage) {
  for (const auto& [width, height] : {std::pair{1, 1}, {1, 9}, {7, 3}, {64, 64}, {100, 33}, {640, 480}}) {
    const HilbertMap map = make_hilbert_map(width, height);
    ASSERT_EQ(map.order, hilbert_order(width, height));
    ASSERT_EQ(map.pixels.size(), static_cast<std::size_t>(width * height));
    EXPECT_TRUE(std::ranges::is_sorted(map.indices));
    for (std::int32_t y = 0; y < height; ++y) {
      for (std::int32_t x = 0; x < width; ++x) ASSERT_EQ(map.index({x, y}), hilbert_index(map.order, {x, y}));
    }
    for (std::size_t i = 0; i < map.pixels.size(); ++i) {
      const auto pixel = static_cast<std::int32_t>(map.pixels[i]);
      ASSERT_EQ(map.indices[i], map.index({pixel % width, pixel / width}));
    }
  }
  const HilbertMap vga = make_hilbert_map(640, 480);
  EXPECT_EQ(vga.cell_count(), 1024u * 1024u);
  EXPECT_NEAR(static_cast<double>(vga.pixels.size()) / static_cast<double>(vga.cell_count()), 0.293, 0.0005);
}

// Close on the curve is close in the plane: mean distance about the square root (Fig. 4 left, over all pairs).
TEST(HilbertCurve, MeanDistanceInThePlaneGrowsLikeTheRoot) {
  const std::array<std::pair<std::uint32_t, double>, 5> expected{
      {{1, 1.0}, {2, 1.54}, {4, 2.11}, {5, 2.39}, {10, 3.57}}};
  for (const auto& [apart, mean] : expected) {
    double sum = 0.0;
    const std::uint32_t pairs = 65536 - apart;
    for (std::uint32_t i = 0; i < pairs; ++i) sum += distance(hilbert_pixel(8, i), hilbert_pixel(8, i + apart));
    EXPECT_NEAR(sum / pairs, mean, 0.05) << apart;
  }
}

// The other way round it is close in the median only (Fig. 4 right).
TEST(HilbertCurve, MedianDistanceOnTheCurveOfClosePixels) {
  const std::array<double, 9> expected{3, 11, 20, 41, 57, 84, 109, 154, 190};
  std::array<std::vector<double>, 10> apart;
  Random random(5);
  std::uint32_t greatest = 0;
  while (std::ranges::any_of(apart.begin() + 1, apart.end(), [](const auto& list) { return list.size() < 20000; })) {
    const Pixel p = random_pixel(random, 256, 256);
    const Pixel q{p.x + static_cast<std::int32_t>(random() % 19) - 9,
                  p.y + static_cast<std::int32_t>(random() % 19) - 9};
    const double d = distance(p, q);
    if (d >= 9.5 || d < 0.5 || q.x < 0 || q.y < 0 || q.x > 255 || q.y > 255) continue;
    const std::uint32_t a = hilbert_index(8, p), b = hilbert_index(8, q), difference = a > b ? a - b : b - a;
    apart[static_cast<std::size_t>(std::lround(d))].push_back(difference);
    greatest = std::max(greatest, difference);
  }
  for (std::size_t d = 1; d < apart.size(); ++d) {
    auto& list = apart[d];
    std::nth_element(list.begin(), list.begin() + static_cast<std::ptrdiff_t>(list.size() / 2), list.end());
    EXPECT_NEAR(list[list.size() / 2], expected[d - 1], std::max(1.0, 0.1 * expected[d - 1])) << d;
  }
  EXPECT_NEAR(greatest, 54000.0, 5400.0);
}

// --- the ordered set

// A million operations in all.
TEST(VanEmdeBoasSet, IsAnOrderedSet) {
  for (const std::uint32_t bits : {1u, 5u, 6u, 7u, 12u, 13u, 16u, 22u}) {
    SCOPED_TRACE(bits);
    VanEmdeBoasSet set(bits);
    std::set<std::uint32_t> twin;
    Random random(bits);
    const std::uint64_t size = std::uint64_t{1} << bits;
    for (int step = 0; step < 125000; ++step) {
      // Now dense, now sparse, and every few steps in one corner.
      const auto x =
          static_cast<std::uint32_t>(step % 3 == 0 ? random() % std::min<std::uint64_t>(size, 300) : random() % size);
      if (random() % 100 < (step / 20000 % 2 == 0 ? 60u : 35u)) {
        set.insert(x), twin.insert(x);
      } else {
        set.erase(x), twin.erase(x);
      }
      const auto y = static_cast<std::uint32_t>(random() % size);
      ASSERT_EQ(set.contains(y), twin.contains(y));
      const auto above = twin.lower_bound(y);
      ASSERT_EQ(set.successor(y), above == twin.end() ? std::nullopt : std::optional(*above));
      const auto behind = twin.upper_bound(y);
      ASSERT_EQ(set.predecessor(y), behind == twin.begin() ? std::nullopt : std::optional(*std::prev(behind)));
      ASSERT_EQ(set.empty(), twin.empty());
    }
    while (!twin.empty()) set.erase(*twin.begin()), twin.erase(twin.begin());
    EXPECT_TRUE(set.empty());
  }
}

// --- nearest neighbours

// Nearest along the curve by looking at all; of two, the one before.
std::vector<std::uint32_t> nearest_by_hand(const HilbertMap& map, std::span<const Pixel> keypoints, Pixel q) {
  std::vector<std::uint32_t> order(keypoints.size());
  for (std::uint32_t k = 0; k < order.size(); ++k) order[k] = k;
  const auto here = static_cast<std::int64_t>(map.index(q));
  const auto rank = [&](std::uint32_t k) {
    const auto there = static_cast<std::int64_t>(map.index(keypoints[k]));
    return std::tuple(std::abs(there - here), there >= here);
  };
  std::ranges::stable_sort(order, {}, rank);
  return order;
}

TEST(NearestMap, HoldsTheNearestOnTheCurve) {
  Random random(1);
  for (int run = 0; run < 60; ++run) {
    const auto width = static_cast<std::int32_t>(1 + random() % 40),
               height = static_cast<std::int32_t>(1 + random() % 40);
    const HilbertMap map = make_hilbert_map(width, height);
    NearestMap nearest(map);
    for (const std::size_t count : {1u, 2u, 7u, 60u}) {  // the same map again
      const std::vector<Pixel> keypoints = random_pixels(random, count, width, height);
      ASSERT_TRUE(nearest.assign(keypoints));
      for (std::int32_t y = 0; y < height; ++y) {
        for (std::int32_t x = 0; x < width; ++x) {
          const Pixel expected = keypoints[nearest_by_hand(map, keypoints, {x, y})[0]];
          ASSERT_EQ(keypoints[nearest.nearest({x, y})], expected) << x << ", " << y;
        }
      }
    }
  }
}

TEST(NearestMap, RefusesNothingAndWhatLiesOutside) {
  const HilbertMap map = make_hilbert_map(20, 10);
  NearestMap nearest(map);
  const std::vector<Pixel> good{{3, 4}};
  ASSERT_TRUE(nearest.assign(good));
  EXPECT_FALSE(nearest.assign({}));
  for (const Pixel p : {Pixel{-1, 0}, Pixel{20, 0}, Pixel{0, 10}, Pixel{0, -1}}) {
    const std::vector<Pixel> bad{{0, 0}, p};
    EXPECT_FALSE(nearest.assign(bad));
    EXPECT_FALSE(KeypointQueue(map).assign(bad));
  }
  EXPECT_EQ(nearest.nearest({19, 9}), 0u);
}

TEST(KeypointQueue, FindsTheNearestKOnTheCurve) {
  Random random(2);
  for (int run = 0; run < 60; ++run) {
    const auto width = static_cast<std::int32_t>(1 + random() % 60),
               height = static_cast<std::int32_t>(1 + random() % 60);
    const HilbertMap map = make_hilbert_map(width, height);
    KeypointQueue queue(map);
    for (const std::size_t count : {0u, 1u, 2u, 9u, 80u}) {
      const std::vector<Pixel> keypoints = random_pixels(random, count, width, height);
      ASSERT_TRUE(queue.assign(keypoints));
      for (const std::size_t k : {0u, 1u, 2u, 5u, 8u, 200u}) {
        const Pixel q = random_pixel(random, width, height);
        std::vector<std::uint32_t> found;
        queue.nearest(q, k, found);
        const std::vector<std::uint32_t> expected = nearest_by_hand(map, keypoints, q);
        ASSERT_EQ(found.size(), std::min(k, count));
        EXPECT_EQ(std::set<std::uint32_t>(found.begin(), found.end()).size(), found.size());
        for (std::size_t i = 0; i < found.size(); ++i) EXPECT_EQ(keypoints[found[i]], keypoints[expected[i]]);
      }
    }
  }
}

// About half of the answers are the exact ones, however many keypoints there are (Fig. 5), and the others are near.
TEST(KeypointQueue, IsExactForAboutHalfOfTheQueries) {
  const std::map<std::size_t, double> expected{{10, 0.61},  {30, 0.61},   {100, 0.56}, {240, 0.55},
                                               {500, 0.55}, {1000, 0.56}, {2000, 0.57}};
  Random random(3);
  const HilbertMap map = make_hilbert_map(256, 256);
  KeypointQueue queue(map);
  for (const auto& [count, share] : expected) {
    const int images = count < 100 ? 2000 : 60, queries = count < 100 ? 20 : 150;  // answers on one image are alike
    std::size_t exact = 0;
    double ratio = 0.0, ratios = 0.0;
    for (int image = 0; image < images; ++image) {
      const std::vector<Pixel> keypoints = random_pixels(random, count, 256, 256);
      ASSERT_TRUE(queue.assign(keypoints));
      for (int i = 0; i < queries; ++i) {
        const Pixel q = random_pixel(random, 256, 256);
        std::vector<std::uint32_t> found;
        queue.nearest(q, 1, found);
        double best = 1e9;
        for (const Pixel p : keypoints) best = std::min(best, distance(p, q));
        const double got = distance(keypoints[found[0]], q);
        exact += got == best ? 1u : 0u;
        if (best > 0.0) ratio += got / best, ratios += 1.0;
      }
    }
    EXPECT_NEAR(static_cast<double>(exact) / (images * queries), share, 0.03) << count;
    EXPECT_NEAR(ratio / ratios, 1.365, 0.055 + 0.03) << count;  // 1.31 ... 1.42
  }
}

// Cells of 240 keypoints: 55 % of the pixels are in the right one (Fig. 6).
TEST(NearestMap, PutsMoreThanHalfOfThePixelsIntoTheExactCell) {
  Random random(6);
  const HilbertMap map = make_hilbert_map(256, 256);
  NearestMap nearest(map);
  std::size_t equal = 0;
  constexpr int kImages = 8;
  for (int image = 0; image < kImages; ++image) {
    const std::vector<Pixel> keypoints = random_pixels(random, 240, 256, 256);
    ASSERT_TRUE(nearest.assign(keypoints));
    for (std::int32_t y = 0; y < 256; ++y) {
      for (std::int32_t x = 0; x < 256; ++x) {
        const auto squared = [&](Pixel p) { return (p.x - x) * (p.x - x) + (p.y - y) * (p.y - y); };
        const std::int32_t best = squared(*std::ranges::min_element(keypoints, {}, squared));
        equal += squared(keypoints[nearest.nearest({x, y})]) == best ? 1U : 0U;
      }
    }
  }
  EXPECT_NEAR(static_cast<double>(equal) / (kImages * 65536), 0.55, 0.03);
}

// Branches of a skeleton: straight lines of pixels, at any angle.
TEST(KeypointQueue, NeighboursTellTheDirectionOfABranch) {
  Random random(4);
  const HilbertMap map = make_hilbert_map(640, 480);
  KeypointQueue queue(map);
  std::vector<double> errors;
  for (int run = 0; run < 100; ++run) {
    const double angle = std::numbers::pi * (static_cast<double>(random() % 1000) / 1000.0 - 0.5);
    std::vector<Pixel> branch;
    for (double t = -100.0; t <= 100.0; t += 0.5) {
      const Pixel p{static_cast<std::int32_t>(std::lround(320 + t * std::cos(angle))),
                    static_cast<std::int32_t>(std::lround(240 + t * std::sin(angle)))};
      if (branch.empty() || branch.back() != p) branch.push_back(p);
    }
    ASSERT_TRUE(queue.assign(branch));
    for (const double direction : local_directions(queue, branch, 8)) {
      double error = std::abs(direction - angle);
      error = std::min(error, std::numbers::pi - error);
      errors.push_back(error * 180.0 / std::numbers::pi);
    }
  }
  std::ranges::nth_element(errors, errors.begin() + static_cast<std::ptrdiff_t>(errors.size() / 2));
  EXPECT_LT(errors[errors.size() / 2], 10.0);
}

}  // namespace
}  // namespace sherlog::rgbd
