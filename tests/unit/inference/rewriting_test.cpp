// Networks rewritten for inference have the same distribution as before, by enumeration.
#include <gtest/gtest.h>

#include "inference/at_most_one.h"
#include "inference/block_recognition.h"
#include "inference/group_lifting.h"
#include "inference/inference.h"
#include "tests/oracles/enumeration.h"

namespace sherlog {
namespace {

void expect_same_marginals(const GroundNetwork& a, const GroundNetwork& b) {
  const oracle::Enumeration before = oracle::enumerate(a), after = oracle::enumerate(b);
  ASSERT_EQ(before.possible, after.possible);
  ASSERT_EQ(before.worlds, after.worlds);
  for (std::size_t q = 0; q < before.marginals.size(); ++q) EXPECT_NEAR(before.marginals[q], after.marginals[q], 1e-9);
}

// A matching of `rows` x `columns` booleans: one-to-one by pairwise hard clauses, weights on pairs, and for each row an atom that
// clauses define as "unmatched".
struct Matching {
  NetworkBuilder builder;
  std::vector<std::vector<Literal>> pair;
  std::vector<Literal> unmatched;
};

Matching matching(std::mt19937_64& random, std::uint32_t rows, std::uint32_t columns, double converse_weight) {
  Matching m;
  std::uniform_real_distribution<double> uniform(-2.0, 2.0);
  const WeightId weight = m.builder.add_weight({FormulaId(0), {}, 1.0});
  const auto atom = [&] {
    const Literal l = Literal::atom(m.builder.first_atom(m.builder.add_boolean()));
    m.builder.add_query({l, false, ""});
    return l;
  };
  for (std::uint32_t r = 0; r < rows; ++r) {
    m.pair.emplace_back();
    for (std::uint32_t c = 0; c < columns; ++c) {
      m.pair[r].push_back(atom());
      m.builder.add_feature(m.pair[r][c], uniform(random), weight);
    }
  }
  const auto exclude = [&](Literal a, Literal b) {
    std::vector<Literal> inputs{~a, ~b};
    m.builder.add_constraint(m.builder.make_or(inputs), FormulaId(0));
  };
  for (std::uint32_t r = 0; r < rows; ++r) {
    for (std::uint32_t c = 0; c < columns; ++c) {
      for (std::uint32_t d = 0; d < c; ++d) exclude(m.pair[r][c], m.pair[r][d]);
      for (std::uint32_t q = 0; q < r; ++q) exclude(m.pair[r][c], m.pair[q][c]);
    }
  }
  for (std::uint32_t r = 0; r < rows; ++r) {
    m.unmatched.push_back(atom());
    for (Literal p : m.pair[r]) {
      std::vector<Literal> inputs{~m.unmatched[r], ~p};
      m.builder.add_feature(m.builder.make_or(inputs), 1.5, weight);
    }
    std::vector<Literal> inputs = m.pair[r];
    inputs.push_back(m.unmatched[r]);
    m.builder.add_feature(m.builder.make_or(inputs), converse_weight, weight);
  }
  return m;
}

TEST(GroupLifting, KeepsTheDistributionAndThePartitionSum) {
  std::mt19937_64 random(51);
  for (double converse : {1.5, 0.7}) {
    Matching m = matching(random, 3, 4, converse);
    const GroundNetwork network = m.builder.build();
    const auto lifted = lift_over_groups(network);
    ASSERT_TRUE(lifted.has_value());
    EXPECT_LT(lifted->features().size(), network.features().size());
    expect_same_marginals(network, *lifted);
    EXPECT_NEAR(oracle::enumerate(network).log_partition, oracle::enumerate(*lifted).log_partition, 1e-9);
  }
}

TEST(GroupLifting, MakesAnEquivalenceOfADefinitionInClauses) {
  std::mt19937_64 random(52);
  Matching m = matching(random, 2, 4, 1.5);
  const auto lifted = lift_over_groups(m.builder.build());
  ASSERT_TRUE(lifted.has_value());
  std::size_t equivalences = 0;
  for (const Feature& f : lifted->features()) {
    if (f.literal.is_gate() && lifted->gate_kind(f.literal.gate()) == GateKind::kIff) ++equivalences;
  }
  EXPECT_EQ(equivalences, 2u);
}

TEST(GroupLifting, LeavesRandomNetworksTheirDistribution) {
  std::mt19937_64 random(53);
  for (int round = 0; round < 100; ++round) {
    const GroundNetwork network =
        oracle::random_network(random, {.variables = 6, .features = 20, .constraints = 6, .max_inputs = 2});
    if (const auto lifted = lift_over_groups(network)) expect_same_marginals(network, *lifted);
  }
}

TEST(FoldAtMostOne, KeepsTheDistribution) {
  std::mt19937_64 random(54);
  Matching m = matching(random, 3, 3, 1.0);
  const GroundNetwork network = m.builder.build();
  std::vector<std::uint32_t> all(network.constraints().size());
  for (std::uint32_t c = 0; c < all.size(); ++c) all[c] = c;
  const AtMostOne found = find_at_most_one(network, all);
  EXPECT_EQ(found.groups.size(), 6u);
  const GroundNetwork folded = fold_at_most_one(network, found);
  EXPECT_EQ(folded.constraints().size(), 6u);
  expect_same_marginals(network, folded);
}

// Blocks with "none" among them: excluded by "x or not a" where all other values of x's block exclude a.
TEST(FoldAtMostOne, KeepsTheDistributionOfRandomNetworksWithBlocks) {
  std::mt19937_64 random(55);
  int folded_count = 0;
  for (int round = 0; round < 400; ++round) {
    const GroundNetwork network = oracle::random_network(
        random, {.variables = 5, .features = 6, .constraints = 6, .block_share = 0.7, .max_inputs = 2});
    std::vector<std::uint32_t> all(network.constraints().size());
    for (std::uint32_t c = 0; c < all.size(); ++c) all[c] = c;
    const AtMostOne found = find_at_most_one(network, all);
    if (found.groups.empty()) continue;
    ++folded_count;
    expect_same_marginals(network, fold_at_most_one(network, found));
  }
  EXPECT_GT(folded_count, 20);
}

// One predicate p over A, B, ...
NameTable one_predicate() {
  NameTable names;
  names.predicates = {"p"};
  names.predicate_domains = {{0}};
  names.constants = {{"A", "B", "C", "D", "E", "F", "G", "H"}};
  return names;
}

// p(A), p(B), ..., all queried.
std::vector<Literal> add_atoms(NetworkBuilder& builder, std::size_t count) {
  std::vector<Literal> atoms;
  for (ConstantIndex i = 0; i < count; ++i) {
    const ConstantIndex argument[1] = {i};
    atoms.push_back(Literal::atom(builder.first_atom(builder.add_variable(PredicateId(0), argument, 1, true))));
    builder.add_query({atoms.back(), false, ""});
  }
  return atoms;
}

TEST(RecognisedBlocks, AnExactlyOneGroupBecomesOneVariable) {
  NetworkBuilder b(one_predicate());
  const WeightId weight = b.add_weight({FormulaId(0), {}, 1.0});
  const std::vector<Literal> atoms = add_atoms(b, 4);
  for (std::size_t i = 0; i < 4; ++i) b.add_feature(atoms[i], 0.3 * static_cast<double>(i), weight);
  std::vector<Literal> some(atoms.begin(), atoms.begin() + 3);
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < i; ++j) {
      std::vector<Literal> pair{~some[static_cast<std::size_t>(i)], ~some[static_cast<std::size_t>(j)]};
      b.add_constraint(b.make_or(pair), FormulaId(0));
    }
  }
  std::vector<Literal> inputs = some;
  b.add_constraint(b.make_or(inputs), FormulaId(0));
  const GroundNetwork network = b.build();
  const auto recognised = recognise_blocks(network);
  ASSERT_TRUE(recognised.has_value());
  EXPECT_EQ(recognised->network.variable_count(), 2u);
  EXPECT_EQ(recognised->network.constraints().size(), 0u);
  EXPECT_EQ(network.atom_text(AtomId(2)), recognised->network.atom_text(recognised->atom[2]));
  expect_same_marginals(network, recognised->network);
}

