// From a depth frame to labelled people on one core: the stages of pose at 640 x 480, and the whole chain with its
// depth preprocessing. `people_crossing` has two people in view, `crowd` up to fifty. `pose_bench --labels` prints no
// times of stages but how labels hold from frame to frame, beside a graph segmentation.
#include <benchmark/benchmark.h>
#include <fmt/format.h>

#include <chrono>
#include <map>
#include <opencv2/imgproc.hpp>
#include <random>
#include <set>
#include <string_view>
#include <vector>

#include "bench/graph_segmentation.h"
#include "rgbd/depth/background.h"
#include "rgbd/pose/picture.h"
#include "rgbd/pose/segmentation.h"
#include "rgbd/synthetic/sequences.h"

namespace {

using namespace sherlog::rgbd;

constexpr const char* kNames[] = {"people_crossing", "crowd"};

struct Recorded {
  Calibration calibration;
  std::vector<Frame> frames;  // the first is empty, the others from the middle on
};

const Recorded& recorded(benchmark::State& state) {
  static std::map<std::string, Recorded> made;
  const char* name = kNames[state.range(0)];
  state.SetLabel(name);
  Recorded& all = made[name];
  if (all.frames.empty()) {
    const auto sequence = make_sequence(name);
    all.calibration = sequence->calibration();
    all.frames.push_back(sequence->frame(0).frame);
    for (std::size_t i = 0; i < 8; ++i) all.frames.push_back(sequence->frame(sequence->size() / 2 + i).frame);
  }
  cv::setNumThreads(1);
  return all;
}

void Keypoints(benchmark::State& state) {
  const Recorded& all = recorded(state);
  DepthPreprocessing chain;
  const PreprocessedDepth* depth = nullptr;
  for (const Frame& frame : all.frames) depth = &chain.next(frame.depth, frame.colour);
  std::size_t count = 0;
  for (auto _ : state) count = keypoints(depth->disparity, depth->foreground, all.calibration).size();
  state.counters["keypoints"] = static_cast<double>(count);
}
BENCHMARK(Keypoints)->DenseRange(0, 1)->Unit(benchmark::kMillisecond);

void Segmentation(benchmark::State& state) {
  const Recorded& all = recorded(state);
  DepthPreprocessing chain;
  const PreprocessedDepth* depth = nullptr;
  for (const Frame& frame : all.frames) depth = &chain.next(frame.depth, frame.colour);
  const std::vector<Keypoint> points = keypoints(depth->disparity, depth->foreground, all.calibration);
  SpatioTemporalSegmentation segmentation;
  for (auto _ : state) benchmark::DoNotOptimize(segmentation.next(points).data());
}
BENCHMARK(Segmentation)->DenseRange(0, 1)->Unit(benchmark::kMillisecond);

// Depth preprocessing, keypoints, segments, and the descriptor of every segment.
void WholePoseChain(benchmark::State& state) {
  const Recorded& all = recorded(state);
  const HilbertMap map = make_hilbert_map(all.calibration.width, all.calibration.height);
  DepthPreprocessing chain;
  SpatioTemporalSegmentation segmentation;
  chain.next(all.frames[0].depth, all.frames[0].colour);
  std::size_t i = 0;
  double described = 0;
  for (auto _ : state) {
    const Frame& frame = all.frames[1 + i++ % (all.frames.size() - 1)];
    const PreprocessedDepth& depth = chain.next(frame.depth, frame.colour);
    const std::vector<Keypoint> points = keypoints(depth.disparity, depth.foreground, all.calibration);
    const std::vector<std::int32_t> labels = segmentation.next(points);
    std::map<std::int32_t, std::vector<Pixel>> by_label;
    for (std::size_t k = 0; k < points.size(); ++k) {
      if (labels[k] != 0) by_label[labels[k]].push_back(points[k].pixel);
    }
    described = 0;
    for (const auto& [label, pixels] : by_label) {
      const auto directions = branch_directions(map, pixels, 6);
      if (directions && describe_pose(pixels, *directions)) described += 1;
    }
  }
  state.counters["poses"] = described;
  state.counters["fps"] = benchmark::Counter(1, benchmark::Counter::kIsIterationInvariantRate);
}
BENCHMARK(WholePoseChain)->DenseRange(0, 1)->Unit(benchmark::kMillisecond);

// The tree of a picture: 256 and 4,096 descriptors around forty poses.
void SpanningTree(benchmark::State& state) {
  std::mt19937_64 random(1);
  std::uniform_real_distribution<float> uniform(0, 1);
  std::vector<PoseDescriptor> kinds(40), poses(static_cast<std::size_t>(state.range(0)));
  for (PoseDescriptor& kind : kinds) {
    for (float& value : kind) value = uniform(random) < 0.2F ? uniform(random) : 0.0F;
  }
  for (PoseDescriptor& pose : poses) {
    pose = kinds[random() % kinds.size()];
    for (float& value : pose) value += 0.3F * uniform(random);
  }
  for (auto _ : state) benchmark::DoNotOptimize(spanning_tree(poses));
}
BENCHMARK(SpanningTree)->Arg(256)->Arg(4096)->Unit(benchmark::kMillisecond);

// --- how labels hold

// What one method says of the keypoints of each person, over a sequence.
struct LabelScores {
  std::map<std::int32_t, std::map<std::int32_t, int>> frames_with;  // person, label
  std::int64_t keypoints = 0, own = 0;  // with the person's most frequent label of the frame
  double seconds = 0;

