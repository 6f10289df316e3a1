#include "inference/elimination_order.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "inference/rng.h"

namespace sherlog {
namespace {

using Scopes = std::vector<std::vector<std::uint32_t>>;

// Largest and total joined table of an order, by elimination on sets.
std::pair<double, double> simulate(const std::vector<std::uint32_t>& cardinalities, const Scopes& scopes,
                                   const std::vector<std::uint32_t>& order) {
  std::vector<std::set<std::uint32_t>> adjacent(cardinalities.size());
  for (const auto& scope : scopes) {
    for (const std::uint32_t a : scope) {
      for (const std::uint32_t b : scope) {
        if (a != b) adjacent[a].insert(b);
      }
    }
  }
  double largest = 0.0, total = 0.0;
  for (const std::uint32_t v : order) {
    double size = std::log2(cardinalities[v]);
    for (const std::uint32_t u : adjacent[v]) size += std::log2(cardinalities[u]);
    largest = std::max(largest, size);
    total += std::exp2(size);
    for (const std::uint32_t u : adjacent[v]) {
      adjacent[u].insert(adjacent[v].begin(), adjacent[v].end());
      adjacent[u].erase(u);
      adjacent[u].erase(v);
    }
  }
  return {largest, std::log2(total)};
}

Scopes grid(std::uint32_t rows, std::uint32_t columns) {
  Scopes scopes;
  for (std::uint32_t c = 0; c < columns; ++c) {
    for (std::uint32_t r = 0; r < rows; ++r) {
      if (r + 1 < rows) scopes.push_back({c * rows + r, c * rows + r + 1});
      if (c + 1 < columns) scopes.push_back({c * rows + r, (c + 1) * rows + r});
    }
  }
  return scopes;
}

TEST(EliminationOrder, IsAPermutationWhoseCostIsAsStated) {
  for (std::uint64_t seed = 0; seed < 200; ++seed) {
    SCOPED_TRACE(seed);
    Rng rng(seed, 0);
    const std::uint32_t n = 1 + rng.below(30);
    std::vector<std::uint32_t> cardinalities;
    for (std::uint32_t v = 0; v < n; ++v) cardinalities.push_back(1 + rng.below(4));
    Scopes scopes;
    for (std::uint32_t t = rng.below(3 * n); t > 0; --t) {
      std::set<std::uint32_t> scope;
      for (std::uint32_t i = 1 + rng.below(3); i > 0; --i) scope.insert(rng.below(n));
      scopes.emplace_back(scope.begin(), scope.end());
    }
    const EliminationOrder found = find_elimination_order(cardinalities, scopes);
    ASSERT_TRUE(found.complete);
    auto sorted = found.order;
    std::sort(sorted.begin(), sorted.end());
    ASSERT_EQ(sorted.size(), n);
    for (std::uint32_t v = 0; v < n; ++v) ASSERT_EQ(sorted[v], v);
    const auto [largest, total] = simulate(cardinalities, scopes, found.order);
    EXPECT_NEAR(found.largest_log2, largest, 1e-9);
    EXPECT_NEAR(found.total_log2, total, 1e-9);
  }
}

TEST(EliminationOrder, TreesHaveTablesOfTwoVariables) {
  Scopes scopes;
  Rng rng(1, 0);
  for (std::uint32_t v = 1; v < 400; ++v) scopes.push_back({rng.below(v), v});
  EXPECT_EQ(find_elimination_order(std::vector<std::uint32_t>(400, 2), scopes).largest_log2, 2.0);
}

TEST(EliminationOrder, RingsHaveTablesOfThreeVariables) {
  Scopes scopes;
  for (std::uint32_t v = 0; v < 10000; ++v) scopes.push_back({v, (v + 1) % 10000});
  EXPECT_EQ(find_elimination_order(std::vector<std::uint32_t>(10000, 2), scopes).largest_log2, 3.0);
}

TEST(EliminationOrder, AGridHasTablesOfItsShortSideAndOneMore) {
  // Treewidth of a 5 x 24 grid is 5, so six variables are joined; greedy orders may miss that by one.
  EXPECT_LE(find_elimination_order(std::vector<std::uint32_t>(120, 2), grid(5, 24)).largest_log2, 7.0);
}

TEST(EliminationOrder, ACliqueIsOneTable) {
  Scopes scopes;
  for (std::uint32_t a = 0; a < 30; ++a) {
    for (std::uint32_t b = 0; b < a; ++b) scopes.push_back({a, b});
  }
  const EliminationOrder found = find_elimination_order(std::vector<std::uint32_t>(30, 2), scopes);
  EXPECT_TRUE(found.complete);
  EXPECT_EQ(found.largest_log2, 30.0);
}

TEST(EliminationOrder, GivesUpAfterItsSteps) {
  OrderLimits limits;
  limits.max_steps = 1000;
  const EliminationOrder found = find_elimination_order(std::vector<std::uint32_t>(900, 2), grid(30, 30), limits);
  EXPECT_FALSE(found.complete);
  EXPECT_TRUE(found.order.empty());
}

}  // namespace
}  // namespace sherlog
