#include "rgbd/pose/descriptor.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>
#include <opencv2/imgproc.hpp>
#include <random>

#include "rgbd/pose/keypoints.h"
#include "rgbd/synthetic/person.h"

namespace sherlog::rgbd {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr int kWidth = 160, kHeight = 160;

const HilbertMap& map_of_image() {
  static const HilbertMap map = make_hilbert_map(kWidth, kHeight);
  return map;
}

std::vector<Pixel> line(double degrees, int length, Pixel start) {
  std::vector<Pixel> points;
  for (int i = 0; i < length; ++i) {
    const Pixel p{start.x + static_cast<int>(std::lround(i * std::cos(degrees * kPi / 180))),
                  start.y - static_cast<int>(std::lround(i * std::sin(degrees * kPi / 180)))};
    if (points.empty() || points.back() != p) points.push_back(p);
  }
  return points;
}

PoseDescriptor described(const std::vector<Pixel>& points, double smoothing = 0.7) {
  const auto directions = branch_directions(map_of_image(), points, 6);
  return describe_pose(points, directions.value(), {.smoothing = smoothing}).value();
}

// The skeleton of a person in a posture, seen from in front of it.
std::vector<Pixel> stick_figure(const Posture& posture) {
  Scene scene;
  add_person(scene, "person", 1, posture, {});
  const View view = render(scene, kinect_calibration(kWidth, kHeight), look_at({0, -2.2, 1.0}, {0, 0, 0.95}));
  MaskImage mask;
  cv::compare(view.entities, 0, mask, cv::CMP_NE);
  thin(mask);
  std::vector<Pixel> points;
  for (int y = 0; y < mask.rows; ++y) {
    for (int x = 0; x < mask.cols; ++x) {
      if (mask(y, x) != 0) points.push_back({x, y});
    }
  }
  return points;
}

// Four classes: arms hanging, one raised aside, both raised, and a stride seen from the side.
Posture posture_of(std::size_t kind, std::mt19937_64& random) {
  std::uniform_real_distribution<double> wobble(-1, 1);
  Posture p{.heading = -kPi / 2, .height = 1.75 + 0.08 * wobble(random), .swing = 0.05 * wobble(random)};
  p.place = {0.1 * wobble(random), 0, 0};
  p.spread = 0.15;
  if (kind == 1) p.left_arm = 2.9 + 0.08 * wobble(random);
  if (kind == 2) p.left_arm = p.right_arm = 2.9 + 0.08 * wobble(random);
  if (kind == 3) {
    p.heading = 0.1 * wobble(random);
    p.swing = 0.6;
    p.phase = kPi / 2 + 0.2 * wobble(random);
  }
  return p;
}

TEST(BranchDirection, IsThatOfTheLine) {
  std::vector<double> errors;
  for (int degrees = 0; degrees < 180; degrees += 5) {
    const std::vector<Pixel> points = line(degrees, 50, {80, 80});
    const auto directions = branch_directions(map_of_image(), points, 6);
    ASSERT_TRUE(directions);
    for (const float d : *directions) {
      EXPECT_GE(d, 0.0F);
      errors.push_back(std::abs(std::remainder(static_cast<double>(d) - degrees * kPi / 180, kPi)) * 180 / kPi);
    }
  }
  std::ranges::nth_element(errors, errors.begin() + static_cast<std::ptrdiff_t>(errors.size() / 2));
  EXPECT_LT(errors[errors.size() / 2], 10);
  EXPECT_FALSE(branch_directions(map_of_image(), {}, 6));
  EXPECT_FALSE(branch_directions(map_of_image(), std::vector<Pixel>{{500, 1}}, 6));
}

TEST(PoseDescriptor, HasABinForEachDirection) {
  static_assert(kPoseLength == 324);
  for (const std::size_t bin : {0U, 1U, 2U, 3U}) {
    const PoseDescriptor pose = described(line(45.0 * static_cast<double>(bin), 60, {80, 90}), 0);
    std::array<double, 4> sums{};
    for (std::size_t k = 0; k < kPoseLength; ++k) sums[k % 4] += static_cast<double>(pose[k]);
    EXPECT_GT(sums[bin], 0.95);
    EXPECT_NEAR(sums[0] + sums[1] + sums[2] + sums[3], 1, 1e-5);
  }
  EXPECT_FALSE(describe_pose(std::vector<Pixel>{{1, 1}}, std::vector<float>{0}));
  EXPECT_FALSE(describe_pose(std::vector<Pixel>{{1, 1}, {2, 2}}, std::vector<float>{0}));
}

TEST(PoseDescriptor, IsTheSameElsewhereAndLarger) {
  std::mt19937_64 random(1);
  const std::vector<Pixel> points = stick_figure(posture_of(2, random));
  std::vector<float> directions = branch_directions(map_of_image(), points, 6).value();
  const PoseDescriptor pose = describe_pose(points, directions).value();
  std::vector<Pixel> moved = points, larger;
  for (Pixel& p : moved) p = {p.x + 17, p.y - 5};
  EXPECT_EQ(describe_pose(moved, directions).value(), pose);
  for (const Pixel& p : points) larger.push_back({3 * p.x, 3 * p.y});
  EXPECT_GT(correlation(describe_pose(larger, directions).value(), pose), 0.97);  // rounding to cells
}

TEST(Correlation, IsOneWithItselfAndMinusOneWithTheOpposite) {
  std::mt19937_64 random(1);
  const PoseDescriptor pose = described(stick_figure(posture_of(0, random)));
  PoseDescriptor opposite = pose;
  for (float& value : opposite) value = -value;
  EXPECT_NEAR(similarity(correlation(pose, pose)), 100, 1e-9);
  EXPECT_NEAR(similarity(correlation(pose, opposite)), 0, 1e-9);
  EXPECT_EQ(similarity(0), 50);
  EXPECT_EQ(correlation(pose, PoseDescriptor{}), 0);
}

// Lines between joints, by angles in degrees from upright, clockwise: trunk, thighs, shins, upper and lower arms.
using Angles = std::array<double, 9>;
std::vector<Pixel> drawn_figure(const Angles& angles, std::mt19937_64& random) {
  std::uniform_real_distribution<double> wobble(-6, 6), place(-8, 8), size(0.9, 1.2);
  const double scale = size(random);
  MaskImage mask(kHeight, kWidth, std::uint8_t{0});
  const auto bone = [&](cv::Point2d from, double angle, double length) {
    const double radians = (angle + wobble(random)) * kPi / 180;
    const cv::Point2d to = from + scale * length * cv::Point2d(std::sin(radians), -std::cos(radians));
    cv::line(mask, from, to, cv::Scalar(255));
    return to;
  };
  const cv::Point2d hips(80 + place(random), 85 + place(random));
  const cv::Point2d neck = bone(hips, angles[0], 30);
  bone(neck, angles[0], 8);
  for (const std::size_t side : {0U, 1U}) {
    bone(bone(hips, angles[1 + side], 20), angles[3 + side], 20);
    bone(bone(neck, angles[5 + side], 15), angles[7 + side], 15);
  }
  std::vector<Pixel> points;
  for (int y = 0; y < mask.rows; ++y) {
    for (int x = 0; x < mask.cols; ++x) {
      if (mask(y, x) != 0) points.push_back({x, y});
    }
  }
  return points;
}

// Whole bodies differ. (Poses of which only the arms do correlate at 0.7: trunk and legs are most of a skeleton.)
constexpr std::array<Angles, 5> kFigures = {{{0, 176, 184, 178, 182, 170, 190, 175, 185},     // stands
                                             {0, 145, 215, 145, 215, 60, 300, 50, 310},       // jumps, all spread
                                             {85, 180, 185, 180, 185, 165, 175, 165, 175},    // bends forward
                                             {5, 95, 100, 180, 185, 130, 140, 95, 100},       // sits
                                             {88, 268, 274, 265, 272, 280, 262, 275, 268}}};  // lies

TEST(PoseLibrary, FindsPosesOfTheSameKind) {
  std::mt19937_64 random(5);
  PoseLibrary library;
  std::vector<std::size_t> kinds;
  for (std::size_t i = 0; i < 200; ++i) {
    if (library.add(described(drawn_figure(kFigures[i % 5], random)))) kinds.push_back(i % 5);
  }
  EXPECT_GT(library.size(), 190U);
  EXPECT_FALSE(library.add(PoseDescriptor(library[3])));  // seen before
  double hits = 0, all = 0;
  for (std::size_t i = 0; i < library.size(); ++i) {
    const std::vector<PoseMatch> matches = library.find(library[i]);
    ASSERT_FALSE(matches.empty());
    EXPECT_EQ(matches[0].pose, i);
    for (const PoseMatch& match : matches) {
      if (match.pose == i) continue;
      all += 1;
      hits += kinds[match.pose] == kinds[i] ? 1 : 0;
    }
  }
  EXPECT_GE(hits / all, 0.9);
  EXPECT_GT(all / static_cast<double>(library.size()), 15);  // of 39 others of the kind
}

// "A consistent anticorrelation consists between the most clearly outlined skeletons and the most noisy detections": a
// few keypoints, scattered or in one place. People from in front are outlined clearly, a stride from the side is not.
TEST(PoseLibrary, NoiseIsAnticorrelatedWithSkeletons) {
  std::mt19937_64 random(6);
  std::array<double, 4> sums{};
  double good = 0;
  constexpr std::size_t kSamples = 400;
  for (std::size_t round = 0; round < kSamples; ++round) {
    const std::size_t kind = round % 4;
    const PoseDescriptor skeleton = described(stick_figure(posture_of(kind, random)));
    std::uniform_int_distribution<int> count(2, 12), place(70, round % 8 < 4 ? 78 : 130);
    for (int noise = 0; noise < 20; ++noise) {
      std::vector<Pixel> points(static_cast<std::size_t>(count(random)));
      for (Pixel& p : points) p = {place(random), place(random)};
      const double c = correlation(described(points), skeleton);
      sums[kind] += c / (20.0 * kSamples / 4);
      good += c >= 0.5 ? 1 : 0;
    }
  }
  for (const std::size_t kind : {0U, 1U, 2U}) EXPECT_LT(sums[kind], -0.01) << kind;
  EXPECT_NEAR(sums[3], 0, 0.02);
  EXPECT_LT(good / (20 * kSamples), 0.005);  // of those that retrieval would return
}

}  // namespace
}  // namespace sherlog::rgbd
