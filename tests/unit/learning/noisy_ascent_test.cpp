#include "learning/noisy_ascent.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

namespace sherlog {
namespace {

using testing::HasSubstr;

constexpr std::size_t kSize = 12;

// f = -1/2 (x - m)' H (x - m) with H = identity + 0.9 everywhere: one direction is twelve times as steep as each axis knows.
struct Coupled {
  static double target(std::size_t i) { return std::sin(1.0 + static_cast<double>(i)); }
  static std::vector<double> slope(const std::vector<double>& x) {
    double sum = 0.0;
    for (std::size_t i = 0; i < kSize; ++i) sum += target(i) - x[i];
    std::vector<double> result(kSize);
    for (std::size_t i = 0; i < kSize; ++i) result[i] = 0.1 * (target(i) - x[i]) + 0.9 * sum;
    return result;
  }
  // What x falls short of the maximum.
  static double gap(const std::vector<double>& x) {
    const std::vector<double> g = slope(x);
    double result = 0.0;
    for (std::size_t i = 0; i < kSize; ++i) result += 0.5 * (target(i) - x[i]) * g[i];
    return result;
  }
};

TEST(NoisyAscent, FindsTheMaximumWhereSlopesAreExact) {
  const auto evaluate = [](const std::vector<double>& x, std::uint32_t, SampledSlope& result) {
    result = {Coupled::slope(x), std::vector<double>(kSize, 1.0)};
    return true;
  };
  const NoisyAscentOutcome found = noisy_ascent(std::vector<double>(kSize, 0.0), evaluate, {});
  EXPECT_TRUE(found.converged) << found.reason;
  EXPECT_LT(Coupled::gap(found.x), 1e-9);
  EXPECT_LT(found.evaluations, 60u);
}

// The noise of n draws: covariance H / n. What is lost is near kSize / (2 n) at most, over many seeds.
TEST(NoisyAscent, AveragesNoiseAway) {
  constexpr double kDraws = 500.0;
  double sum = 0.0;
  constexpr int kSeeds = 40;
  for (int seed = 0; seed < kSeeds; ++seed) {
    std::mt19937_64 random(static_cast<std::uint64_t>(seed));
    std::normal_distribution<double> normal;
    const auto evaluate = [&](const std::vector<double>& x, std::uint32_t, SampledSlope& result) {
      result = {Coupled::slope(x), std::vector<double>(kSize, 1.0), kDraws};
      const double common = std::sqrt(0.9 / kDraws) * normal(random);
      for (double& slope : result.slope) slope += common + std::sqrt(0.1 / kDraws) * normal(random);
      return true;
    };
    const NoisyAscentOutcome found = noisy_ascent(std::vector<double>(kSize, 0.0), evaluate, {});
    EXPECT_TRUE(found.converged) << found.reason;
    sum += Coupled::gap(found.x);
  }
  EXPECT_LT(sum / kSeeds, 0.5 * kSize / (2.0 * kDraws));
}

// Flat far away and steep in the middle: -log cosh(20 x), whose axis curvature is told 400 times too small.
TEST(NoisyAscent, ComesBackFromStepsThatGoTooFar) {
  const auto evaluate = [](const std::vector<double>& x, std::uint32_t, SampledSlope& result) {
    result = {{-20.0 * std::tanh(20.0 * (x[0] - 0.3))}, {1.0}};
    return true;
  };
  const NoisyAscentOutcome found = noisy_ascent({2.0}, evaluate, {});
  EXPECT_TRUE(found.converged) << found.reason;
  EXPECT_NEAR(found.x[0], 0.3, 1e-5);
}

TEST(NoisyAscent, HandsOverWhereItWasWhenItIsStopped) {
  std::uint32_t calls = 0;
  const auto evaluate = [&](const std::vector<double>& x, std::uint32_t number, SampledSlope& result) {
    EXPECT_EQ(number, calls);
    if (++calls > 4) return false;
    result = {Coupled::slope(x), std::vector<double>(kSize, 1.0)};
    return true;
  };
  const std::vector<double> start(kSize, 0.0);
  const NoisyAscentOutcome found = noisy_ascent(start, evaluate, {});
  EXPECT_FALSE(found.converged);
  EXPECT_TRUE(found.cut_short);
  EXPECT_EQ(found.evaluations, 4u);
  EXPECT_LT(Coupled::gap(found.x), Coupled::gap(start));
}

TEST(NoisyAscent, SaysThatItsLimitWasReached) {
  const auto evaluate = [](const std::vector<double>& x, std::uint32_t, SampledSlope& result) {
    result = {Coupled::slope(x), std::vector<double>(kSize, 1.0)};
    return true;
  };
  NoisyAscentOptions options;
  options.max_evaluations = 3;
  const NoisyAscentOutcome found = noisy_ascent(std::vector<double>(kSize, 0.0), evaluate, options);
  EXPECT_FALSE(found.converged);
  EXPECT_FALSE(found.cut_short);
  EXPECT_THAT(found.reason, HasSubstr("limit of 3 iterations"));
}

}  // namespace
}  // namespace sherlog