  void add(const TrueFrame& truth, std::span<const Keypoint> points, std::span<const std::int32_t> labels) {
    std::map<std::int32_t, std::map<std::int32_t, int>> votes;
    for (std::size_t k = 0; k < points.size(); ++k) {
      const std::uint16_t entity = truth.entities(points[k].pixel.y, points[k].pixel.x);
      const std::int32_t person = entity == 0 ? 0 : truth.scene.entities[entity - 1U].person;
      if (person != 0) ++votes[person][labels[k]];
    }
    for (const auto& [person, count] : votes) {
      const auto best = std::ranges::max_element(count, {}, [](const auto& entry) { return entry.second; });
      if (best->second < 15) continue;
      ++frames_with[person][best->first];
      own += best->second;
      for (const auto& [label, votes_of] : count) keypoints += votes_of;
    }
  }
  void print(std::string_view name, std::size_t frames) const {
    fmt::print("  {:26}", name);
    for (const auto& [person, labels] : frames_with) {
      int all = 0, most = 0;
      for (const auto& [label, count] : labels) all += count, most = std::max(most, count);
      fmt::print("  person {}: {:3} labels, {:5.1f} % of frames one", person, labels.size(), 100.0 * most / all);
    }
    fmt::print("  own {:.2f} %  {:.2f} ms\n", 100.0 * static_cast<double>(own) / static_cast<double>(keypoints),
               1000 * seconds / static_cast<double>(frames));
  }
};

template <class Call>
auto timed(double& seconds, Call call) {
  const auto before = std::chrono::steady_clock::now();
  auto result = call();
  seconds += std::chrono::duration<double>(std::chrono::steady_clock::now() - before).count();
  return result;
}

void print_labels(std::int32_t width, std::uint64_t seed) {
  const auto sequence = make_sequence("people_crossing", {.width = width, .height = width * 3 / 4, .seed = seed});
  DepthPreprocessing chain;
  SpatioTemporalSegmentation ours, as_printed({.tenure = 0, .patience = 0});
  GraphSegmentation graph;
  LabelScores of_ours, of_printed, of_graph;
  for (std::size_t i = 0; i < sequence->size(); ++i) {
    const TrueFrame truth = sequence->frame(i);
    const PreprocessedDepth& depth = chain.next(truth.frame.depth, truth.frame.colour);
    const std::vector<Keypoint> points = keypoints(depth.disparity, depth.foreground, sequence->calibration());
    of_ours.add(truth, points, timed(of_ours.seconds, [&] { return ours.next(points); }));
    of_printed.add(truth, points, timed(of_printed.seconds, [&] { return as_printed.next(points); }));
    const cv::Mat1i segments = timed(of_graph.seconds, [&] { return graph.next(depth.disparity, depth.foreground); });
    std::vector<std::int32_t> labels;
    labels.reserve(points.size());
    for (const Keypoint& point : points) labels.push_back(segments(point.pixel.y, point.pixel.x));
    of_graph.add(truth, points, labels);
  }
  fmt::print("people_crossing, {} x {}, seed {}\n", width, width * 3 / 4, seed);
  of_ours.print("ours", sequence->size());
  of_printed.print("Algs. 1-3 alone", sequence->size());
  of_graph.print("graph segmentation", sequence->size());
}

}  // namespace

int main(int argc, char** argv) {
  if (argc > 1 && std::string_view(argv[1]) == "--labels") {
    cv::setNumThreads(1);
    for (std::uint64_t seed = 1; seed <= 10; ++seed) print_labels(320, seed);
    for (std::uint64_t seed = 1; seed <= 3; ++seed) print_labels(640, seed);
    return 0;
  }
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 1;
  benchmark::RunSpecifiedBenchmarks();
  return 0;
}
