// Disparity, noise and inpainting against slow twins that follow the paper's words.
#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <set>

#include "rgbd/depth/noise_statistics.h"
#include "rgbd/depth/pyramid_inpainting.h"
#include "rgbd/synthetic/sequences.h"

namespace sherlog::rgbd {
namespace {

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

// Alg. 2 word by word, on to the last pixel: walk up from every gap.
DepthImage inpainting_twin(const DepthImage& depth, std::size_t& pixels) {
  std::vector<DepthImage> pyramid = {depth};
  while (pyramid.back().rows > 1 || pyramid.back().cols > 1)
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
  for (const cv::Size size : {cv::Size{64, 64}, {160, 120}, {33, 70}}) {
    for (const double gaps : {0.2, 0.9, 0.999}) {
      const DepthImage depth = random_depth(7, size.width, size.height, gaps);
      ASSERT_GT(cv::countNonZero(depth), 0);
      DepthImage filled;
      PyramidInpainting().apply(depth, filled);
      EXPECT_EQ(cv::countNonZero(filled == 0), 0);
      const std::set<std::uint16_t> measured(depth.begin(), depth.end());
      for (const std::uint16_t value : filled) EXPECT_TRUE(measured.contains(value));
    }
  }
}

TEST(PyramidInpainting, LeavesNoGapWhereOnePixelIsValid) {
  std::mt19937_64 random(8);
  for (const InpaintingFilter filter : {InpaintingFilter::kMedian, InpaintingFilter::kBinomial}) {
    PyramidInpainting inpainting(filter);
    for (const cv::Size size : {cv::Size{640, 480},
                                {320, 240},
                                {64, 2},
                                {2, 65},
                                {7, 5},
                                {1, 1},
                                {1, 2},
                                {1, 31},
                                {47, 1},
                                {100, 3},
                                {1025, 9}}) {
      for (int run = 0; run < 4; ++run) {
        DepthImage depth(size, std::uint16_t{0}), filled;
        const auto below = [&](int n) { return static_cast<int>(random() % static_cast<std::uint64_t>(n)); };
        // Corners and random places.
        const cv::Point valid = run == 0   ? cv::Point{0, 0}
                                : run == 1 ? cv::Point{size.width - 1, size.height - 1}
                                           : cv::Point{below(size.width), below(size.height)};
        depth(valid) = 1234;
        inpainting.apply(depth, filled);
        EXPECT_EQ(cv::countNonZero(filled != 1234), 0) << size << " " << valid;
      }
    }
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

}  // namespace
}  // namespace sherlog::rgbd
