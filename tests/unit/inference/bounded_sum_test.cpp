#include "inference/bounded_sum.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "inference/elimination_order.h"
#include "inference/rng.h"
#include "tests/support/random_tables.h"

namespace sherlog {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

using Case = Tables;

// A table for each variable and each pair.
Case complete_case(std::uint64_t seed, std::uint32_t n, std::uint32_t values, double unary, double pair) {
  Rng rng(seed, 1);
  Case c;
  c.cardinalities.assign(n, values);
  const auto add = [&](std::vector<std::uint32_t> scope, std::size_t entries, double spread) {
    c.scopes.push_back(std::move(scope));
    c.tables.emplace_back();
    for (std::size_t i = 0; i < entries; ++i) c.tables.back().push_back(spread * (2.0 * rng.uniform() - 1.0));
  };
  for (std::uint32_t i = 0; i < n; ++i) add({i}, values, unary);
  for (std::uint32_t i = 0; i < n; ++i) {
    for (std::uint32_t j = 0; j < i; ++j) add({i, j}, std::size_t{values} * values, pair);
  }
  return c;
}

SumProductResult eliminate(const Case& c) {
  Monitor monitor;
  const StopCondition stop(monitor);
  const EliminationOrder order = find_elimination_order(c.cardinalities, c.scopes);
  return sum_product(BucketTree(c.cardinalities, c.scopes, order.order), c.tables, stop, true, true);
}

BoundedSumResult search(const Case& c, const BoundedSumOptions& options = {}) {
  Monitor monitor;
  const StopCondition stop(monitor);
  return bounded_sum(c.cardinalities, c.scopes, c.tables, options, stop);
}

void expect_near(const std::vector<std::vector<double>>& found, const std::vector<std::vector<double>>& expected,
                 double tolerance) {
  ASSERT_EQ(found.size(), expected.size());
  for (std::size_t t = 0; t < expected.size(); ++t) {
    ASSERT_EQ(found[t].size(), expected[t].size());
    for (std::size_t i = 0; i < expected[t].size(); ++i) {
      EXPECT_NEAR(found[t][i], expected[t][i], tolerance) << "table or variable " << t << " entry " << i;
    }
  }
}

// The sum is what elimination says, up to the gap that it admits, and the gap is no larger than asked for.
void expect_honest(const Case& c, const SumProductResult& expected, double gap) {
  BoundedSumOptions options;
  options.relative_gap = gap;
  const BoundedSumResult result = search(c, options);
  ASSERT_EQ(result.termination, Termination::kCompleted);
  if (expected.log_partition == -kInfinity) {
    EXPECT_EQ(result.log_partition, -kInfinity);
    EXPECT_TRUE(result.marginals.empty());
    return;
  }
  const double rounding = 1e-11 * (1.0 + std::abs(expected.log_partition));
  EXPECT_LE(result.relative_gap, gap);
  EXPECT_LE(result.log_partition, expected.log_partition + rounding);
  EXPECT_GE(result.log_partition + std::log1p(result.relative_gap), expected.log_partition - rounding);
  expect_near(result.marginals, expected.marginals, 2.0 * result.relative_gap + 1e-10);
  expect_near(result.table_marginals, expected.table_marginals, 2.0 * result.relative_gap + 1e-10);
}

TEST(BoundedSum, EqualsEliminationUpToTheGapItAdmits) {
  int possible = 0;
  for (std::uint64_t seed = 0; seed < 1500; ++seed) {
    SCOPED_TRACE(seed);
    const Case c = random_tables(seed, {.variables = 7,
                                        .values = seed % 2 == 0 ? 3u : 6u,
                                        .spread = seed % 3 == 0 ? 0.3 : 4.0,
                                        .impossible = seed % 5 == 0 ? 0u : 6u});
    const SumProductResult expected = eliminate(c);
    possible += expected.log_partition > -kInfinity ? 1 : 0;
    for (const double gap : {1e-10, 1e-2}) expect_honest(c, expected, gap);
  }
  EXPECT_GT(possible, 700);
}

TEST(BoundedSum, OfMostlyImpossibleTablesEqualsElimination) {
  int possible = 0, impossible = 0;
  for (std::uint64_t seed = 0; seed < 500; ++seed) {
    SCOPED_TRACE(seed);
    const Case c = random_tables(seed, {.variables = 8, .values = 4, .spread = 2.0, .impossible = 2});
    const SumProductResult expected = eliminate(c);
    ++(expected.log_partition > -kInfinity ? possible : impossible);
    expect_honest(c, expected, 1e-10);
  }
  EXPECT_GT(possible, 30);
  EXPECT_GT(impossible, 30);
}

TEST(BoundedSum, OfHugeWeightsEqualsElimination) {
  int summed = 0;
  for (std::uint64_t seed = 0; seed < 300; ++seed) {
    SCOPED_TRACE(seed);
    const Case c = random_tables(seed, {.variables = 6, .values = 4, .spread = 400.0, .impossible = 8});
    const SumProductResult expected = eliminate(c);
    const BoundedSumResult result = search(c);
    if (result.termination == Termination::kTooWide) continue;  // bounds too far off for plain numbers
    ++summed;
    expect_honest(c, expected, 1e-10);
  }
  EXPECT_GT(summed, 200);
}

TEST(BoundedSum, OfManyValuesDropsMostOfThem) {
  for (std::uint64_t seed = 0; seed < 4; ++seed) {
    SCOPED_TRACE(seed);
    const Case c = complete_case(seed, 5, 5 + 6 * static_cast<std::uint32_t>(seed), 12.0, 0.8);
    expect_honest(c, eliminate(c), 1e-10);
    expect_honest(c, eliminate(c), 1e-5);
  }
  // 13^7 = 63 million joint values.
  const BoundedSumResult result = search(complete_case(9, 7, 13, 25.0, 0.8));
  EXPECT_EQ(result.termination, Termination::kCompleted);
  EXPECT_LT(result.steps, 4'000'000u);
}

TEST(BoundedSum, StartsWhereASimilarOneEnded) {
  const Case c = complete_case(3, 5, 12, 10.0, 0.8);
  BoundedSumOptions options;
  const BoundedSumResult cold = search(c, options);
  options.first_threshold = cold.threshold;
  const BoundedSumResult warm = search(c, options);
  EXPECT_GT(cold.searches, 1u);
  EXPECT_EQ(warm.searches, 1u);
  EXPECT_EQ(warm.log_partition, cold.log_partition);
  EXPECT_EQ(warm.table_marginals, cold.table_marginals);
}

TEST(BoundedSum, WithoutMarginalsHasTheSameSum) {
  const Case c = complete_case(4, 5, 11, 8.0, 0.8);
  BoundedSumOptions options;
  options.with_marginals = false;
  const BoundedSumResult result = search(c, options);
  EXPECT_NEAR(result.log_partition, search(c).log_partition, 2e-10);
  EXPECT_TRUE(result.marginals.empty() && result.table_marginals.empty());
}

TEST(BoundedSum, SaysWhereMassIsSpreadTooWide) {
  BoundedSumOptions options;
  options.max_steps = 10'000'000;
  const BoundedSumResult result = search(complete_case(1, 8, 21, 0.1, 0.5), options);
  EXPECT_EQ(result.termination, Termination::kTooWide);
  EXPECT_TRUE(result.marginals.empty());
  EXPECT_LT(result.steps, 20'000'000u);
}

class Impatient : public Monitor {
  bool interrupted() const override { return true; }
};

TEST(BoundedSum, EndsWhenItIsInterrupted) {
  Impatient monitor;
  const StopCondition stop(monitor);
  const Case c = complete_case(1, 8, 21, 0.1, 0.5);
  EXPECT_EQ(bounded_sum(c.cardinalities, c.scopes, c.tables, {}, stop).termination, Termination::kInterrupted);
}

TEST(BoundedSum, OfNothingIsOne) {
  const BoundedSumResult result = search({});
  EXPECT_EQ(result.termination, Termination::kCompleted);
  EXPECT_EQ(result.log_partition, 0.0);
}

}  // namespace
}  // namespace sherlog
