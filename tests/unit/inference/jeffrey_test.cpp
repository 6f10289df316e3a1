#include "inference/jeffrey.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <string>
#include <utility>

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

// What the first atoms' marginals are once the network is tilted by these biases; empty where one is all but certain.
std::vector<SoftTarget> feasible_targets(const GroundNetwork& network, const std::vector<double>& tilt) {
  NetworkBuilder tilted(network);
  for (std::uint32_t a = 0; a < tilt.size(); ++a) {
    tilted.add_feature(Literal::atom(AtomId(a)), tilt[a], kVirtualEvidence);
  }
  const oracle::Enumeration wanted = oracle::enumerate(tilted.build());
  std::vector<SoftTarget> targets;
  if (!wanted.possible) return targets;
  for (std::uint32_t a = 0; a < tilt.size(); ++a) targets.push_back({AtomId(a), wanted.atom_marginals[a]});
  const bool open =
      std::ranges::all_of(targets, [](const SoftTarget& t) { return t.probability > 0.02 && t.probability < 0.98; });
  return open ? targets : std::vector<SoftTarget>();
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

// The weights tie the targets together so strongly that the model itself hardly has worlds in which they differ. The targets are
// the marginals of another distribution over the same possible worlds, so they can be met.
TEST(Jeffrey, MeetsFeasibleTargetsOfStronglyTiedNetworks) {
  std::mt19937_64 random(62);
  std::uniform_real_distribution<double> bias(-1.5, 1.5);
  int fitted = 0;
  for (int round = 0; round < 100; ++round) {
    const GroundNetwork network =
        oracle::random_network(random, {.variables = 6, .features = 10, .constraints = 2, .weight = 12.0});
    NetworkBuilder bare(network);
    (void)bare.take_features();
    const auto targets = feasible_targets(bare.build(), {bias(random), bias(random), bias(random)});
    if (targets.empty()) continue;
    NetworkBuilder builder(network);
    for (const SoftTarget& target : targets) builder.add_soft_target(target);
    const GroundNetwork soft = builder.build();
    for (const char* method : {"exact", "mcsat"}) {
      const InferenceResult result = run(soft, method);
      ASSERT_EQ(result.termination, Termination::kCompleted) << method << ": " << result.message;
      for (const SoftTarget& target : soft.soft_targets()) {
        for (std::size_t q = 0; q < soft.queries().size(); ++q) {
          const Literal literal = soft.queries()[q].literal;
          if (!literal.is_atom() || literal.atom() != target.atom || literal.negated()) continue;
          const double tolerance = std::string(method) == "exact" ? 1e-6 : 0.03;
          EXPECT_NEAR(result.marginals[q].probability, target.probability, tolerance) << method << " round " << round;
        }
      }
    }
    ++fitted;
  }
  EXPECT_GT(fitted, 20);
}

// A model of marginals with noise: what fit_jeffrey has from a sampler. Two atoms, tied by a weight.
class NoisyPair {
 public:
  NoisyPair(double tie, bool exclusive) : tie_(tie), exclusive_(exclusive) {}

  JeffreyModel model() {
    return {[this](std::span<const double> b, std::uint32_t round, double) {
              std::mt19937_64 random(round);
              std::normal_distribution<double> noise(0.0, 0.005);
              const auto p = marginals(b);
              const auto draw = [&](double m) { return std::clamp(m + noise(random), 0.0, 1.0); };
              return JeffreyEvaluation{Termination::kCompleted, {draw(p[0]), draw(p[1])}, std::nullopt, {}};
            },
            [this](std::span<const double> d) {
              const double both = exclusive_ ? 0.0 : d[0] + d[1];
              return std::max({0.0, d[0], d[1], both});
            }};
  }
  // Worlds 00, 10, 01, 11 with weight `tie` on agreement.
  std::array<double, 2> marginals(std::span<const double> b) const {
    const double scores[] = {tie_, b[0], b[1], exclusive_ ? -1e9 : tie_ + b[0] + b[1]};
    const double most = *std::ranges::max_element(scores);
    double sum = 0.0;
    for (double s : scores) sum += std::exp(s - most);
    const double both = std::exp(scores[3] - most);
    return {(std::exp(scores[1] - most) + both) / sum, (std::exp(scores[2] - most) + both) / sum};
  }

 private:
  double tie_;
  bool exclusive_;
};

GroundNetwork pair_with_targets(double p, double q) {
  NetworkBuilder builder;
  for (double wanted : {p, q}) builder.add_soft_target({builder.first_atom(builder.add_boolean()), wanted});
  return builder.build();
}

TEST(Jeffrey, EstimatesAreEnoughForTiedTargets) {
  for (const double tie : {-8.0, 0.0, 3.0, 8.0, 12.0}) {
    for (const auto& [p, q] : {std::pair{0.5, 0.5}, {0.2, 0.25}, {0.3, 0.7}, {0.9, 0.05}}) {
      NoisyPair pair(tie, false);
      const GroundNetwork network = pair_with_targets(p, q);
      const JeffreyFit fit = fit_jeffrey(network, network.soft_targets(), pair.model());
      ASSERT_TRUE(fit.met) << tie << ' ' << p << ' ' << q << ' ' << fit.message;
      EXPECT_EQ(fit.warning, "") << tie << ' ' << p << ' ' << q;
      const auto reached = pair.marginals(fit.biases);
      EXPECT_NEAR(reached[0], p, 0.025) << tie << ' ' << p << ' ' << q;
      EXPECT_NEAR(reached[1], q, 0.025) << tie << ' ' << p << ' ' << q;
    }
  }
}

TEST(Jeffrey, EstimatesAreEnoughToRefuse) {
  NoisyPair pair(0.0, true);
  const GroundNetwork network = pair_with_targets(0.7, 0.4);
  const JeffreyFit fit = fit_jeffrey(network, network.soft_targets(), pair.model());
  EXPECT_FALSE(fit.met);
  EXPECT_EQ(fit.termination, Termination::kNoPossibleWorld);
}

// A weight of -1000 makes the atom's probability no number above 0; a bias of 1000 mends that.
TEST(Jeffrey, MarginalsThatAreTooSmallForANumberCanBeRaised) {
  NetworkBuilder builder;
  const Literal a = Literal::atom(builder.first_atom(builder.add_boolean()));
  builder.add_feature(a, -1000.0, builder.add_weight({FormulaId(0), {}, -1000.0}));
  builder.add_query({a, false, ""});
  builder.add_soft_target({a.atom(), 0.3});
  const InferenceResult result = run(builder.build(), "exact");
  ASSERT_EQ(result.termination, Termination::kCompleted) << result.message;
  EXPECT_NEAR(result.marginals[0].probability, 0.3, 1e-9);
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
