// The stages of depth preprocessing against slow twins that follow the paper's words, and its claims on synthetic sequences.
#include <gtest/gtest.h>

#include <map>
#include <opencv2/imgproc.hpp>
#include <opencv2/video/background_segm.hpp>
#include <random>
#include <set>

#include "rgbd/depth/background.h"
#include "rgbd/depth/noise_statistics.h"
#include "rgbd/synthetic/sequences.h"

namespace sherlog::rgbd {
namespace {

constexpr double kPi = std::numbers::pi;

DepthImage random_depth(std::uint64_t seed, int width, int height, double gaps, int most = 65535) {
  std::mt19937_64 random(seed);
  std::bernoulli_distribution gap(gaps);
  std::uniform_int_distribution<int> value(1, most);
  DepthImage depth(height, width);
  for (std::uint16_t& d : depth) d = gap(random) ? std::uint16_t{0} : static_cast<std::uint16_t>(value(random));
  return depth;
}

bool same(const cv::Mat& a, const cv::Mat& b) {
  return a.size() == b.size() && a.type() == b.type() && (a.empty() || cv::norm(a, b, cv::NORM_INF) == 0);
}

const std::vector<cv::Size> kSizes = {{1, 1}, {1, 7}, {9, 1}, {2, 2}, {8, 3}, {17, 16}, {33, 21}};

// --- E3: normalised disparity

TEST(NormalisedDisparity, HasTheValuesOfTheEquation) {
  EXPECT_LT(normalised_disparity(412.80), 0);
  EXPECT_GT(normalised_disparity(412.85), 0);
  for (const auto& [millimetres, index] :
       {std::pair{500.0, 144.465}, {1000.0, 486.552}, {5000.0, 760.222}, {7500.0, 783.028}}) {
    EXPECT_NEAR(normalised_disparity(millimetres), index, 1e-3);
  }
  EXPECT_NEAR(kA2 / kA4, 8 * 75 * 570.1, 50);  // sub-pixels, baseline, focal length
  // The three steps of the sensor that are quoted: 0.65 mm at 0.5 m, 7 cm at 5 m, 685 mm at 15.7 m.
  EXPECT_NEAR(disparity_step(500), 0.73, 0.01);
  EXPECT_NEAR(disparity_step(5000), 74, 1);
  EXPECT_NEAR(disparity_step(15700), 755, 2);
}

TEST(NormalisedDisparity, GrowsWithDepthAndComesBack) {
  for (int d = 2; d < 65536; ++d) EXPECT_GT(normalised_disparity(d), normalised_disparity(d - 1));
  for (double index = 0; index < 822; index += 0.37)
    EXPECT_NEAR(normalised_disparity(metric_depth(index)), index, 1e-6);
  for (int d = 300; d < 15000; ++d) {  // rounded to a step: within half of it
    const double back = metric_depth(std::round(normalised_disparity(d)));
    EXPECT_LE(std::abs(normalised_disparity(back) - normalised_disparity(d)), 0.5 + 1e-9);
  }
}

TEST(NormalisedDisparity, OfImagesIsThatOfTheirPixels) {
  const DepthImage depth = random_depth(1, 40, 30, 0.3, 20000);
  DisparityImage disparity;
  to_disparity(depth, disparity);
  for (int y = 0; y < depth.rows; ++y) {
    for (int x = 0; x < depth.cols; ++x) {
      ASSERT_EQ(is_gap(disparity(y, x)), depth(y, x) == 0);
      if (depth(y, x) != 0) {
        ASSERT_NEAR(static_cast<double>(disparity(y, x)), normalised_disparity(depth(y, x)), 1e-3);
      }
    }
  }
  DepthImage back;
  to_depth(disparity, back);
  for (int y = 0; y < depth.rows; ++y) {
    // Floats have 6e-5 steps there: 0.07 mm at 20 m.
    for (int x = 0; x < depth.cols; ++x) ASSERT_LE(std::abs(back(y, x) - depth(y, x)), 1) << depth(y, x);
  }
  disparity(0, 0) = 900;  // beyond infinity
  to_depth(disparity, back);
  EXPECT_EQ(back(0, 0), 0);
}

// --- E4: noise

TEST(NoiseStatistics, OfStepsIsTheSameAtAllDepths) {
  // A floor to the horizon: 0.7 to 9 m in one picture.
  Scene scene;
  const std::uint16_t floor = scene.add({.name = "floor"});
  scene.bodies.push_back({.size = {30, 30, 0.1}, .entity = floor});
  const Calibration c = kinect_calibration(80, 60);
  const View view = render(scene, c, look_at({0, 0, 0.5}, {0, 2, 0}));
  SensorModel sensor;
  sensor.outliers = 0;
  sensor.least_facing = 0;
  NoiseStatistics millimetres(false), steps(true);
  for (std::uint64_t i = 0; i < 150; ++i) {
    const Frame frame = measure(view, c, sensor, 5, i);
    ASSERT_TRUE(millimetres.add(frame.depth));
    ASSERT_TRUE(steps.add(frame.depth));
  }
  const auto spread = [](const NoiseStatistics& statistics) {
    double least = 1e9, most = 0;
    for (const auto& at : statistics.by_depth(500)) {
      if (at.pixels < 20) continue;
      least = std::min(least, at.deviation);
      most = std::max(most, at.deviation);
    }
    return most / least;
  };
  EXPECT_GT(spread(millimetres), 50);
  EXPECT_LT(spread(steps), 2);
  EXPECT_FALSE(steps.add(DepthImage(2, 2)));
}

TEST(NoiseStatistics, AreThoseOfTheTextbook) {
  NoiseStatistics statistics(false);
  for (const int value : {1000, 1010, 1020, 0}) {
    DepthImage depth(1, 2, static_cast<std::uint16_t>(value));
    depth(0, 1) = value == 1000 ? std::uint16_t{1000} : std::uint16_t{0};
    ASSERT_TRUE(statistics.add(depth));
  }
  EXPECT_NEAR(statistics.mean()(0, 0), 1010, 1e-9);
  EXPECT_NEAR(statistics.deviation()(0, 0), std::sqrt(200.0 / 3), 1e-9);
  EXPECT_EQ(statistics.mean()(0, 1), -1);  // valid in one of four frames
}

// --- E5: selective median

// Alg. 1 with the maximum norm, by sorting.
DepthImage median_twin(const DepthImage& depth) {
  DepthImage result(depth.size());
  for (int y = 0; y < depth.rows; ++y) {
    for (int x = 0; x < depth.cols; ++x) {
      std::vector<std::uint16_t> valid;
      for (int v = std::max(y - 1, 0); v <= std::min(y + 1, depth.rows - 1); ++v) {
        for (int u = std::max(x - 1, 0); u <= std::min(x + 1, depth.cols - 1); ++u) {
          if (depth(v, u) != 0) valid.push_back(depth(v, u));
        }
      }
      std::ranges::sort(valid);
      result(y, x) = valid.empty() ? std::uint16_t{0} : valid[(valid.size() - 1) / 2];
    }
  }
  return result;
}

DepthImage halving_twin(const DepthImage& depth) {
  DepthImage result((depth.rows + 1) / 2, (depth.cols + 1) / 2);
  for (int y = 0; y < result.rows; ++y) {
    for (int x = 0; x < result.cols; ++x) {
      std::vector<std::uint16_t> valid;
      for (int v = 2 * y; v < std::min(2 * y + 2, depth.rows); ++v) {
        for (int u = 2 * x; u < std::min(2 * x + 2, depth.cols); ++u) {
          if (depth(v, u) != 0) valid.push_back(depth(v, u));
        }
      }
      std::ranges::sort(valid);
      result(y, x) = valid.empty() ? std::uint16_t{0} : valid[(valid.size() - 1) / 2];
    }
  }
  return result;
}

TEST(SelectiveMedian, IsTheMiddleOfTheValidOnes) {
  std::uint64_t seed = 0;
  for (const cv::Size size : kSizes) {
    for (const double gaps : {0.0, 0.1, 0.3, 0.5, 0.7, 0.9, 1.0}) {
      for (const int most : {3, 65535}) {  // many equal ones, and all of 16 bits
        const DepthImage depth = random_depth(++seed, size.width, size.height, gaps, most);
        DepthImage fast;
        selective_median(depth, fast);
        ASSERT_TRUE(same(fast, median_twin(depth))) << size << " " << gaps;
        selective_halving(depth, fast);
        ASSERT_TRUE(same(fast, halving_twin(depth))) << size << " " << gaps;
      }
    }
  }
}

TEST(SelectiveMedian, ReadsAPartOfALargerImage) {
  const DepthImage whole = random_depth(3, 64, 48, 0.3);
  const DepthImage part = whole(cv::Rect(5, 7, 41, 22));
  DepthImage fast;
  selective_median(part, fast);
  EXPECT_TRUE(same(fast, median_twin(part.clone())));
}

// --- E6, E7: inpainting

// Alg. 2 word by word: walk up from every gap.
DepthImage inpainting_twin(const DepthImage& depth, std::size_t& pixels) {
  std::vector<DepthImage> pyramid = {depth};
  while (pyramid.back().rows > 1 && pyramid.back().cols > 1)
    pyramid.push_back(halving_twin(median_twin(pyramid.back())));
  pixels = 0;
  for (const DepthImage& level : pyramid) pixels += level.total();
  DepthImage result = depth.clone();
  for (int y = 0; y < depth.rows; ++y) {
    for (int x = 0; x < depth.cols; ++x) {
      int v = y, u = x;
      std::size_t level = 0;
      while (level + 1 < pyramid.size() && pyramid[level](v, u) == 0) {
        ++level;
        v /= 2;
        u /= 2;
      }
      result(y, x) = pyramid[level](v, u);
    }
  }
  return result;
}

TEST(PyramidInpainting, WalksUpThePyramidFromEveryGap) {
  std::uint64_t seed = 100;
  PyramidInpainting inpainting;  // one for all sizes, so that memory is used again
  for (const cv::Size size : kSizes) {
    for (const double gaps : {0.0, 0.4, 0.9, 0.99, 1.0}) {
      const DepthImage depth = random_depth(++seed, size.width, size.height, gaps);
      DepthImage filled;
      inpainting.apply(depth, filled);
      std::size_t pixels = 0;
      ASSERT_TRUE(same(filled, inpainting_twin(depth, pixels))) << size << " " << gaps;
      std::size_t counted = 0;
      for (const DepthImage& level : inpainting.levels()) counted += level.total();
      EXPECT_EQ(counted, pixels);
      // 4 w h / 3, and half a row and column a level for sides that are not even.
      const double sides = size.width + size.height;
      EXPECT_LE(static_cast<double>(counted), 4.0 / 3 * size.area() + sides * 2 + 2 * std::log2(sides));
    }
  }
}

TEST(PyramidInpainting, LeavesNoGapAndMakesNoNewValue) {
  for (const double gaps : {0.2, 0.9, 0.999}) {
    // A square: the top is one pixel. Of other images it is a row, where a gap may have nothing above it.
    const DepthImage depth = random_depth(7, 64, 64, gaps);
    DepthImage filled;
    PyramidInpainting().apply(depth, filled);
    EXPECT_EQ(cv::countNonZero(filled == 0), 0);
    const std::set<std::uint16_t> measured(depth.begin(), depth.end());
    for (const std::uint16_t value : filled) EXPECT_TRUE(measured.contains(value));
  }
}

// A step from 1 m to 3 m with a gap of 24 x 24 across it.
DepthImage step_with_gap() {
  DepthImage depth(64, 64, std::uint16_t{1000});
  depth(cv::Rect(32, 0, 32, 64)).setTo(3000);
  depth(cv::Rect(20, 20, 24, 24)).setTo(0);
  return depth;
}

int new_values(const DepthImage& filled) {
  return static_cast<int>(
      std::ranges::count_if(filled, [](std::uint16_t d) { return d != 1000 && d != 3000 && d != 0; }));
}

TEST(PyramidInpainting, KeepsAStepWhereItsVariantsBlur) {
  DepthImage median, binomial, diffusion;
  PyramidInpainting().apply(step_with_gap(), median);
  PyramidInpainting(InpaintingFilter::kBinomial).apply(step_with_gap(), binomial);
  inpaint_by_diffusion(step_with_gap(), diffusion);
  EXPECT_EQ(new_values(median), 0);
  EXPECT_GT(new_values(binomial), 0);
  EXPECT_GT(new_values(diffusion), 0);
  for (const DepthImage* image : {&median, &binomial, &diffusion}) EXPECT_EQ(cv::countNonZero(*image == 0), 0);
}

TEST(Diffusion, GoesOnFromTheLowerLeft) {
  const DepthImage depth = (DepthImage(3, 3) << 0, 0, 0, 0, 0, 0, 100, 200, 0);
  DepthImage filled;
  inpaint_by_diffusion(depth, filled);
  // Rows from below: 200; mean of below; mean of left, below, lower left.
  EXPECT_EQ(filled(2, 2), 200);
  EXPECT_EQ(filled(1, 0), 100);
  EXPECT_EQ(filled(1, 1), 133);  // 100, 200, 100
  EXPECT_EQ(filled(1, 2), 178);  // 133, 200, 200
  const DepthImage empty(2, 2, std::uint16_t{0});
  inpaint_by_diffusion(empty, filled);
  EXPECT_TRUE(same(filled, empty));
}

TEST(SelectiveBinomial, IsTheWeightedMeanOfTheValidOnes) {
  const DepthImage depth = random_depth(9, 23, 11, 0.5, 9000);
  DepthImage fast;
  selective_binomial(depth, fast);
  for (int y = 0; y < depth.rows; ++y) {
    for (int x = 0; x < depth.cols; ++x) {
      double sum = 0, weight = 0;
      for (int v = std::max(y - 1, 0); v <= std::min(y + 1, depth.rows - 1); ++v) {
        for (int u = std::max(x - 1, 0); u <= std::min(x + 1, depth.cols - 1); ++u) {
          if (depth(v, u) == 0) continue;
          const double w = (v == y ? 2 : 1) * (u == x ? 2 : 1);
          sum += w * depth(v, u);
          weight += w;
        }
      }
      ASSERT_NEAR(fast(y, x), weight == 0 ? 0 : sum / weight, 0.5 + 1e-9);
    }
  }
}

// --- E8: three sliding bins

TEST(SlidingBins, FindTheModeFromAnyStart) {
  std::mt19937_64 random(11);
  std::uniform_real_distribution<double> anywhere(-kPi, kPi), unit(0, 1);
  std::normal_distribution<double> noise(0, 0.05);
  for (int scene = 0; scene < 20; ++scene) {
    const double mode = anywhere(random);  // the others a third of a turn off, give or take 20 degrees
    const double second = mode + 2 * kPi / 3 + 0.35 * (2 * unit(random) - 1);
    const double third = mode - 2 * kPi / 3 + 0.35 * (2 * unit(random) - 1);
    for (int start = 0; start < 10; ++start) {
      SlidingBins bins;
      bins.reference = static_cast<float>(anywhere(random));
      for (int i = 0; i < 200; ++i) {
        const double u = unit(random), angle = (u < 0.7 ? mode : u < 0.9 ? second : third) + noise(random);
        bins.add(static_cast<float>(std::remainder(angle, 2 * kPi)));
      }
      const double off = std::abs(std::remainder(static_cast<double>(bins.reference) - mode, 2 * kPi));
      EXPECT_LT(off * 180 / kPi, 5) << "scene " << scene << ", start " << start;
    }
  }
}

TEST(SlidingBins, FollowAChangeForEver) {
  SlidingBins bins;
  for (int i = 0; i < 100000; ++i) bins.add(1.0F);
  EXPECT_NEAR(static_cast<double>(bins.reference), 1.0, 1e-3);
  for (int i = 0; i < 400; ++i) bins.add(-2.0F);
  EXPECT_NEAR(static_cast<double>(bins.reference), -2.0, 0.05);
  // Across the seam at pi: the mean of 3.1 and -3.1 is pi, not 0.
  SlidingBins seam;
  for (int i = 0; i < 50; ++i) seam.add(i % 2 == 0 ? 3.1F : -3.1F);
  EXPECT_NEAR(std::abs(static_cast<double>(seam.reference)), kPi, 0.05);
}

// --- E9, E10, E11: background and weight

struct Pixels {
  DisparityImage disparity;
  ColourImage colour;
  cv::Mat1f direction;
};
Pixels one_pixel(float disparity, cv::Vec3b colour = {10, 20, 30}, float direction = 0.0F) {
  return {DisparityImage(1, 1, disparity), ColourImage(1, 1, colour), cv::Mat1f(1, 1, direction)};
}
void feed(BackgroundModel& model, const Pixels& p) { model.update(p.disparity, p.colour, p.direction); }

TEST(Background, FollowsTheEquations) {
  BackgroundModel model;  // tau 0.2, zeta 5
  feed(model, one_pixel(500, {100, 100, 100}));
  EXPECT_EQ(model.disparity()(0, 0), 500);  // the first frame is the first estimate
  feed(model, one_pixel(400));              // nearer by more than zeta: Eq. 3
  EXPECT_EQ(model.disparity()(0, 0), 500);
  feed(model, one_pixel(499, {0, 0, 0}));  // 499 > 495 and 499 > 400: 0.2 * 500 + 0.8 * 499
  EXPECT_NEAR(static_cast<double>(model.disparity()(0, 0)), 499.2, 1e-4);
  EXPECT_NEAR(static_cast<double>(model.colour()(0, 0)[0]), 20, 1e-4);
  feed(model, one_pixel(498));  // not increasing: Eq. 4
  EXPECT_NEAR(static_cast<double>(model.disparity()(0, 0)), 499.2, 1e-4);
  feed(model, one_pixel(700));  // capped at + zeta - 1
  EXPECT_NEAR(static_cast<double>(model.disparity()(0, 0)), 503.2, 1e-4);
  feed(model, one_pixel(kNoDisparity));
  EXPECT_NEAR(static_cast<double>(model.disparity()(0, 0)), 503.2, 1e-4);
}

TEST(Background, IsMovedByABurstOfOutliersByLittle) {
  BackgroundModel model;
  for (int i = 0; i < 20; ++i) feed(model, one_pixel(600.0F + static_cast<float>(i % 2)));
  const double before = static_cast<double>(model.disparity()(0, 0));
  for (const float outlier : {700.0F, 750.0F, 800.0F}) {
    const double last = static_cast<double>(model.disparity()(0, 0));
    feed(model, one_pixel(outlier));
    EXPECT_LE(static_cast<double>(model.disparity()(0, 0)) - last, 5 - 1 + 1e-3);
  }
  EXPECT_LE(static_cast<double>(model.disparity()(0, 0)) - before, 12 + 1e-3);
}

TEST(Background, WaitsInGapsAndThenLearnsFromThem) {
  BackgroundModel model;
  feed(model, one_pixel(500));
  const DepthImage gap(1, 1, std::uint16_t{0}), valid(1, 1, std::uint16_t{1000});
  const auto filled = [&](float disparity) {
    const Pixels p = one_pixel(disparity);
    model.update(p.disparity, p.colour, p.direction, gap);
    return static_cast<double>(model.disparity()(0, 0));
  };
  for (int i = 0; i < 5; ++i) EXPECT_EQ(filled(600.0F + static_cast<float>(i)), 500);
  EXPECT_EQ(filled(610), 504);  // the sixth
  const Pixels p = one_pixel(400);
  model.update(p.disparity, p.colour, p.direction, valid);
  EXPECT_EQ(filled(620), 504);  // patience starts anew
}

TEST(Foreground, HasTheWeightOfTheEquation) {
  BackgroundModel model;
  feed(model, one_pixel(600, {10, 20, 30}, 3.0F));
  const Pixels now = one_pixel(550, {20, 0, 35}, -3.0F);
  cv::Mat1f weight;
  model.weigh(now.disparity, now.colour, now.direction, printed_weights(), weight);
  // 10 + 20 + 5 in colour, 50 steps, and 2 pi - 6 radians in degrees.
  EXPECT_NEAR(static_cast<double>(weight(0, 0)), 35 + 50 + (2 * kPi - 6) * 180 / kPi, 1e-3);
  model.weigh(now.disparity, now.colour, now.direction, depth_weights(), weight);
  EXPECT_EQ(weight(0, 0), 50.0F * 50);
  const Pixels farther = one_pixel(650);
  model.weigh(farther.disparity, farther.colour, farther.direction, depth_weights(), weight);
  EXPECT_LE(weight(0, 0), 0);  // nothing is behind the background
  model.weigh(DisparityImage(1, 1, kNoDisparity), now.colour, now.direction, depth_weights(), weight);
  EXPECT_EQ(weight(0, 0), 0);
}

TEST(Gradient, DirectionIsThatOfTheArcTangent) {
  std::mt19937_64 random(3);
  std::uniform_real_distribution<float> value(0, 800);
  DisparityImage d(9, 13);
  for (float& v : d) v = value(random);
  cv::Mat1f direction, magnitude;
  gradient_direction(d, direction);
  gradient_magnitude(d, magnitude);
  for (int y = 0; y < d.rows; ++y) {
    for (int x = 0; x < d.cols; ++x) {
      const int l = std::max(x - 1, 0), r = std::min(x + 1, d.cols - 1), t = std::max(y - 1, 0),
                b = std::min(y + 1, d.rows - 1);
      const double dx = static_cast<double>(d(y, r) - d(y, l)) / (r - l),
                   dy = static_cast<double>(d(b, x) - d(t, x)) / (b - t);
      ASSERT_NEAR(static_cast<double>(direction(y, x)), std::atan2(dy, dx), 3e-4);
      ASSERT_NEAR(static_cast<double>(magnitude(y, x)), std::hypot(dx, dy), 1e-2);
    }
  }
  gradient_direction(DisparityImage(1, 1, 5.0F), direction);  // one pixel has no slope
  EXPECT_EQ(direction(0, 0), 0);
}

TEST(MajorityOfNine, CountsNeighbours) {
  std::mt19937_64 random(4);
  for (const cv::Size size : kSizes) {
    MaskImage mask(size), fast;
    for (std::uint8_t& m : mask) m = random() % 2 == 0 ? 255 : 0;
    majority_of_nine(mask, fast);
    for (int y = 0; y < size.height; ++y) {
      for (int x = 0; x < size.width; ++x) {
        const cv::Rect window = cv::Rect(x - 1, y - 1, 3, 3) & cv::Rect({0, 0}, size);
        ASSERT_EQ(fast(y, x) != 0, cv::countNonZero(mask(window)) >= 5);
      }
    }
  }
}

// --- E12, E13: whole sequences

struct Scores {
  double hits = 0, false_alarms = 0, misses = 0;
  void add(const MaskImage& said, const MaskImage& truth) {
    hits += cv::countNonZero(said & truth);
    false_alarms += cv::countNonZero(said & ~truth);
    misses += cv::countNonZero(truth & ~said);
  }
  double f_measure() const { return 2 * hits / (2 * hits + false_alarms + misses); }
  double overlap() const { return hits / (hits + false_alarms + misses); }
};

TEST(DepthPreprocessing, IsBetterThanMixturesOfGaussiansOnEverySequence) {
  for (const std::string& name : sequence_names()) {
    if (name == "empty_room" || name == "crowd") continue;  // nothing to find; nothing but people
    SCOPED_TRACE(name);
    const auto sequence = make_sequence(name, {.width = 160, .height = 120});
    ASSERT_TRUE(sequence);
    DepthPreprocessing ours, printed({}, printed_weights());
    Scores our_scores, printed_scores;
    std::map<std::string, Scores> theirs;
    std::map<std::string, cv::Ptr<cv::BackgroundSubtractorMOG2>> mixtures;
    for (std::size_t i = 0; i < sequence->size(); ++i) {
      const TrueFrame truth = sequence->frame(i);
      const PreprocessedDepth& result = ours.next(truth.frame.depth, truth.frame.colour);
      our_scores.add(result.foreground, truth.foreground);
      printed_scores.add(printed.next(truth.frame.depth, truth.frame.colour).foreground, truth.foreground);
      // What the mixture is given: depth in 8 bits, disparity with gaps, and even our own inpainting of it.
      std::map<std::string, cv::Mat> inputs;
      truth.frame.depth.convertTo(inputs["depth"], CV_8U, 255.0 / 10000);
      DisparityImage disparity;
      to_disparity(truth.frame.depth, disparity);
      disparity.setTo(0.0F, disparity < 0.0F);
      inputs["disparity"] = disparity;
      inputs["inpainted disparity"] = result.disparity;
      for (const auto& [input, image] : inputs) {
        auto& mixture = mixtures[input];
        if (!mixture) mixture = cv::createBackgroundSubtractorMOG2(500, 16, false);
        MaskImage mask, majority;
        mixture->apply(image, mask);
        theirs[input].add(mask, truth.foreground);
        majority_of_nine(mask, majority);
        theirs[input + ", majority"].add(majority, truth.foreground);
      }
    }
    for (const auto& [input, scores] : theirs) EXPECT_GT(our_scores.f_measure(), scores.f_measure()) << input;
    EXPECT_GT(our_scores.f_measure(), 0.88);
    EXPECT_GT(printed_scores.f_measure(), 0.8);  // Eq. 6 as it stands
  }
}

TEST(DepthPreprocessing, PutsAWindowBehindThePersonInFrontOfIt) {
  const auto sequence = make_sequence("window", {.frames = 60});
  ASSERT_TRUE(sequence);
  DepthPreprocessing chain;
  Scores with, without;
  double error = 0, gaps = 0;
  for (std::size_t i = 0; i < 44; ++i) {
    const TrueFrame truth = sequence->frame(i);
    const PreprocessedDepth& result = chain.next(truth.frame.depth, truth.frame.colour);
    if (i < 14 || i % 4 != 0) continue;  // he stands in front of the windows from frame 24 to 36
    with.add(result.foreground, truth.foreground);
    DisparityImage alone;
    to_disparity(chain.inpainted(), alone);
    MaskImage nearer;
    cv::compare(chain.background().disparity() - alone, 4.0, nearer, cv::CMP_GT);
    MaskImage outline;
    majority_of_nine(nearer, outline);
    without.add(outline, truth.foreground);
    for (int y = 0; y < truth.depth.rows; ++y) {
      for (int x = 0; x < truth.depth.cols; ++x) {
        const std::uint16_t entity = truth.entities(y, x);
        if (entity == 0 || !truth.scene.entities[entity - 1U].name.starts_with("window")) continue;
        error += std::abs(static_cast<double>(result.disparity(y, x)) - normalised_disparity(truth.depth(y, x)));
        ++gaps;
      }
    }
  }
  EXPECT_GT(gaps, 10000);
  EXPECT_LT(error / gaps, 2);         // steps
  EXPECT_GE(with.overlap(), 0.95);    // the person's outline
  EXPECT_LT(without.overlap(), 0.8);  // with the pyramid alone the window belongs to the person
}

TEST(DepthPreprocessing, FindsTheBackgroundWhilePeopleCross) {
  const auto sequence = make_sequence("people_crossing", {.width = 160, .height = 120});
  ASSERT_TRUE(sequence);
  const TrueFrame empty = sequence->frame(0);
  DepthPreprocessing chain;
  double error = 0;
  for (std::size_t i = 90; i < sequence->size(); ++i) {  // from when people are there
    const TrueFrame truth = sequence->frame(i);
    chain.next(truth.frame.depth, truth.frame.colour);
    if (i + 1 < sequence->size()) continue;
    for (int y = 0; y < 120; ++y) {
      for (int x = 0; x < 160; ++x) {
        error += std::pow(
            static_cast<double>(chain.background().disparity()(y, x)) - normalised_disparity(empty.depth(y, x)), 2);
      }
    }
  }
  EXPECT_LT(std::sqrt(error / (160 * 120)), 1.5);  // steps
}

TEST(DepthPreprocessing, TakesFramesThatHoldNothing) {
  DepthPreprocessing chain;
  const DepthImage nothing(12, 16, std::uint16_t{0});
  const DepthImage wall(12, 16, std::uint16_t{2000});
  const PreprocessedDepth& result = chain.next(nothing, {});
  EXPECT_EQ(cv::countNonZero(result.foreground), 0);
  EXPECT_TRUE(is_gap(result.disparity(3, 3)));
  chain.next(wall, {});
  EXPECT_NEAR(static_cast<double>(result.disparity(3, 3)), normalised_disparity(2000), 1e-3);
  EXPECT_EQ(cv::countNonZero(result.foreground), 0);
  chain.next(nothing, {});  // the background is known by now
  EXPECT_NEAR(static_cast<double>(result.disparity(3, 3)), normalised_disparity(2000), 1e-3);
  EXPECT_EQ(cv::countNonZero(result.foreground), 0);
  DepthImage thing = wall.clone();
  thing(cv::Rect(2, 2, 6, 6)).setTo(1500);
  chain.next(thing, {});
  EXPECT_EQ(cv::countNonZero(result.foreground), 36 - 4);  // the majority rounds the corners
  // One pixel, and another size in the middle of it all.
  chain.next(DepthImage(1, 1, std::uint16_t{900}), {});
  EXPECT_EQ(result.foreground.size(), cv::Size(1, 1));
  EXPECT_EQ(result.foreground(0, 0), 0);
  chain.next(DepthImage(), {});
  EXPECT_TRUE(result.foreground.empty());
}

}  // namespace
}  // namespace sherlog::rgbd
