#include "inference/elimination.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "inference/elimination_plan.h"
#include "tests/support/random_tables.h"

namespace sherlog {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

using Case = Tables;

// Up to eight variables of up to four values in up to eight tables, some entries impossible.
Case random_case(std::uint64_t seed, double spread) { return random_tables(seed, {.tables = 8, .spread = spread}); }

double log_value(const Case& c, const std::vector<std::uint32_t>& values) {
  double sum = 0.0;
  for (std::size_t t = 0; t < c.tables.size(); ++t) {
    std::size_t index = 0;
    for (const std::uint32_t v : c.scopes[t]) index = index * c.cardinalities[v] + values[v];
    sum += c.tables[t][index];
  }
  return sum;
}

struct Enumerated {
  double log_partition = -kInfinity;
  double maximum = -kInfinity;
  std::vector<std::vector<double>> marginals;
  std::vector<double> log_values;  // of each assignment, last variable fastest
};

Enumerated enumerate(const Case& c) {
  Enumerated out;
  std::vector<std::uint32_t> values(c.cardinalities.size(), 0);
  std::vector<std::vector<std::uint32_t>> all;
  while (true) {
    all.push_back(values);
    out.log_values.push_back(log_value(c, values));
    out.maximum = std::max(out.maximum, out.log_values.back());
    std::size_t d = values.size();
    while (d > 0 && ++values[d - 1] == c.cardinalities[d - 1]) values[--d] = 0;
    if (d == 0) break;
  }
  for (const std::uint32_t k : c.cardinalities) out.marginals.emplace_back(k, 0.0);
  if (out.maximum == -kInfinity) return out;
  double sum = 0.0;
  for (const double x : out.log_values) sum += std::exp(x - out.maximum);
  out.log_partition = out.maximum + std::log(sum);
  for (std::size_t i = 0; i < all.size(); ++i) {
    for (std::size_t v = 0; v < values.size(); ++v) {
      out.marginals[v][all[i][v]] += std::exp(out.log_values[i] - out.log_partition);
    }
  }
  return out;
}

BucketTree tree_of(const Case& c) {
  return BucketTree(c.cardinalities, c.scopes, find_elimination_order(c.cardinalities, c.scopes).order);
}

void expect_equal(const SumProductResult& result, const Enumerated& expected) {
  if (expected.maximum == -kInfinity) {
    EXPECT_EQ(result.log_partition, -kInfinity);
    return;
  }
  EXPECT_NEAR(result.log_partition, expected.log_partition, 1e-10 * (1.0 + std::abs(expected.log_partition)));
  ASSERT_EQ(result.marginals.size(), expected.marginals.size());
  for (std::size_t v = 0; v < expected.marginals.size(); ++v) {
    for (std::size_t k = 0; k < expected.marginals[v].size(); ++k) {
      EXPECT_NEAR(result.marginals[v][k], expected.marginals[v][k], 1e-11) << "variable " << v << " value " << k;
    }
  }
}

TEST(Elimination, SumsEqualEnumerationInPlainNumbersAndLogarithms) {
  Monitor monitor;
  const StopCondition stop(monitor);
  int possible = 0;
  for (std::uint64_t seed = 0; seed < 300; ++seed) {
    SCOPED_TRACE(seed);
    const Case c = random_case(seed, 3.0);
    const Enumerated expected = enumerate(c);
    possible += expected.maximum > -kInfinity ? 1 : 0;
    const SumProductResult plain = sum_product(tree_of(c), c.tables, stop);
    EXPECT_FALSE(plain.in_logarithms);
    expect_equal(plain, expected);
    expect_equal(sum_product_in_logarithms(tree_of(c), c.tables, stop), expected);
  }
  EXPECT_GT(possible, 100);
}

TEST(Elimination, HugeWeightsAreSummedInLogarithms) {
  Monitor monitor;
  const StopCondition stop(monitor);
  int in_logarithms = 0;
  for (std::uint64_t seed = 0; seed < 200; ++seed) {
    SCOPED_TRACE(seed);
    const Case c = random_case(seed, 2000.0);
    const SumProductResult result = sum_product(tree_of(c), c.tables, stop);
    in_logarithms += result.in_logarithms ? 1 : 0;
    expect_equal(result, enumerate(c));
  }
  EXPECT_GT(in_logarithms, 50);
}

// By table, as enumeration has them.
std::vector<std::vector<double>> table_marginals(const Case& c, const Enumerated& all) {
  std::vector<std::vector<double>> out;
  for (const auto& table : c.tables) out.emplace_back(table.size(), 0.0);
  std::vector<std::uint32_t> values(c.cardinalities.size(), 0);
  for (const double log_value : all.log_values) {
    for (std::size_t t = 0; t < c.tables.size(); ++t) {
      std::size_t index = 0;
      for (const std::uint32_t v : c.scopes[t]) index = index * c.cardinalities[v] + values[v];
      out[t][index] += std::exp(log_value - all.log_partition);
    }
    for (std::size_t d = values.size(); d > 0 && ++values[d - 1] == c.cardinalities[d - 1];) values[--d] = 0;
  }
  return out;
}

TEST(Elimination, TableMarginalsEqualEnumerationInPlainNumbersAndLogarithms) {
  Monitor monitor;
  const StopCondition stop(monitor);
  int possible = 0;
  for (std::uint64_t seed = 0; seed < 300; ++seed) {
    SCOPED_TRACE(seed);
    const Case c = random_case(seed, 3.0);
    const Enumerated all = enumerate(c);
    if (all.maximum == -kInfinity) continue;
    ++possible;
    const auto expected = table_marginals(c, all);
    for (const SumProductResult& result : {sum_product(tree_of(c), c.tables, stop, true, true),
                                           sum_product_in_logarithms(tree_of(c), c.tables, stop, false, true)}) {
      ASSERT_EQ(result.table_marginals.size(), expected.size());
      for (std::size_t t = 0; t < expected.size(); ++t) {
        ASSERT_EQ(result.table_marginals[t].size(), expected[t].size());
        for (std::size_t i = 0; i < expected[t].size(); ++i) {
          EXPECT_NEAR(result.table_marginals[t][i], expected[t][i], 1e-11) << "table " << t << " entry " << i;
        }
      }
    }
  }
  EXPECT_GT(possible, 100);
}

TEST(Elimination, MaximumEqualsEnumerationAndIsAttained) {
  Monitor monitor;
  const StopCondition stop(monitor);
  for (std::uint64_t seed = 0; seed < 300; ++seed) {
    SCOPED_TRACE(seed);
    const Case c = random_case(seed, 3.0);
    const Enumerated expected = enumerate(c);
    const MaxSumResult result = max_sum(tree_of(c), c.tables, stop);
    if (expected.maximum == -kInfinity) {
      EXPECT_EQ(result.log_maximum, -kInfinity);
      continue;
    }
    EXPECT_NEAR(result.log_maximum, expected.maximum, 1e-11);
    EXPECT_NEAR(log_value(c, result.values), expected.maximum, 1e-11);
  }
}

TEST(Elimination, StopsWhenAsked) {
  class Impatient : public Monitor {
    bool interrupted() const override { return true; }
  } impatient;
  const StopCondition stop(impatient);
  // A ring of 10,000 variables: enough work for the question to be asked.
  Case c;
  for (std::uint32_t v = 0; v < 10000; ++v) {
    c.cardinalities.push_back(4);
    c.scopes.push_back({v, (v + 1) % 10000});
    c.tables.emplace_back(16, 0.5);
  }
  const SumProductResult result = sum_product(tree_of(c), c.tables, stop);
  EXPECT_EQ(result.termination, Termination::kInterrupted);
  EXPECT_TRUE(result.marginals.empty());
  EXPECT_EQ(max_sum(tree_of(c), c.tables, stop).termination, Termination::kInterrupted);
}

// A plan with one filling.
struct Filling {
  EliminationPlan plan;
  EliminationPlan::Contents contents;
  EliminationPlan::Scratch scratch;

