// Nearest keypoint of every pixel: along the Hilbert curve against a kd-tree (nanoflann, exact), at the sizes of the
// paper's figures. The two numbers to compare are rows of one run; what is done once for an image size is a row of its
// own. `nearest_bench --figures` prints what the paper's other figures show: distances on the curve and in the plane,
// accuracy, time over the size of the curve and over the number of keypoints. `nearest_bench --pictures FOLDER` draws
// the cells of 240 keypoints, and where the curve begins to pay.
#include <benchmark/benchmark.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <ctime>
#include <filesystem>
#include <nanoflann.hpp>
#include <optional>
#include <random>
#include <string>
#include <string_view>
#include <vector>

#include "bench/chart.h"
#include "rgbd/frames/png.h"
#include "rgbd/nearest/hilbert_curve.h"
#include "rgbd/nearest/keypoint_queue.h"
#include "rgbd/nearest/nearest_map.h"

namespace {

using namespace sherlog::rgbd;
using sherlog::chart, sherlog::ChartLine, sherlog::ChartPanel, sherlog::write_text;

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

// --- the paper's figures

using Random = std::mt19937_64;

double distance(Pixel a, Pixel b) { return std::hypot(a.x - b.x, a.y - b.y); }

double processor_seconds() {
  timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

// Least of several runs.
template <class Call>
double seconds_of(int runs, Call call) {
  double least = 1e9;
  for (int run = 0; run < runs; ++run) {
    const double before = processor_seconds();
    call();
    least = std::min(least, processor_seconds() - before);
  }
  return least;
}

std::vector<std::uint32_t> cells_by_curve(const HilbertMap& map, const std::vector<Pixel>& points) {
  NearestMap nearest(map);
  nearest.assign(points);
  return {nearest.nearest().begin(), nearest.nearest().end()};
}

std::vector<std::uint32_t> cells_by_tree(const Case& c, const std::vector<Pixel>& points) {
  const Cloud cloud{points};
  const Tree tree(2, cloud);
  std::vector<std::uint32_t> nearest;
  for (std::int32_t y = 0; y < c.height; ++y) {
    for (std::int32_t x = 0; x < c.width; ++x) {
      const float query[2] = {static_cast<float>(x), static_cast<float>(y)};
      float squared = 0.0f;
      tree.knnSearch(query, 1, &nearest.emplace_back(), &squared);
    }
  }
  return nearest;
}

void print_distances() {
  fmt::print("Apart on the curve, mean and median distance in the plane, root (256 x 256, all pairs)\n");
  for (std::uint32_t apart = 1; apart <= 10; ++apart) {
    std::vector<double> distances;
    for (std::uint32_t i = 0; i + apart < 65536; ++i) {
      distances.push_back(distance(hilbert_pixel(8, i), hilbert_pixel(8, i + apart)));
    }
    double sum = 0;
    for (const double d : distances) sum += d;
    std::ranges::nth_element(distances, distances.begin() + static_cast<std::ptrdiff_t>(distances.size() / 2));
    fmt::print("  {:2}  {:.2f}  {:.2f}  {:.2f}\n", apart, sum / static_cast<double>(distances.size()),
               distances[distances.size() / 2], std::sqrt(apart));
  }
  fmt::print("Distance in the plane (rounded), median and greatest distance on the curve (all pairs)\n");
  std::vector<std::vector<std::uint32_t>> on_curve(10);
  const HilbertMap map = make_hilbert_map(256, 256);
  for (std::int32_t i = 0; i < 65536; ++i) {
    const Pixel p{i % 256, i / 256};
    for (std::int32_t y = p.y; y <= std::min(p.y + 9, 255); ++y) {
      for (std::int32_t x = std::max(p.x - 9, 0); x <= std::min(p.x + 9, 255); ++x) {
        const auto rounded = static_cast<std::size_t>(std::lround(distance(p, {x, y})));
        if ((y == p.y && x <= p.x) || rounded > 9) continue;
        const std::uint32_t a = map.index(p), b = map.index({x, y});
        on_curve[rounded].push_back(a > b ? a - b : b - a);
      }
    }
  }
  for (std::size_t d = 1; d <= 9; ++d) {
    auto& list = on_curve[d];
    std::ranges::nth_element(list, list.begin() + static_cast<std::ptrdiff_t>(list.size() / 2));
    fmt::print("  {}  {:3}  {}\n", d, list[list.size() / 2], *std::ranges::max_element(list));
  }
}

void print_accuracy() {
  fmt::print("Keypoints, share of exact answers, chance, mean ratio of distances (256 x 256, all pixels)\n");
  const HilbertMap map = make_hilbert_map(256, 256);
  for (const std::size_t count : {10U, 30U, 100U, 240U, 500U, 1000U, 2000U, 4753U}) {
    const int images = count < 100 ? 100 : 20;
    double exact = 0, ratio = 0, ratios = 0, all = 0;
    Random random(count);
    for (int image = 0; image < images; ++image) {
      std::vector<Pixel> points;
      for (std::size_t i = 0; i < count; ++i) {
        points.push_back({static_cast<std::int32_t>(random() % 256), static_cast<std::int32_t>(random() % 256)});
      }
      const auto curve = cells_by_curve(map, points), tree = cells_by_tree({256, 256, count}, points);
      for (std::size_t i = 0; i < curve.size(); ++i) {
        const Pixel q{static_cast<std::int32_t>(i % 256), static_cast<std::int32_t>(i / 256)};
        const double got = distance(points[curve[i]], q), best = distance(points[tree[i]], q);
        exact += got <= best ? 1 : 0;
        all += 1;
        if (best > 0) ratio += got / best, ratios += 1;
      }
    }
    fmt::print("  {:5}  {:.3f}  {:.4f}  {:.3f}\n", count, exact / all, 1.0 / static_cast<double>(count),
               ratio / ratios);
  }
}

// Time over C (theorem 1: linear). False: it is not.
bool print_slope() {
  fmt::print("Side, milliseconds for the tables, for all pixels; nanoseconds a pixel (1,000 keypoints)\n");
  double sum_x = 0, sum_y = 0, sum_xx = 0, sum_xy = 0, count = 0;
  for (const std::int32_t side : {256, 512, 1024, 2048, 4096}) {
    HilbertMap map;
    const double once = seconds_of(2, [&] { map = make_hilbert_map(side, side); });
    NearestMap nearest(map);
    const std::vector<Pixel> points = keypoints({side, side, 1000});
    const double seconds = seconds_of(9, [&] { nearest.assign(points); });
    const double pixels = static_cast<double>(side) * side;
    fmt::print("  {:4}  {:7.2f}  {:7.3f}  {:.2f}\n", side, 1000 * once, 1000 * seconds, 1e9 * seconds / pixels);
    const double x = std::log(pixels), y = std::log(seconds);
    sum_x += x, sum_y += y, sum_xx += x * x, sum_xy += x * y, count += 1;
  }
  const double slope = (count * sum_xy - sum_x * sum_y) / (count * sum_xx - sum_x * sum_x);
  fmt::print("  slope of log time over log C: {:.3f}\n", slope);
  return slope > 0.8 && slope < 1.2;
}

// Seconds a pixel for so many keypoints, the tables apart: all pixels by the curve, a query of the queue, looking at all
// keypoints, and the tree. What is made once for a set of keypoints is shared among the pixels.
struct PixelTimes {
  std::size_t keypoints;
  double curve, queue, all, tree;
};

PixelTimes pixel_times(const HilbertMap& map, const Case& c) {
  const std::vector<Pixel> points = keypoints(c);
  const double pixels = static_cast<double>(c.width) * c.height;
  std::vector<Pixel> queries;  // at most 65,536, in rows
  const auto stride = static_cast<std::int32_t>(std::max(1.0, std::ceil(pixels / 65536)));
  for (std::int32_t i = 0; i < c.width * c.height; i += stride) queries.push_back({i % c.width, i / c.width});
  const auto seconds_a_pixel = [&](int runs, auto prepare, auto query) {
    const double once = seconds_of(runs, prepare);
    const double each = seconds_of(runs, [&] {
      for (const Pixel q : queries) benchmark::DoNotOptimize(query(q));
    });
    return once / pixels + each / static_cast<double>(queries.size());
  };
  PixelTimes times{.keypoints = c.keypoints, .curve = 0, .queue = 0, .all = 0, .tree = 0};
  NearestMap nearest(map);
  times.curve = seconds_of(5, [&] { nearest.assign(points); }) / pixels;
  KeypointQueue queue(map);
  std::vector<std::uint32_t> found;
  times.queue = seconds_a_pixel(
      15, [&] { queue.assign(points); },
      [&](Pixel q) {
        found.clear();
        queue.nearest(q, 1, found);
        return found[0];
      });
  times.all = seconds_a_pixel(
      7, [] {},
      [&](Pixel q) {
        std::int32_t best = 1 << 30;
        std::uint32_t which = 0;
        for (std::uint32_t k = 0; k < points.size(); ++k) {
          const std::int32_t dx = points[k].x - q.x, dy = points[k].y - q.y, squared = dx * dx + dy * dy;
          if (squared < best) best = squared, which = k;
        }
        return which;
      });
  const Cloud cloud{points};
  std::optional<Tree> tree;
  times.tree = seconds_a_pixel(
      15, [&] { tree.emplace(2, cloud); },
      [&](Pixel q) {
        const float query[2] = {static_cast<float>(q.x), static_cast<float>(q.y)};
        std::uint32_t which = 0;
        float squared = 0.0f;
        tree->knnSearch(query, 1, &which, &squared);
        return which;
      });
  return times;
}

constexpr std::size_t kCounts[] = {1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000};

std::vector<PixelTimes> times_over_keypoints(std::int32_t width, std::int32_t height) {
  const HilbertMap map = make_hilbert_map(width, height);
  std::vector<PixelTimes> rows;
  for (const std::size_t count : kCounts) rows.push_back(pixel_times(map, {width, height, count}));
  return rows;
}

// Where the curve begins to pay: one keypoint and more, against looking at all keypoints and against the tree.
void print_crossover(const std::vector<PixelTimes>& rows) {
  fmt::print("Keypoints, nanoseconds a pixel: all pixels by the curve, a query of the queue, all keypoints, tree\n");
  for (const PixelTimes& t : rows) {
    fmt::print("  {:4}  {:7.2f}  {:7.1f}  {:7.1f}  {:7.1f}\n", t.keypoints, 1e9 * t.curve, 1e9 * t.queue, 1e9 * t.all,
               1e9 * t.tree);
  }
}

// Number of keypoints from which the queue is faster than `other`, between two numbers that were tried; 0: never.
double crossover(const std::vector<PixelTimes>& rows, double PixelTimes::*other) {
  const auto excess = [&](const PixelTimes& t) { return std::log(t.queue / (t.*other)); };
  std::size_t last = rows.size();  // the last number where it is slower
  for (std::size_t i = 0; i < rows.size(); ++i) {
    if (excess(rows[i]) > 0) last = i;
  }
  if (last == rows.size()) return 1;
  if (last + 1 == rows.size()) return 0;
  const double a = excess(rows[last]), b = excess(rows[last + 1]);
  const double low = std::log(static_cast<double>(rows[last].keypoints)),
               high = std::log(static_cast<double>(rows[last + 1].keypoints));
  return std::exp(low + (high - low) * a / (a - b));
}

bool write_crossover(const std::filesystem::path& folder) {
  ChartPanel times{"Time for a pixel, 640 x 480", "keypoints n", "nanoseconds", {}, true, true};
  ChartPanel ratios{
      "A query of the queue to the tree", "keypoints n", "time of ours / time of the kd-tree", {}, true, true};
  ChartPanel crossovers{"Where the queue begins to pay", "lg C", "keypoints n", {}};
  crossovers.lines = {{"against looking at all", {}}, {"against the tree", {}}, {"n = lg C", {}, true}};
  std::string csv = "width,height,lg_c,keypoints,curve_ns,queue_ns,all_ns,tree_ns\n";
  for (const auto& [width, height] :
       {std::pair{64, 64}, {128, 128}, {256, 256}, {512, 512}, {640, 480}, {2048, 2048}}) {
    const double lg_c = 2 * std::ceil(std::log2(std::max(width, height)));
    const std::vector<PixelTimes> rows = times_over_keypoints(width, height);
    ChartLine curve{"all pixels by the curve (theorem 1)", {}}, queue{"a query of the queue (theorem 2)", {}},
        all{"looking at all keypoints", {}}, tree{"kd-tree", {}}, ratio{fmt::format("lg C = {}", lg_c), {}};
    for (const PixelTimes& t : rows) {
      const auto n = static_cast<double>(t.keypoints);
      curve.points.emplace_back(n, 1e9 * t.curve), queue.points.emplace_back(n, 1e9 * t.queue);
      all.points.emplace_back(n, 1e9 * t.all), tree.points.emplace_back(n, 1e9 * t.tree);
      ratio.points.emplace_back(n, t.queue / t.tree);
      csv += fmt::format("{},{},{},{},{:.2f},{:.2f},{:.2f},{:.2f}\n", width, height, lg_c, t.keypoints, 1e9 * t.curve,
                         1e9 * t.queue, 1e9 * t.all, 1e9 * t.tree);
    }
    if (width == 640) {
      times.lines = {curve, queue, all, tree};
      times.lines.push_back({"n = lg C", {{lg_c, curve.points[0].second}, {lg_c, all.points.back().second}}, true});
      print_crossover(rows);
    }
    if (lg_c == 12 || lg_c == 16 || lg_c == 20 || lg_c == 22) ratios.lines.push_back(ratio);
    const double by_all = crossover(rows, &PixelTimes::all), by_tree = crossover(rows, &PixelTimes::tree);
    if (by_all > 0) crossovers.lines[0].points.emplace_back(lg_c, by_all);
    if (by_tree > 0) crossovers.lines[1].points.emplace_back(lg_c, by_tree);
    crossovers.lines[2].points.emplace_back(lg_c, lg_c);
    fmt::print("{} x {}, lg C = {}: a query of the queue pays from {:.0f} keypoints, against the tree from {:.0f}\n",
               width, height, lg_c, by_all, by_tree);
  }
  return write_text(folder / "crossover.svg", chart({times, ratios, crossovers}, 400, 320)) &&
         write_text(folder / "crossover.csv", csv);
}

bool write_cells(const std::filesystem::path& folder) {
  const Case c{256, 256, 240};
  const std::vector<Pixel> points = keypoints(c);
  Random random(7);
  std::vector<cv::Vec3b> colours(points.size());
  for (cv::Vec3b& colour : colours) {
    for (int channel = 0; channel < 3; ++channel) colour[channel] = static_cast<std::uint8_t>(random() % 256);
  }
  const auto curve = cells_by_curve(make_hilbert_map(c.width, c.height), points), exact = cells_by_tree(c, points);
  cv::Mat3b image(c.height, 2 * c.width + 8, cv::Vec3b(255, 255, 255));
  double equal = 0;
  for (std::int32_t y = 0; y < c.height; ++y) {
    for (std::int32_t x = 0; x < c.width; ++x) {
      const auto pixel = static_cast<std::size_t>(y) * static_cast<std::size_t>(c.width) + static_cast<std::size_t>(x);
      image(y, x) = colours[curve[pixel]];
      image(y, x + c.width + 8) = colours[exact[pixel]];
      equal += curve[pixel] == exact[pixel] ? 1 : 0;
    }
  }
  fmt::print("Cells of {} keypoints: {:.1f} % of the pixels are equal\n", points.size(),
             100 * equal / (static_cast<double>(c.width) * c.height));
  std::string problem;
  if (write_png(folder / "cells.png", image, problem)) return true;
  fmt::print(stderr, "{}\n", problem);
  return false;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc > 1 && std::string_view(argv[1]) == "--figures") {
    print_distances();
    print_accuracy();
    const bool is_linear = print_slope();
    print_crossover(times_over_keypoints(640, 480));
    return is_linear ? 0 : 1;
  }
  if (argc == 3 && std::string_view(argv[1]) == "--pictures") {
    return write_cells(argv[2]) && write_crossover(argv[2]) ? 0 : 1;
  }
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 1;
  benchmark::RunSpecifiedBenchmarks();
  return 0;
}