TEST(RecognisedBlocks, EveryAnswerIsThatOfTheNetworkThatSpeltThemOut) {
  std::mt19937_64 random(5);
  const auto below = [&](std::uint64_t n) { return static_cast<std::size_t>(random() % n); };
  std::size_t impossible = 0, recognised = 0;
  for (int round = 0; round < 200; ++round) {
    NetworkBuilder b(one_predicate());
    const WeightId weight = b.add_weight({FormulaId(0), {}, 1.0});
    const std::vector<Literal> atoms = add_atoms(b, 8);
    const auto some = [&](std::size_t count) {
      std::vector<Literal> inputs;
      for (std::size_t i = 0; i < count; ++i) inputs.push_back(below(2) == 0 ? ~atoms[below(8)] : atoms[below(8)]);
      return b.make_or(inputs);
    };
    for (const std::size_t first : {0u, 3u}) {  // two groups of three
      std::vector<Literal> group(atoms.begin() + static_cast<std::ptrdiff_t>(first),
                                 atoms.begin() + static_cast<std::ptrdiff_t>(first) + 3);
      for (std::size_t i = 0; i < 3; ++i) {
        for (std::size_t j = 0; j < i; ++j) {
          std::vector<Literal> pair{~group[i], ~group[j]};
          b.add_constraint(b.make_or(pair), FormulaId(0));
        }
      }
      const Literal one = b.make_or(group);
      b.add_constraint(one, FormulaId(0));
      b.add_feature(one, 1.25, weight);  // always true: nothing but a constant
      b.add_query({one, true, ""});
    }
    for (int i = 0; i < 6; ++i) {
      const double w = static_cast<double>(below(600)) / 100 - 3;
      b.add_feature(below(2) == 0 ? some(1 + below(3)) : b.make_iff(some(1 + below(2)), some(2)), w, weight);
    }
    bool decided = false;
    for (std::size_t i = 0; i < below(4); ++i) decided = !b.add_constraint(some(2), FormulaId(0)) || decided;
    if (decided) continue;
    const GroundNetwork network = b.build();
    const oracle::Enumeration expected = oracle::enumerate(network);
    recognised += recognise_blocks(network) ? 1u : 0u;
    Monitor monitor;
    for (const char* method : {"exact", "auto", "map"}) {
      InferenceOptions options;
      options.method = method;
      const InferenceResult got = infer(network, options, monitor);
      SCOPED_TRACE(method);
      if (!expected.possible) {
        ++impossible;
        EXPECT_EQ(got.termination, Termination::kNoPossibleWorld);
        EXPECT_FALSE(got.conflict.empty());
        continue;
      }
      ASSERT_EQ(got.termination, Termination::kCompleted) << got.message;
      if (got.map) {
        EXPECT_TRUE(got.map->optimal);
        EXPECT_NEAR(got.map->log_score, expected.best_score, 1e-9);
        EXPECT_NEAR(oracle::score(network, got.map->values).value(), expected.best_score, 1e-9);
        continue;
      }
      EXPECT_NEAR(*got.log_partition, expected.log_partition, 1e-9);
      for (std::size_t q = 0; q < expected.marginals.size(); ++q) {
        EXPECT_NEAR(got.marginals[q].probability, expected.marginals[q], 1e-9);
      }
    }
  }
  EXPECT_GT(impossible, 0u);
  EXPECT_GT(recognised, 50u);
}

}  // namespace
}  // namespace sherlog