  Filling(std::vector<std::uint32_t> cardinalities, std::vector<std::vector<std::uint32_t>> scopes)
      : plan(std::move(cardinalities), std::move(scopes)) {
    plan.make_room(contents, scratch);
  }
  std::span<double> table(std::size_t t) { return plan.table(contents, t); }
  bool prepare() { return plan.prepare(contents, scratch); }
  void sample(Rng& rng, std::span<std::uint32_t> values) { plan.sample(contents, scratch, rng, values); }
  bool draw(Rng& rng, std::span<std::uint32_t> values) {
    if (!prepare()) return false;
    sample(rng, values);
    return true;
  }
  double log_partition() const { return contents.log_partition; }
  double log_probability(std::span<const std::uint32_t> values) {
    return plan.log_probability(contents, scratch, values);
  }
};

TEST(EliminationPlan, DrawsWithTheProbabilityOfTheProduct) {
  // Every assignment's frequency in 20,000 draws is within five standard errors of its probability.
  constexpr int kDraws = 20000;
  for (std::uint64_t seed = 0; seed < 25; ++seed) {
    SCOPED_TRACE(seed);
    const Case c = random_case(seed, 1.5);
    const Enumerated expected = enumerate(c);
    Filling plan(c.cardinalities, c.scopes);
    for (std::size_t t = 0; t < c.tables.size(); ++t) {
      const auto table = plan.table(t);
      ASSERT_EQ(table.size(), c.tables[t].size());
      for (std::size_t i = 0; i < table.size(); ++i) table[i] = std::exp(c.tables[t][i]);
    }
    Rng rng(seed, 1);
    std::vector<std::uint32_t> values(c.cardinalities.size());
    if (expected.maximum == -kInfinity) {
      EXPECT_FALSE(plan.draw(rng, values));
      continue;
    }
    ASSERT_TRUE(plan.prepare());
    EXPECT_NEAR(plan.log_partition(), expected.log_partition, 1e-10);
    std::vector<int> count(expected.log_values.size(), 0);
    for (int i = 0; i < kDraws; ++i) {
      plan.sample(rng, values);
      std::size_t index = 0;
      for (std::size_t v = 0; v < values.size(); ++v) index = index * c.cardinalities[v] + values[v];
      ++count[index];
      if (i < 20) {
        EXPECT_NEAR(plan.log_probability(values), log_value(c, values) - expected.log_partition, 1e-10);
      }
    }
    for (std::size_t i = 0; i < count.size(); ++i) {
      const double p = std::exp(expected.log_values[i] - expected.log_partition);
      if (p == 0.0) {
        EXPECT_EQ(count[i], 0);
        continue;
      }
      const double error = std::sqrt(kDraws * p * (1.0 - p));
      EXPECT_LE(std::abs(count[i] - kDraws * p), 5.0 * error + 2.0) << "assignment " << i;
    }
  }
}

TEST(EliminationPlan, CanBeRefilled) {
  Filling plan({2}, {{0}});
  Rng rng(1, 1);
  std::vector<std::uint32_t> values(1);
  for (const std::uint32_t only : {0u, 1u, 0u}) {
    plan.table(0)[0] = only == 0 ? 3.0 : 0.0;
    plan.table(0)[1] = only == 1 ? 3.0 : 0.0;
    ASSERT_TRUE(plan.draw(rng, values));
    EXPECT_EQ(values[0], only);
    EXPECT_NEAR(plan.log_partition(), std::log(3.0), 1e-12);
  }
  plan.table(0)[0] = plan.table(0)[1] = 0.0;
  EXPECT_FALSE(plan.draw(rng, values));
}

TEST(EliminationPlan, SurvivesProductsBelowTheSmallestDouble) {
  // Ten tables of (e^-100, e^-101): their product is far below 1e-308; the odds are e^10.
  std::vector<std::vector<std::uint32_t>> scopes(10, std::vector<std::uint32_t>{0});
  Filling plan({2}, scopes);
  for (std::size_t t = 0; t < 10; ++t) {
    plan.table(t)[0] = std::exp(-100.0);
    plan.table(t)[1] = std::exp(-101.0);
  }
  ASSERT_TRUE(plan.prepare());
  EXPECT_NEAR(plan.log_partition(), -1000.0 + std::log1p(std::exp(-10.0)), 1e-9);
  const std::vector<std::uint32_t> second{1};
  EXPECT_NEAR(plan.log_probability(second), -10.0 - std::log1p(std::exp(-10.0)), 1e-9);
}

TEST(EliminationPlan, KnowsItsCostBeforeItTakesMemory) {
  // A chain of 10 booleans: 9 joined tables of 4 entries and a last one of 2.
  std::vector<std::vector<std::uint32_t>> scopes;
  for (std::uint32_t v = 0; v + 1 < 10; ++v) scopes.push_back({v, v + 1});
  const EliminationPlan chain(std::vector<std::uint32_t>(10, 2), scopes);
  EXPECT_NEAR(chain.cost(), 9 * 4 + 2, 1e-9);
  // A clique of 40 booleans: 2^40 entries.
  scopes.clear();
  for (std::uint32_t a = 0; a < 40; ++a) {
    for (std::uint32_t b = 0; b < a; ++b) scopes.push_back({a, b});
  }
  Filling clique(std::vector<std::uint32_t>(40, 2), scopes);
  EXPECT_EQ(clique.plan.cost(), kInfinity);
  EXPECT_DOUBLE_EQ(clique.plan.largest_log2(), 40.0);
  EXPECT_FALSE(clique.prepare());
}

}  // namespace
}  // namespace sherlog
