// Depth preprocessing on one core: each stage and the whole chain at 640 x 480 beside a plain OpenCV step (a 3 x 3
// median of 16-bit pixels), time per pixel over sizes, and the known-structure filter. `depth_bench --scores` prints no
// times but how good it is: F, precision, recall, accuracy and outlines against OpenCV's MOG2 and GMG on every synthetic
// sequence, shares of known pixels and of objects. `depth_bench --pictures FOLDER` draws the figures of the paper.
#include <benchmark/benchmark.h>
#include <fmt/format.h>

#include <cstdio>
#include <map>
#include <opencv2/imgproc.hpp>
#include <opencv2/video/background_segm.hpp>
#include <string_view>
#include <vector>

#include "bench/background_rivals.h"
#include "bench/depth_pictures.h"
#include "rgbd/depth/background.h"
#include "rgbd/depth/known_structure.h"
#include "rgbd/depth/mask_scores.h"
#include "rgbd/synthetic/sequences.h"

namespace {

using namespace sherlog::rgbd;

// Eight frames in the middle of a sequence, so that nothing is found in a cache.
const std::vector<TrueFrame>& frames(const char* name, std::int32_t width, std::int32_t height) {
  static std::map<std::string, std::vector<TrueFrame>> made;
  std::vector<TrueFrame>& all = made[fmt::format("{} {} {}", name, width, height)];
  if (all.empty()) {
    const auto sequence = make_sequence(name, {.width = width, .height = height});
    for (std::size_t i = 0; i < 8; ++i) all.push_back(sequence->frame(sequence->size() / 2 + i));
  }
  return all;
}

// For loops over the frames: calls step(frame) for each iteration and reports frames and nanoseconds a pixel.
template <class Step>
void over_frames(benchmark::State& state, const std::vector<TrueFrame>& all, Step step) {
  cv::setNumThreads(1);
  std::size_t i = 0;
  for (auto _ : state) step(all[i++ % all.size()]);
  const auto pixels = static_cast<double>(all[0].frame.depth.total());
  state.counters["fps"] = benchmark::Counter(1, benchmark::Counter::kIsIterationInvariantRate);
  state.counters["s/pixel"] =
      benchmark::Counter(pixels, benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
}

void PlainOpenCvMedian(benchmark::State& state) {
  cv::Mat out;
  over_frames(state, frames("hall", 640, 480), [&](const TrueFrame& f) { cv::medianBlur(f.frame.depth, out, 3); });
}
BENCHMARK(PlainOpenCvMedian)->Unit(benchmark::kMillisecond);

void SelectiveMedian(benchmark::State& state) {
  DepthImage out;
  over_frames(state, frames("hall", 640, 480), [&](const TrueFrame& f) { selective_median(f.frame.depth, out); });
}
BENCHMARK(SelectiveMedian)->Unit(benchmark::kMillisecond);

template <InpaintingFilter filter>
void Pyramid(benchmark::State& state) {
  PyramidInpainting inpainting(filter);
  DepthImage out;
  over_frames(state, frames("hall", 640, 480), [&](const TrueFrame& f) { inpainting.apply(f.frame.depth, out); });
}
BENCHMARK(Pyramid<InpaintingFilter::kMedian>)->Unit(benchmark::kMillisecond);
BENCHMARK(Pyramid<InpaintingFilter::kBinomial>)->Unit(benchmark::kMillisecond);

void Diffusion(benchmark::State& state) {
  DepthImage out;
  over_frames(state, frames("hall", 640, 480), [&](const TrueFrame& f) { inpaint_by_diffusion(f.frame.depth, out); });
}
BENCHMARK(Diffusion)->Unit(benchmark::kMillisecond);

// Alg. 3 and the segmentation. 0: weights as printed, 1: depth alone.
void WholeChain(benchmark::State& state) {
  DepthPreprocessing chain({}, state.range(0) == 0 ? printed_weights() : depth_weights());
  state.SetLabel(state.range(0) == 0 ? "weights as printed" : "weights of depth alone");
  over_frames(state, frames("hall", 640, 480), [&](const TrueFrame& f) { chain.next(f.frame.depth, f.frame.colour); });
}
BENCHMARK(WholeChain)->DenseRange(0, 1)->Unit(benchmark::kMillisecond);

void ChainBySize(benchmark::State& state) {
  const auto width = static_cast<std::int32_t>(state.range(0));
  DepthPreprocessing chain;
  over_frames(state, frames("hall", width, width * 3 / 4),
              [&](const TrueFrame& f) { chain.next(f.frame.depth, f.frame.colour); });
}
BENCHMARK(ChainBySize)->Arg(160)->Arg(320)->Arg(640)->Arg(1280)->Unit(benchmark::kMillisecond);

void MixturesOfGaussians(benchmark::State& state) {
  const auto mixture = cv::createBackgroundSubtractorMOG2(500, 16, false);
  DisparityImage disparity;
  cv::Mat mask;
  over_frames(state, frames("hall", 640, 480), [&](const TrueFrame& f) {
    to_disparity(f.frame.depth, disparity);
    mixture->apply(disparity, mask);
  });
}
BENCHMARK(MixturesOfGaussians)->Unit(benchmark::kMillisecond);

std::vector<PlacedMesh> arm_of(const Scene& scene) {
  std::vector<Body> arm;
  for (const Body& body : scene.bodies) {
    if (scene.entities[body.entity - std::size_t{1}].kind == EntityKind::kRobot) arm.push_back(body);
  }
  return meshes_of(arm);
}

// Drawn anew for each frame: map, and the arm where it is.
void KnownStructure(benchmark::State& state) {
  const auto sequence = make_sequence("robot_table");
  const std::vector<PlacedMesh> map = meshes_of(sequence->scenery().bodies);
  VirtualView view;
  MaskImage known;
  over_frames(state, frames("robot_table", 640, 480), [&](const TrueFrame& f) {
    view.clear(sequence->calibration().size());
    view.draw(map, sequence->calibration(), sequence->camera());
    view.draw(arm_of(f.scene), sequence->calibration(), sequence->camera());
    known_structure(f.frame.depth, view.disparity(), {}, known);
  });
}
BENCHMARK(KnownStructure)->Unit(benchmark::kMillisecond);

// --- how good

void print_segmentation() {
  std::vector<std::string> names = {"ours", "ours, tau 0.8", "Eq. 6 as printed", "pyramid alone"};
  for (const std::string& name : Rivals::names()) names.push_back(name);
  for (const std::string& name : sequence_names()) {
    if (name == "empty_room" || name == "crowd" || name == "random_kitchen") continue;
    const auto sequence = make_sequence(name);
    BackgroundOptions slow;
    slow.tau = 0.8F;
    DepthPreprocessing ours, slower(slow), printed({}, printed_weights());
    Rivals rivals;
    std::vector<MaskScores> scores(names.size());
    for (std::size_t i = 0; i < sequence->size(); ++i) {
      const TrueFrame t = sequence->frame(i);
      const PreprocessedDepth& result = ours.next(t.frame.depth, t.frame.colour);
      const std::vector<MaskImage>& masks = rivals.next(t.frame, result.disparity);
      const PreprocessedDepth &by_slower = slower.next(t.frame.depth, t.frame.colour),
                              &by_printed = printed.next(t.frame.depth, t.frame.colour);
      if (i < GmgOptions().first_frames) continue;  // until all of them have a background
      auto score = scores.begin();
      (score++)->add(result.foreground, t.foreground);
      (score++)->add(by_slower.foreground, t.foreground);
      (score++)->add(by_printed.foreground, t.foreground);
      (score++)->add(outline_by_pyramid(ours), t.foreground);
      for (const MaskImage& mask : masks) (score++)->add(mask, t.foreground);
    }
    fmt::print("{:22} {:>9} {:>9} {:>9} {:>9} {:>9}\n", name, "F", "precision", "recall", "accuracy", "overlap");
    for (std::size_t i = 0; i < names.size(); ++i) {
      const MaskScores& s = scores[i];
      fmt::print("  {:20} {:9.3f} {:9.3f} {:9.3f} {:9.4f} {:9.3f}\n", names[i], s.f_measure(), s.precision(),
                 s.recall(), s.accuracy(), s.overlap());
    }
    std::fflush(stdout);
  }
}

void print_known_structure() {
  fmt::print("\n{:16} {:>10} {:>14} {:>14}\n", "known structure", "tolerance", "known removed", "objects lost");
  for (const char* name : {"robot_table", "table_moves", "table_removals", "hall"}) {
    const auto sequence = make_sequence(name);
    const std::vector<PlacedMesh> map = meshes_of(sequence->scenery().bodies);
    for (const float mean : {0.5F, 0.7F, 1.0F, 3.0F}) {
      double known_pixels = 0, removed = 0, object_pixels = 0, lost = 0;
      VirtualView view;
      MaskImage known;
      for (std::size_t i = 10; i < sequence->size(); i += 20) {
        const TrueFrame t = sequence->frame(i);
        view.clear(sequence->calibration().size());
        view.draw(map, sequence->calibration(), sequence->camera());
        view.draw(arm_of(t.scene), sequence->calibration(), sequence->camera());
        known_structure(t.frame.depth, view.disparity(), {.tolerance = 3, .mean_tolerance = mean}, known);
        for (int y = 0; y < known.rows; ++y) {
          for (int x = 0; x < known.cols; ++x) {
            const std::uint16_t entity = t.entities(y, x);
            if (t.frame.depth(y, x) == 0 || entity == 0) continue;
            const EntityKind kind = t.scene.entities[entity - std::size_t{1}].kind;
            const bool is_known = kind == EntityKind::kScenery || kind == EntityKind::kRobot;
            (is_known ? known_pixels : object_pixels) += 1;
            (is_known ? removed : lost) += known(y, x) != 0 ? 1 : 0;
          }
        }
      }
      fmt::print("{:16} {:>10.1f} {:>12.2f} % {:>12.2f} %\n", name, mean, 100 * removed / known_pixels,
                 100 * lost / object_pixels);
    }
  }
}

}  // namespace

int main(int argc, char** argv) {
  if (argc == 2 && std::string_view(argv[1]) == "--scores") {
    cv::setNumThreads(1);
    print_segmentation();
    print_known_structure();
    return 0;
  }
  if (argc == 3 && std::string_view(argv[1]) == "--pictures") {
    cv::setNumThreads(1);
    return write_depth_pictures(argv[2]) ? 0 : 1;
  }
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 1;
  benchmark::RunSpecifiedBenchmarks();
  return 0;
}
