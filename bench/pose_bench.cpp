// From a depth frame to labelled people on one core: the stages of pose at 640 x 480, and the whole chain with its
// depth preprocessing. `people_crossing` has two people in view, `crowd` up to fifty.
#include <benchmark/benchmark.h>
#include <fmt/format.h>

#include <map>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "rgbd/depth/background.h"
#include "rgbd/pose/descriptor.h"
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

}  // namespace

BENCHMARK_MAIN();
