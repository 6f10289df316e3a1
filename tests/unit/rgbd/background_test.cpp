// The background, the foreground in front of it, and the whole chain on synthetic sequences.
#include "rgbd/depth/background.h"

#include <gtest/gtest.h>

#include <map>
#include <numbers>
#include <opencv2/imgproc.hpp>
#include <opencv2/video/background_segm.hpp>
#include <random>

#include "rgbd/depth/mask_scores.h"
#include "rgbd/synthetic/sequences.h"

namespace sherlog::rgbd {
namespace {

constexpr double kPi = std::numbers::pi;
const std::vector<cv::Size> kSizes = {{1, 1}, {1, 7}, {9, 1}, {2, 2}, {8, 3}, {17, 16}, {33, 21}};

// --- E8: three sliding bins

// 70, 20 and 10 % at three angles, each with its noise.
struct Mixture {
  double mode, second, third, noise = 0;

  double draw(std::mt19937_64& random) const {
    const double u = std::uniform_real_distribution<double>()(random);
    const double angle = u < 0.7 ? mode : u < 0.9 ? second : third;
    return std::remainder(angle + noise * std::normal_distribution<double>()(random), 2 * kPi);
  }
  // Degrees between the mode and what is found after 200 values from a random start.
  double error(std::mt19937_64& random) const {
    SlidingBins bins;
    bins.reference = static_cast<float>(std::uniform_real_distribution<double>(-kPi, kPi)(random));
    for (int i = 0; i < 200; ++i) bins.add(static_cast<float>(draw(random)));
    return std::abs(std::remainder(static_cast<double>(bins.reference) - mode, 2 * kPi)) * 180 / kPi;
  }
};

TEST(SlidingBins, FindTheModeFromAnyStart) {
  std::mt19937_64 random(11);
  std::uniform_real_distribution<double> anywhere(-kPi, kPi);
  for (int scene = 0; scene < 100; ++scene) {
    const Mixture mixture{anywhere(random), anywhere(random), anywhere(random)};
    for (int start = 0; start < 10; ++start) {
      EXPECT_LT(mixture.error(random), 5) << "scene " << scene << ", start " << start;
    }
  }
}

TEST(SlidingBins, AreSeldomWrongAtAnyThreeAnglesWithNoise) {
  std::mt19937_64 random(12);
  std::uniform_real_distribution<double> anywhere(-kPi, kPi);
  int wrong = 0;
  for (int scene = 0; scene < 2000; ++scene) {
    const Mixture mixture{anywhere(random), anywhere(random), anywhere(random), 0.05};
    for (int start = 0; start < 4; ++start) wrong += mixture.error(random) < 5 ? 0 : 1;
  }
  EXPECT_LE(wrong, 8);  // of 8,000
}

// A mean of the bin would be 17 degrees off: 70, 20 and 10 % at 0, 58 and 50 degrees.
TEST(SlidingBins, AreNotPulledAwayByWhatSharesTheModesBin) {
  std::mt19937_64 random(13);
  for (const double noise : {0.0, 0.02}) {
    for (int start = 0; start < 100; ++start) {
      EXPECT_LT((Mixture{0.0, 58 * kPi / 180, 50 * kPi / 180, noise}.error(random)), 5) << start;
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

TEST(VoteOfNine, NeedsThreeFourOrFivePixels) {
  std::mt19937_64 random(4);
  for (const cv::Size size : kSizes) {
    for (const bool is_measured : {false, true}) {
      MaskImage mask(size), fast;
      for (std::uint8_t& m : mask) m = random() % 5 < 2 ? 255 : 0;
      DepthImage depth;
      if (is_measured) {
        depth.create(size);
        for (std::uint16_t& d : depth) d = static_cast<std::uint16_t>(random() % 2);
      }
      vote_of_nine(mask, depth, fast);
      for (int y = 0; y < size.height; ++y) {
        for (int x = 0; x < size.width; ++x) {
          const cv::Rect window = cv::Rect(x - 1, y - 1, 3, 3) & cv::Rect({0, 0}, size);
          const int needed = mask(y, x) != 0 ? 3 : is_measured && depth(y, x) == 0 ? 4 : 5;
          ASSERT_EQ(fast(y, x) != 0, cv::countNonZero(mask(window)) >= needed);
        }
      }
    }
  }
}

// --- E12, E13: whole sequences

TEST(DepthPreprocessing, IsBetterThanMixturesOfGaussiansOnEverySequence) {
  for (const std::string& name : sequence_names()) {
    // Nothing to find; nothing but people; too few frames to know what is always there.
    if (name == "empty_room" || name == "crowd" || name == "random_kitchen") continue;
    SCOPED_TRACE(name);
    const auto sequence = make_sequence(name, {.width = 160, .height = 120});
    ASSERT_TRUE(sequence);
    DepthPreprocessing ours, printed({}, printed_weights());
    MaskScores our_scores, printed_scores;
    std::map<std::string, MaskScores> theirs;
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
        MaskImage mask, voted;
        mixture->apply(image, mask);
        if (i == 0) continue;  // all of it is foreground to them
        theirs[input].add(mask, truth.foreground);
        vote_of_nine(mask, truth.frame.depth, voted);
        theirs[input + ", vote"].add(voted, truth.foreground);
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
  MaskScores with, without;
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
    vote_of_nine(nearer, {}, outline);
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

TEST(DepthPreprocessing, FindsTheOutlineOfPeopleInEveryRoom) {
  for (const char* name : {"people_crossing", "window", "hall"}) {
    const auto sequence = make_sequence(name, {.width = 320, .height = 240, .frames = 75});
    ASSERT_TRUE(sequence);
    DepthPreprocessing chain;
    MaskScores scores;
    for (std::size_t i = 0; i < sequence->size(); ++i) {
      const TrueFrame truth = sequence->frame(i);
      scores.add(chain.next(truth.frame.depth, truth.frame.colour).foreground, truth.foreground);
    }
    EXPECT_GE(scores.overlap(), 0.95) << name;
  }
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
  EXPECT_EQ(cv::countNonZero(result.foreground), 36);
  // One pixel, and another size in the middle of it all.
  chain.next(DepthImage(1, 1, std::uint16_t{900}), {});
  EXPECT_EQ(result.foreground.size(), cv::Size(1, 1));
  EXPECT_EQ(result.foreground(0, 0), 0);
  chain.next(DepthImage(), {});
  EXPECT_TRUE(result.foreground.empty());
}

}  // namespace
}  // namespace sherlog::rgbd
