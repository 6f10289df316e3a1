// Nearest keypoint of every pixel: along the Hilbert curve against a kd-tree (nanoflann, exact), at the sizes of the paper's
// figures. The two numbers to compare are rows of one run; what is done once for an image size is a row of its own.
#include <benchmark/benchmark.h>

#include <nanoflann.hpp>
#include <random>
#include <vector>

#include "rgbd/nearest/hilbert_curve.h"
#include "rgbd/nearest/keypoint_queue.h"
#include "rgbd/nearest/nearest_map.h"

namespace {

using namespace sherlog::rgbd;

struct Case {
  std::int32_t width, height;
  std::size_t keypoints;
};
constexpr Case kCases[] = {{1920, 1200, 4753}, {1280, 800, 4694}, {640, 480, 500}};

std::vector<Pixel> keypoints(const Case& c) {
  std::mt19937_64 random(1);
  std::vector<Pixel> points;
  for (std::size_t i = 0; i < c.keypoints; ++i) {
    points.push_back({static_cast<std::int32_t>(random() % static_cast<std::uint64_t>(c.width)),
                      static_cast<std::int32_t>(random() % static_cast<std::uint64_t>(c.height))});
  }
  return points;
}

const Case& chosen(benchmark::State& state) {
  const Case& c = kCases[state.range(0)];
  state.SetLabel(std::to_string(c.width) + " x " + std::to_string(c.height) + ", " + std::to_string(c.keypoints));
  return c;
}

void OnceForASize(benchmark::State& state) {
  const Case& c = chosen(state);
  for (auto _ : state) benchmark::DoNotOptimize(make_hilbert_map(c.width, c.height));
}
BENCHMARK(OnceForASize)->DenseRange(0, 2)->Unit(benchmark::kMillisecond);

void AllPixelsByCurve(benchmark::State& state) {
  const Case& c = chosen(state);
  const std::vector<Pixel> points = keypoints(c);
  const HilbertMap map = make_hilbert_map(c.width, c.height);
  NearestMap nearest(map);
  for (auto _ : state) {
    nearest.assign(points);
    benchmark::DoNotOptimize(nearest.nearest().data());
  }
}
BENCHMARK(AllPixelsByCurve)->DenseRange(0, 2)->Unit(benchmark::kMillisecond);

struct Cloud {
  const std::vector<Pixel>& points;
  std::size_t kdtree_get_point_count() const { return points.size(); }
  float kdtree_get_pt(std::size_t i, std::size_t dimension) const {
    return static_cast<float>(dimension == 0 ? points[i].x : points[i].y);
  }
  template <class Box>
  bool kdtree_get_bbox(Box&) const {
    return false;
  }
};
using Tree = nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<float, Cloud>, Cloud, 2>;

void AllPixelsByTree(benchmark::State& state) {
  const Case& c = chosen(state);
  const std::vector<Pixel> points = keypoints(c);
  const Cloud cloud{points};
  std::vector<std::uint32_t> nearest(static_cast<std::size_t>(c.width) * static_cast<std::size_t>(c.height));
  for (auto _ : state) {
    const Tree tree(2, cloud);
    std::size_t pixel = 0;
    for (std::int32_t y = 0; y < c.height; ++y) {
      for (std::int32_t x = 0; x < c.width; ++x) {
        const float query[2] = {static_cast<float>(x), static_cast<float>(y)};
        float squared = 0.0f;
        tree.knnSearch(query, 1, &nearest[pixel++], &squared);
      }
    }
    benchmark::DoNotOptimize(nearest.data());
  }
}
BENCHMARK(AllPixelsByTree)->DenseRange(0, 2)->Unit(benchmark::kMillisecond);

void FiveNearestByCurve(benchmark::State& state) {
  const Case& c = chosen(state);
  const std::vector<Pixel> points = keypoints(c);
  const HilbertMap map = make_hilbert_map(c.width, c.height);
  KeypointQueue queue(map);
  queue.assign(points);
  std::mt19937_64 random(2);
  std::vector<std::uint32_t> found;
  for (auto _ : state) {
    found.clear();
    queue.nearest({static_cast<std::int32_t>(random() % static_cast<std::uint64_t>(c.width)),
                   static_cast<std::int32_t>(random() % static_cast<std::uint64_t>(c.height))},
                  5, found);
    benchmark::DoNotOptimize(found.data());
  }
}
BENCHMARK(FiveNearestByCurve)->DenseRange(0, 2);

}  // namespace

BENCHMARK_MAIN();
