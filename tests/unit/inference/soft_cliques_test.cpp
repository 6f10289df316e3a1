#include "inference/soft_cliques.h"

#include <gtest/gtest.h>

#include <map>
#include <random>
#include <utility>

namespace sherlog {
namespace {

TEST(SoftCliques, FindsOneCliqueUnderEdgesOfUnequalWeight) {
  // All pairs of four vertices weigh 0.5, but one pair 0.75: the clique is whole and 0.25 is left on that pair.
  std::vector<SoftEdge> edges;
  for (std::uint32_t a = 0; a < 4; ++a) {
    for (std::uint32_t b = a + 1; b < 4; ++b) edges.push_back({a, b, a == 1 && b == 2 ? 0.75 : 0.5});
  }
  const auto cliques = find_soft_cliques(4, edges);
  ASSERT_EQ(cliques.size(), 1u);
  EXPECT_EQ(cliques[0].weight, 0.5);
  EXPECT_EQ(cliques[0].vertices, (std::vector<std::uint32_t>{0, 1, 2, 3}));
  for (const SoftEdge& e : edges) EXPECT_EQ(e.weight, e.a == 1 && e.b == 2 ? 0.25 : 0.0);
}

TEST(SoftCliques, LeavesAPathAlone) {
  std::vector<SoftEdge> edges{{0, 1, 1.0}, {1, 2, 1.0}, {2, 3, 1.0}};
  EXPECT_TRUE(find_soft_cliques(4, edges).empty());
  for (const SoftEdge& e : edges) EXPECT_EQ(e.weight, 1.0);
}

TEST(SoftCliques, CliquesAndRemaindersAddUpToTheEdges) {
  std::mt19937_64 random(3);
  for (int round = 0; round < 30; ++round) {
    std::vector<SoftEdge> edges;
    for (std::uint32_t a = 0; a < 14; ++a) {
      for (std::uint32_t b = a + 1; b < 14; ++b) {
        if (random() % 3 != 0) edges.push_back({a, b, 0.25 * static_cast<double>(1 + random() % 3)});
      }
    }
    std::map<std::pair<std::uint32_t, std::uint32_t>, double> before, after;
    for (const SoftEdge& e : edges) before[{e.a, e.b}] = e.weight;
    const auto cliques = find_soft_cliques(14, edges);
    EXPECT_FALSE(cliques.empty());
    for (const SoftEdge& e : edges) {
      EXPECT_GE(e.weight, 0.0);
      after[{e.a, e.b}] += e.weight;
    }
    for (const SoftClique& c : cliques) {
      ASSERT_GE(c.vertices.size(), 3u);
      for (std::size_t i = 0; i < c.vertices.size(); ++i) {
        for (std::size_t j = i + 1; j < c.vertices.size(); ++j) after[{c.vertices[i], c.vertices[j]}] += c.weight;
      }
    }
    EXPECT_EQ(before, after);  // multiples of a quarter: no rounding
  }
}

}  // namespace
}  // namespace sherlog
