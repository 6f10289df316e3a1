#include "inference/at_most_one.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "tests/oracles/enumeration.h"

namespace sherlog {
namespace {

Literal first(const NetworkBuilder& builder, VariableId v) { return Literal::atom(builder.first_atom(v)); }

void exclude(NetworkBuilder& builder, Literal a, Literal b) {
  std::vector<Literal> pair{~a, ~b};
  builder.add_constraint(builder.make_or(pair), FormulaId(0));
}

std::vector<VariableValue> values_of(std::initializer_list<std::pair<std::uint32_t, std::uint32_t>> pairs) {
  std::vector<VariableValue> out;
  for (const auto& [v, k] : pairs) out.push_back({VariableId(v), k});
  return out;
}

TEST(AtMostOne, FindsACliqueOfAtoms) {
  NetworkBuilder builder;
  std::vector<Literal> atoms;
  for (int i = 0; i < 5; ++i) atoms.push_back(first(builder, builder.add_boolean()));
  for (std::size_t i = 0; i < 5; ++i) {
    for (std::size_t j = 0; j < i; ++j) exclude(builder, atoms[i], atoms[j]);
  }
  const GroundNetwork network = builder.build();
  const AtMostOne found = find_at_most_one(network, ComponentId(0));
  ASSERT_EQ(found.groups.size(), 1u);
  EXPECT_EQ(found.groups[0], values_of({{0, 0}, {1, 0}, {2, 0}, {3, 0}, {4, 0}}));
  EXPECT_EQ(found.covered.size(), 10u);
}

TEST(AtMostOne, LeavesPairsAlone) {
  NetworkBuilder builder;
  std::vector<Literal> atoms;
  for (int i = 0; i < 4; ++i) atoms.push_back(first(builder, builder.add_boolean()));
  for (std::size_t i = 0; i + 1 < 4; ++i) exclude(builder, atoms[i], atoms[i + 1]);  // a path has no triangle
  const GroundNetwork network = builder.build();
  const AtMostOne found = find_at_most_one(network, ComponentId(0));
  EXPECT_TRUE(found.groups.empty());
  EXPECT_TRUE(found.covered.empty());
}

TEST(AtMostOne, ReadsPositiveLiteralsAsExclusionOfTheOtherValues) {
  // a v b, b v c, a v c: at most one of them is false (value 1).
  NetworkBuilder builder;
  std::vector<Literal> atoms;
  for (int i = 0; i < 3; ++i) atoms.push_back(first(builder, builder.add_boolean()));
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t j = 0; j < i; ++j) exclude(builder, ~atoms[i], ~atoms[j]);
  }
  const GroundNetwork network = builder.build();
  const AtMostOne found = find_at_most_one(network, ComponentId(0));
  ASSERT_EQ(found.groups.size(), 1u);
  EXPECT_EQ(found.groups[0], values_of({{0, 1}, {1, 1}, {2, 1}}));
  EXPECT_EQ(found.covered.size(), 3u);
}

// `size` x `size` blocks of four values, of which the first three exclude each other along rows and columns.
GroundNetwork one_to_one(std::size_t size) {
  NetworkBuilder builder;
  std::vector<AtomId> is;
  for (std::size_t i = 0; i < size * size; ++i) is.push_back(builder.first_atom(builder.add_anonymous(4, false)));
  const auto both = [&](std::size_t x, std::size_t y) {
    for (std::uint32_t e = 0; e < 3; ++e) {
      for (std::uint32_t f = 0; f < 3; ++f) {
        exclude(builder, Literal::atom(AtomId(is[x].value + e)), Literal::atom(AtomId(is[y].value + f)));
      }
    }
  };
  for (std::size_t o = 0; o < size; ++o) {
    for (std::size_t n = 0; n < size; ++n) {
      for (std::size_t m = 0; m < n; ++m) both(o * size + n, o * size + m);
      for (std::size_t m = 0; m < o; ++m) both(o * size + n, m * size + n);
    }
  }
  return builder.build();
}

TEST(AtMostOne, FindsRowsAndColumnsOfAOneToOneMatching) {
  const GroundNetwork network = one_to_one(20);  // 68,400 clauses
  const AtMostOne found = find_at_most_one(network, ComponentId(0));
  ASSERT_EQ(found.groups.size(), 40u);
  for (const auto& group : found.groups) EXPECT_EQ(group.size(), 60u);
  EXPECT_EQ(found.covered.size(), 68400u);
}

// Says stop after so many questions.
class Impatient : public Monitor {
 public:
  explicit Impatient(int patience) : patience_(patience) {}
  bool interrupted() const override { return patience_-- <= 0; }

 private:
  mutable int patience_;
};

TEST(AtMostOne, StoppedAnywhereImpliesWhatItSaysIsCovered) {
  const GroundNetwork network = one_to_one(6);
  const std::size_t all = find_at_most_one(network, ComponentId(0)).groups.size();
  bool some = false;
  for (int patience = 0; patience < 80; ++patience) {
    Impatient monitor(patience);
    const StopCondition stop(monitor);
    const AtMostOne found = find_at_most_one(network, ComponentId(0), &stop);
    some = some || (!found.groups.empty() && found.groups.size() < all);
    for (const std::uint32_t c : found.covered) {
      const auto inputs = network.gate_inputs(network.constraints()[c].literal.gate());
      const auto in = [&](const std::vector<VariableValue>& group, Literal literal) {
        return std::ranges::find(group, VariableValue{network.variable_of(literal.atom()),
                                                      network.value_of(literal.atom())}) != group.end();
      };
      EXPECT_TRUE(std::ranges::any_of(found.groups,
                                      [&](const auto& group) { return in(group, inputs[0]) && in(group, inputs[1]); }));
    }
  }
  EXPECT_TRUE(some);
}

TEST(AtMostOne, GroupsFollowFromTheirConstraintsAndImplyThem) {
  for (std::uint64_t seed = 0; seed < 100; ++seed) {
    SCOPED_TRACE(seed);
    std::mt19937_64 random(seed);
    NetworkBuilder builder;
    for (int i = 0; i < 6; ++i) {
      const bool block = random() % 3 == 0;
      builder.add_anonymous(block ? 3 : 1, !block || random() % 2 == 0);
    }
    const auto any_atom = [&] { return Literal::atom(AtomId(random() % builder.atom_count()), random() % 5 == 0); };
    for (int i = 0; i < 25; ++i) exclude(builder, any_atom(), any_atom());
    const GroundNetwork network = builder.build();
    std::vector<std::uint32_t> all(network.constraints().size());
    for (std::uint32_t c = 0; c < all.size(); ++c) all[c] = c;
    const AtMostOne found = find_at_most_one(network, all);
    std::vector<std::uint32_t> values(network.variable_count(), 0);
    while (true) {
      const bool groups_hold = std::all_of(found.groups.begin(), found.groups.end(), [&](const auto& group) {
        return std::count_if(group.begin(), group.end(),
                             [&](const VariableValue& x) { return values[x.variable.index()] == x.value; }) <= 1;
      });
      const auto holds = [&](std::uint32_t c) {
        return oracle::evaluate(network, network.constraints()[c].literal, values);
      };
      if (std::all_of(all.begin(), all.end(), holds)) {
        EXPECT_TRUE(groups_hold);
      }
      if (groups_hold) {
        EXPECT_TRUE(std::all_of(found.covered.begin(), found.covered.end(), holds));
      }
      std::size_t d = 0;
      while (d < values.size() && ++values[d] == network.value_count(VariableId(d))) values[d++] = 0;
      if (d == values.size()) break;
    }
  }
}

}  // namespace
}  // namespace sherlog
