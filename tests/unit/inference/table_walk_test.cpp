// The inner loops of elimination against counting by hand: any loops, whichever way they are walked.
#include "inference/table_walk.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>

#include "inference/rng.h"

namespace sherlog {
namespace {

// A joined table of up to nine loops, and a smaller table that has some of them, in any order.
struct Case {
  std::vector<BucketTree::Loop> loops;
  std::vector<double> small, joined;

  explicit Case(std::uint64_t seed) {
    Rng rng(seed, 0);
    std::size_t size = 1;
    const std::uint32_t depth = 1 + rng.below(9), most = seed % 4 == 0 ? 20 : 3;
    for (std::uint32_t d = 0; d < depth; ++d) {
      const std::uint32_t count = 1 + rng.below(size * most < 200000 ? most : 2);
      loops.push_back({count, 0});
      size *= count;
    }
    std::vector<std::size_t> order(loops.size());
    std::iota(order.begin(), order.end(), 0);
    for (std::size_t d = order.size(); d > 1; --d) {
      std::swap(order[d - 1], order[rng.below(static_cast<std::uint32_t>(d))]);
    }
    std::uint32_t stride = 1;
    for (const std::size_t d : order) {
      if (rng.below(3) == 0) continue;
      loops[d].stride = stride;
      stride *= loops[d].count;
    }
    for (std::uint32_t i = 0; i < stride; ++i) small.push_back(rng.uniform());
    for (std::size_t i = 0; i < size; ++i) joined.push_back(rng.uniform());
  }

  // Where the entry of the joined table lies in the small one.
  std::size_t offset_of(std::size_t entry) const {
    std::size_t offset = 0;
    for (std::size_t d = loops.size(); d-- > 0;) {
      offset += entry % loops[d].count * loops[d].stride;
      entry /= loops[d].count;
    }
    return offset;
  }
};

TEST(TableWalk, CombinesEachEntryWithItsOwn) {
  std::size_t blocks = 0;
  for (std::uint64_t seed = 0; seed < 2000; ++seed) {
    const Case c(seed);
    if (c.loops.size() > 4) ++blocks;
    std::vector<double> found = c.joined;
    table_walk::combine_into(c.loops, c.small.data(), found.data(), table_walk::kTimes);
    for (std::size_t i = 0; i < found.size(); ++i) {
      ASSERT_EQ(found[i], c.joined[i] * c.small[c.offset_of(i)]) << "seed " << seed << ", entry " << i;
    }
  }
  EXPECT_GT(blocks, 500u);
}

TEST(TableWalk, SumsOntoTheSmallerTable) {
  for (std::uint64_t seed = 0; seed < 2000; ++seed) {
    const Case c(seed);
    std::vector<double> found(c.small.size(), 0.0), expected(c.small.size(), 0.0);
    table_walk::sum_onto(c.loops, c.joined.data(), found.data());
    for (std::size_t i = 0; i < c.joined.size(); ++i) expected[c.offset_of(i)] += c.joined[i];
    for (std::size_t i = 0; i < found.size(); ++i)
      ASSERT_NEAR(found[i], expected[i], 1e-9 * expected[i]) << "seed " << seed;
  }
}

}  // namespace
}  // namespace sherlog
