#include "inference/jeffrey.h"

#include <gtest/gtest.h>

#include <cmath>

#include "inference/inference.h"
#include "tests/oracles/enumeration.h"

namespace sherlog {
namespace {

InferenceResult run(const GroundNetwork& network, const char* method) {
  Monitor monitor;
  InferenceOptions options;
  options.method = method;
  return infer(network, options, monitor);
}

// Random targets that some biased version of the network has: they can be met, and every method meets them.
TEST(Jeffrey, MeetsTargetsThatCanBeMetOnRandomNetworks) {
  std::mt19937_64 random(61);
  std::uniform_real_distribution<double> bias(-2.0, 2.0);
  int fitted = 0;
  for (int round = 0; round < 40; ++round) {
    const GroundNetwork network = oracle::random_network(random, {.variables = 6, .constraints = 1});
    const WeightId weight = kVirtualEvidence;
    NetworkBuilder tilted(network);
    for (std::uint32_t a = 0; a < 3; ++a) tilted.add_feature(Literal::atom(AtomId(a)), bias(random), weight);
    const oracle::Enumeration wanted = oracle::enumerate(tilted.build());
    if (!wanted.possible) continue;
    NetworkBuilder builder(network);
    bool open = true;
    for (std::uint32_t a = 0; a < 3; ++a) {
      const double p = wanted.atom_marginals[a];
      open = open && p > 0.02 && p < 0.98;
      builder.add_soft_target({AtomId(a), p});
    }
    if (!open) continue;
    const GroundNetwork soft = builder.build();
    const InferenceResult exact = run(soft, "exact");
    ASSERT_EQ(exact.termination, Termination::kCompleted) << exact.message;
    const InferenceResult sampled = run(soft, "mcsat");
    ASSERT_EQ(sampled.termination, Termination::kCompleted) << sampled.message;
    for (std::size_t q = 0; q < soft.queries().size(); ++q) {
      if (soft.queries()[q].literal.is_constant()) continue;
      EXPECT_NEAR(exact.marginals[q].probability, wanted.marginals[q], 1e-6);
      EXPECT_NEAR(sampled.marginals[q].probability, wanted.marginals[q], 0.03);
    }
    ++fitted;
  }
  EXPECT_GT(fitted, 10);
}

// Two atoms that exclude each other cannot both have a probability of 0.7.
TEST(Jeffrey, SaysWhichTargetCannotBeMet) {
  NetworkBuilder builder;
  const Literal a = Literal::atom(builder.first_atom(builder.add_boolean()));
  const Literal b = Literal::atom(builder.first_atom(builder.add_boolean()));
  std::vector<Literal> inputs{~a, ~b};
  builder.add_constraint(builder.make_or(inputs), FormulaId(0));
  builder.add_query({a, false, ""});
  builder.add_soft_target({a.atom(), 0.7});
  builder.add_soft_target({b.atom(), 0.7});
  const GroundNetwork network = builder.build();
  for (const char* method : {"exact", "mcsat"}) {
    const InferenceResult result = run(network, method);
    EXPECT_EQ(result.termination, Termination::kNoPossibleWorld) << method;
    EXPECT_NE(result.message.find("cannot be met"), std::string::npos) << result.message;
  }
}

}  // namespace
}  // namespace sherlog
