#include "inference/chain_diagnostics.h"

#include <gtest/gtest.h>

#include <algorithm>

namespace sherlog {
namespace {

// A binary chain that keeps its value with probability `stay`, from the minimal standard generator (16807 mod 2^31 - 1), so that
// the same numbers can be made elsewhere.
std::vector<int> chain(std::uint64_t seed, std::uint32_t n, double stay) {
  std::vector<int> x;
  int current = 0;
  for (std::uint32_t i = 0; i < n; ++i) {
    seed = seed * 16807 % 2147483647;
    if (static_cast<double>(seed) / 2147483647.0 > stay) current = 1 - current;
    x.push_back(current);
  }
  return x;
}

BinarySummary summarize_chains(const std::vector<std::vector<int>>& chains) {
  std::vector<BinaryRecorder> recorders;
  const auto draws = static_cast<std::uint32_t>(chains.front().size());
  for (const auto& values : chains) {
    recorders.emplace_back(1, draws);
    for (int value : values) {
      recorders.back().record(0, value != 0);
      recorders.back().next_draw();
    }
    recorders.back().finish();
  }
  std::vector<std::span<const std::uint64_t>> words;
  for (const auto& recorder : recorders) words.push_back(recorder.of(0));
  return summarize(words, draws);
}

// Expected values: R 4.2, package posterior 1.4.0: rhat(), ess_bulk() of a 1001 x 4 matrix of these chains.
struct Case {
  double stay, mean, rhat, ess;
};

class ChainDiagnostics : public testing::TestWithParam<Case> {};

TEST_P(ChainDiagnostics, AgreesWithTheRPackagePosterior) {
  std::vector<std::vector<int>> chains;
  for (std::uint64_t c = 1; c <= 4; ++c) chains.push_back(chain(1000 * c + 7, 1001, GetParam().stay));
  const BinarySummary summary = summarize_chains(chains);
  EXPECT_NEAR(summary.mean, GetParam().mean, 1e-9);
  EXPECT_NEAR(*summary.rhat, GetParam().rhat, 1e-9);
  EXPECT_NEAR(*summary.ess, GetParam().ess, 1e-5 * GetParam().ess);
}

INSTANTIATE_TEST_SUITE_P(Persistence, ChainDiagnostics,
                         testing::Values(Case{0.50, 0.5102397602, 0.9993828973, 4030.977844},
                                         Case{0.90, 0.4980019980, 1.0112389644, 438.142235},
                                         Case{0.20, 0.4960039960, 0.9992152145, 14408.239965},
                                         Case{0.98, 0.5804195804, 1.0466407983, 75.260251}));

TEST(ChainDiagnosticsOfShiftedChains, AgreeWithTheRPackagePosterior) {
  std::vector<std::vector<int>> chains;
  for (std::uint64_t c = 1; c <= 4; ++c) chains.push_back(chain(1000 * c + 7, 1000, 0.6));
  const std::vector<int> more = chain(99, 1000, 0.3);
  for (std::size_t i = 0; i < more.size(); ++i) chains[0][i] = std::max(chains[0][i], more[i]);
  const BinarySummary summary = summarize_chains(chains);
  EXPECT_NEAR(*summary.rhat, 1.0304953925, 1e-9);
  EXPECT_NEAR(*summary.ess, 125.695936, 1e-3);
}

TEST(ChainDiagnosticsOfStuckChains, GiveTheLargestRhat) {
  const BinarySummary summary = summarize_chains(
      {std::vector<int>(100, 0), std::vector<int>(100, 1), std::vector<int>(100, 0), std::vector<int>(100, 1)});
  EXPECT_DOUBLE_EQ(*summary.rhat, kLargestRhat);
  EXPECT_GT(summary.mcse, 0.1);
}

TEST(ChainDiagnosticsOfConstantChains, DoNotClaimCertainty) {
  const BinarySummary summary = summarize_chains({std::vector<int>(1000, 0), std::vector<int>(1000, 0)});
  EXPECT_DOUBLE_EQ(summary.mean, 0.0);
  EXPECT_DOUBLE_EQ(*summary.rhat, 1.0);
  // (0 + 1) / (2000 + 2) of 2000 draws: sqrt(p / 2000) = 5.0e-4
  EXPECT_NEAR(summary.mcse, 5.0e-4, 1e-5);
}

// A two-state chain that stays with probability s has autocorrelation (2s - 1)^lag: its draws are worth (1 - r) / (1 + r) each.
TEST(ChainDiagnosticsOfSlowChains, JudgeByBatchesWhereLagsGoOnForLong) {
  constexpr double kStay = 0.998, kCorrelation = 2 * kStay - 1;
  constexpr std::uint32_t kDraws = 200000;
  std::vector<std::vector<int>> chains;
  for (std::uint64_t c = 1; c <= 4; ++c) chains.push_back(chain(1000 * c + 7, kDraws, kStay));
  const double expected = 4.0 * kDraws * (1 - kCorrelation) / (1 + kCorrelation);
  EXPECT_NEAR(*summarize_chains(chains).ess, expected, 0.15 * expected);
}

TEST(ChainDiagnosticsOfChainsApart, CountAboutOneDrawForEachChain) {
  std::vector<std::vector<int>> chains;
  for (std::uint64_t c = 1; c <= 4; ++c) {
    chains.push_back(chain(1000 * c + 7, 5000, 0.5));
    for (std::size_t i = 0; i < chains.back().size(); ++i) {
      const int other = i % 97 == 0 ? chains.back()[i] : 0;  // mostly constant
      chains.back()[i] = c % 2 == 0 ? 1 - other : other;
    }
  }
  const BinarySummary summary = summarize_chains(chains);
  EXPECT_GT(*summary.rhat, 2.0);
  EXPECT_LT(*summary.ess, 10.0);
  EXPECT_GT(summary.mcse, 0.1);
}

}  // namespace
}  // namespace sherlog
