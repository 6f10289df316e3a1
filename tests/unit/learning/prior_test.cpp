#include "learning/prior.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace sherlog {
namespace {

TEST(Prior, SlopeIsTheDerivativeOfTheDensity) {
  const Prior prior{0.5, 2.0, 0.0};
  EXPECT_NEAR(prior.log_density(2.5), -0.5, 1e-15);  // one standard deviation from the mean
  for (const double w : {-3.0, 0.0, 0.5, 1.7}) {
    EXPECT_NEAR(prior.slope(w), (prior.log_density(w + 1e-6) - prior.log_density(w - 1e-6)) / 2e-6, 1e-8);
  }
}

TEST(Prior, WithoutAStandardDeviationSaysNothing) {
  const Prior prior{3.0, std::numeric_limits<double>::infinity(), 0.0};
  EXPECT_EQ(prior.precision(), 0.0);
  EXPECT_EQ(prior.log_density(17.0), 0.0);
  EXPECT_EQ(prior.slope(17.0), 0.0);
  EXPECT_EQ(prior.mode(), 0.0);
}

// Against a grid: the mode is where density and L1 term together are largest.
TEST(Prior, ModeIsTheMostProbableWeight) {
  for (const Prior prior : {Prior{1.0, 2.0, 0.0}, Prior{1.0, 2.0, 0.1}, Prior{1.0, 2.0, 0.3}, Prior{-2.0, 1.0, 0.5},
                            Prior{0.0, 1.0, 1.0}}) {
    double best = 0.0, top = -std::numeric_limits<double>::infinity();
    for (int i = -4000; i <= 4000; ++i) {
      const double w = i * 1e-3, value = prior.log_density(w) - prior.l1 * std::abs(w);
      if (value > top) top = value, best = w;
    }
    EXPECT_NEAR(prior.mode(), best, 1e-3) << prior.mean << " " << prior.l1;
  }
}

}  // namespace
}  // namespace sherlog
