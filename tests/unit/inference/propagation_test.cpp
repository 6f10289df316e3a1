#include "inference/propagation.h"

#include <gtest/gtest.h>

#include <numeric>
#include <random>

#include "inference/rng.h"
#include "tests/oracles/enumeration.h"

namespace sherlog {
namespace {

Literal first(const NetworkBuilder& builder, VariableId v) { return Literal::atom(builder.first_atom(v)); }

std::vector<std::uint32_t> all_constraints(const GroundNetwork& network) {
  std::vector<std::uint32_t> all(network.constraints().size());
  std::iota(all.begin(), all.end(), 0u);
  return all;
}

GroundNetwork random_network(std::uint64_t seed) {
  std::mt19937_64 random(seed);
  oracle::RandomNetworkOptions options;
  options.variables = 6;
  options.constraints = 1 + static_cast<std::uint32_t>(random() % 8);
  options.max_inputs = 2 + static_cast<std::uint32_t>(random() % 3);
  return oracle::random_network(random, options);
}

template <class Visit>
void for_each_world(const GroundNetwork& network, std::span<const std::uint32_t> constraints, Visit visit) {
  std::vector<std::uint32_t> values(network.variable_count(), 0);
  while (true) {
    bool possible = true;
    for (const std::uint32_t c : constraints) {
      possible = possible && oracle::evaluate(network, network.constraints()[c].literal, values);
    }
    if (possible) visit(values);
    std::size_t d = 0;
    while (d < values.size() && ++values[d] == network.value_count(VariableId(d))) values[d++] = 0;
    if (d == values.size()) break;
  }
}

TEST(Propagation, FollowsAChainOfImplications) {
  NetworkBuilder builder;
  std::vector<Literal> atoms;
  for (int i = 0; i < 100; ++i) atoms.push_back(first(builder, builder.add_boolean()));
  for (std::size_t i = 0; i + 1 < atoms.size(); ++i) {
    std::vector<Literal> clause{~atoms[i], atoms[i + 1]};
    builder.add_constraint(builder.make_or(clause), FormulaId(0));
  }
  builder.add_constraint(atoms[0], FormulaId(1));
  const GroundNetwork network = builder.build();
  Propagation propagation(network, all_constraints(network));
  ASSERT_TRUE(propagation.run());
  for (const Literal atom : atoms) EXPECT_EQ(propagation.truth(atom), Truth::kTrue);
  EXPECT_FALSE(propagation.allowed(VariableId(99), 1));
}

TEST(Propagation, GivesABlockItsLastValue) {
  NetworkBuilder builder;
  const AtomId a = builder.first_atom(builder.add_anonymous(3, false));
  builder.add_constraint(Literal::atom(a, true), FormulaId(0));
  builder.add_constraint(Literal::atom(AtomId(a.value + 2), true), FormulaId(0));
  std::vector<Literal> clause{Literal::atom(AtomId(a.value + 1)), first(builder, builder.add_boolean())};
  builder.add_constraint(builder.make_or(clause), FormulaId(0));
  const GroundNetwork network = builder.build();
  Propagation propagation(network, all_constraints(network));
  ASSERT_TRUE(propagation.run());
  EXPECT_EQ(propagation.truth(Literal::atom(AtomId(a.value + 1))), Truth::kTrue);
  EXPECT_FALSE(propagation.allowed(VariableId(0), 0));
  EXPECT_TRUE(propagation.allowed(VariableId(0), 1));
}

TEST(Propagation, NeverExcludesAPossibleWorldAndItsConflictsAreReal) {
  int conflicts = 0, decided = 0;
  for (std::uint64_t seed = 0; seed < 300; ++seed) {
    SCOPED_TRACE(seed);
    const GroundNetwork network = random_network(seed);
    Propagation propagation(network, all_constraints(network));
    if (!propagation.run()) {
      ++conflicts;
      for_each_world(network, propagation.conflict(),
                     [&](const auto&) { FAIL() << "a world meets the whole conflict"; });
      continue;
    }
    for_each_world(network, all_constraints(network), [&](const std::vector<std::uint32_t>& values) {
      for (std::uint32_t v = 0; v < values.size(); ++v) EXPECT_TRUE(propagation.allowed(VariableId(v), values[v]));
      for (const Literal literal : propagation.mentioned()) {
        const Truth truth = propagation.truth(literal);
        if (truth == Truth::kOpen) continue;
        EXPECT_EQ(oracle::evaluate(network, literal, values), truth == Truth::kTrue);
        ++decided;
      }
    });
  }
  EXPECT_GT(conflicts, 10);
  EXPECT_GT(decided, 1000);
}

TEST(Propagation, TakesDecisionsBackCompletely) {
  for (std::uint64_t seed = 0; seed < 100; ++seed) {
    SCOPED_TRACE(seed);
    const GroundNetwork network = random_network(seed);
    Propagation propagation(network, all_constraints(network));
    if (!propagation.run()) continue;
    std::vector<Truth> before;
    for (const Literal literal : propagation.mentioned()) before.push_back(propagation.truth(literal));
    Rng rng(seed, 0);
    for (int round = 0; round < 20; ++round) {
      bool good = true;
      while (good && propagation.level() < 4) {
        const Literal atom =
            Literal::atom(AtomId(rng.below(static_cast<std::uint32_t>(network.atom_count()))), rng.coin());
        if (propagation.truth(atom) != Truth::kOpen) break;
        good = propagation.decide(atom);
      }
      while (propagation.level() > 0) propagation.backtrack();
      for (std::size_t i = 0; i < before.size(); ++i)
        ASSERT_EQ(propagation.truth(propagation.mentioned()[i]), before[i]);
    }
    // The counters are whole again too: every decision has the consequences it has in a fresh start.
    for (std::uint32_t a = 0; a < network.atom_count(); ++a) {
      const Literal atom = Literal::atom(AtomId(a));
      if (propagation.truth(atom) != Truth::kOpen) continue;
      Propagation fresh(network, all_constraints(network));
      ASSERT_TRUE(fresh.run());
      const bool good = fresh.decide(atom);
      ASSERT_EQ(propagation.decide(atom), good);
      for (std::size_t i = 0; good && i < before.size(); ++i) {
        EXPECT_EQ(propagation.truth(propagation.mentioned()[i]), fresh.truth(propagation.mentioned()[i]));
      }
      propagation.backtrack();
    }
  }
}

}  // namespace
}  // namespace sherlog
