#include "inference/conflict.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>

namespace sherlog {
namespace {

Literal first(const NetworkBuilder& builder, VariableId v) { return Literal::atom(builder.first_atom(v)); }

// Every pigeon sits in a hole, no two in the same one.
GroundNetwork pigeons(std::size_t count, std::size_t holes) {
  NetworkBuilder builder;
  std::vector<std::vector<Literal>> sits(count);
  for (auto& row : sits) {
    for (std::size_t h = 0; h < holes; ++h) row.push_back(first(builder, builder.add_boolean()));
  }
  for (const auto& row : sits) {
    std::vector<Literal> inputs = row;
    builder.add_constraint(builder.make_or(inputs), FormulaId(0));
  }
  for (std::size_t h = 0; h < holes; ++h) {
    for (std::size_t p = 0; p < count; ++p) {
      for (std::size_t q = 0; q < p; ++q) {
        std::vector<Literal> pair{~sits[p][h], ~sits[q][h]};
        builder.add_constraint(builder.make_or(pair), FormulaId(1));
      }
    }
  }
  return builder.build();
}

std::vector<std::uint32_t> all_constraints(const GroundNetwork& network) {
  std::vector<std::uint32_t> all(network.constraints().size());
  std::iota(all.begin(), all.end(), 0u);
  return all;
}

class ConflictTest : public ::testing::Test {
 protected:
  Monitor monitor_;
  StopCondition stop_{monitor_};
};

TEST_F(ConflictTest, FourPigeonsInThreeHolesNeedEveryConstraint) {
  const GroundNetwork network = pigeons(4, 3);
  const auto all = all_constraints(network);
  EXPECT_EQ(small_conflict(network, all, stop_), all);
}

TEST_F(ConflictTest, AFifthPigeonIsLeftOut) {
  // Four of the five suffice: 4 disjunctions and, in each of 3 holes, 6 pairs.
  const GroundNetwork network = pigeons(5, 3);
  const auto conflict = small_conflict(network, all_constraints(network), stop_);
  EXPECT_EQ(conflict.size(), 4u + 3u * 6u);
  const auto proof = check_constraints(network, conflict, 100000, stop_);
  ASSERT_TRUE(proof.has_value());
  EXPECT_FALSE(proof->possible);
}

TEST_F(ConflictTest, AShortContradictionIsFoundAmongManyConstraints) {
  // 5,000 satisfiable implications, and a => b, b => c with a and !c in the midst.
  NetworkBuilder builder;
  std::vector<Literal> atoms;
  for (int i = 0; i < 5000; ++i) atoms.push_back(first(builder, builder.add_boolean()));
  std::vector<std::uint32_t> guilty;
  const auto add = [&](std::vector<Literal> clause) {
    builder.add_constraint(clause.size() == 1 ? clause[0] : builder.make_or(clause), FormulaId(0));
    return static_cast<std::uint32_t>(builder.so_far().constraints().size() - 1);
  };
  for (std::size_t i = 0; i + 1 < atoms.size(); ++i) {
    const auto c = add({~atoms[i], atoms[i + 1]});
    if (i == 2500 || i == 2501) guilty.push_back(c);
  }
  guilty.push_back(add({atoms[2500]}));
  guilty.push_back(add({~atoms[2502]}));
  const GroundNetwork network = builder.build();
  EXPECT_EQ(small_conflict(network, all_constraints(network), stop_), guilty);
}

TEST_F(ConflictTest, SearchFindsAWorldWhereThereIsOne) {
  const GroundNetwork network = pigeons(4, 4);
  const auto answer = check_constraints(network, all_constraints(network), 100000, stop_);
  ASSERT_TRUE(answer.has_value());
  EXPECT_TRUE(answer->possible);
}

TEST_F(ConflictTest, SearchEndsWithItsDecisions) {
  const GroundNetwork network = pigeons(12, 11);
  EXPECT_FALSE(check_constraints(network, all_constraints(network), 100, stop_).has_value());
}

}  // namespace
}  // namespace sherlog
