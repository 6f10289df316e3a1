// The matching method against elimination, and its parts against brute force.
#include "inference/matching.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <limits>
#include <random>

#include "grounding/ground.h"
#include "inference/assignment.h"
#include "inference/exact.h"
#include "inference/matching_sampler.h"
#include "inference/matching_sum.h"
#include "mln/query.h"

namespace sherlog {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr const char* kModels = SHERLOG_SOURCE_DIR "/models/identity_resolution/";

std::uint64_t random_models() {
  const char* text = std::getenv("SHERLOG_RANDOM_MODELS");
  return text == nullptr ? 200 : std::strtoull(text, nullptr, 10);
}

// --- the parts

struct BruteForce {
  std::vector<double> weights;
  std::size_t rows, columns;
  double total = 0, best = 0;
  std::vector<double> paired;

  BruteForce(std::vector<double> w, std::size_t r, std::size_t c)
      : weights(std::move(w)), rows(r), columns(c), paired(weights.size(), 0.0) {
    std::vector<std::size_t> pairs;
    visit(0, 0, 0.0, pairs);
    for (double& p : paired) p /= total;
  }

 private:
  void visit(std::size_t row, std::size_t taken, double log_weight, std::vector<std::size_t>& pairs) {
    if (row == rows) {
      total += std::exp(log_weight);
      best = std::max(best, log_weight);
      for (std::size_t pair : pairs) paired[pair] += std::exp(log_weight);
      return;
    }
    visit(row + 1, taken, log_weight, pairs);
    for (std::size_t c = 0; c < columns; ++c) {
      if ((taken >> c & 1) != 0 || weights[row * columns + c] == -kInfinity) continue;
      pairs.push_back(row * columns + c);
      visit(row + 1, taken | std::size_t{1} << c, log_weight + weights[row * columns + c], pairs);
      pairs.pop_back();
    }
  }
};

TEST(MatchingParts, AgreeWithAllMatchingsOneByOne) {
  std::mt19937_64 random(7);
  const auto below = [&](std::uint64_t n) { return static_cast<std::size_t>(random() % n); };
  for (int round = 0; round < 300; ++round) {
    const std::size_t rows = below(6), columns = below(6);
    std::vector<double> weights(rows * columns);
    for (double& w : weights) {
      w = below(8) == 0 ? -kInfinity : 12 * (static_cast<double>(random() >> 11) * 0x1p-53) - 6;
    }
    SCOPED_TRACE(fmt::format("{} x {}, round {}", rows, columns, round));
    const BruteForce expected(weights, rows, columns);
    const Assignment best = best_assignment(weights, rows, columns);
    EXPECT_NEAR(best.gain, expected.best, 1e-9);
    double gain = 0, potentials = 0;
    for (std::size_t r = 0; r < rows; ++r) {
      if (best.column_of[r]) gain += weights[r * columns + *best.column_of[r]];
      potentials += best.row_potential[r];
      EXPECT_GE(best.row_potential[r], 0);
      for (std::size_t c = 0; c < columns; ++c) {
        EXPECT_GE(best.row_potential[r] + best.column_potential[c], weights[r * columns + c] - 1e-9);
      }
    }
    for (double p : best.column_potential) potentials += p;
    EXPECT_NEAR(gain, best.gain, 1e-9);
    EXPECT_NEAR(potentials, best.gain, 1e-9);  // what proves the optimum
    Monitor monitor;
    const MatchingSum sum = matching_sum(weights, rows, columns, StopCondition(monitor));
    EXPECT_NEAR(sum.log_total, std::log(expected.total), 1e-9);
    ASSERT_EQ(sum.paired.size(), weights.size());
    for (std::size_t i = 0; i < weights.size(); ++i) EXPECT_NEAR(sum.paired[i], expected.paired[i], 1e-9);
  }
}

TEST(MatchingSum, WeightsThatOverflowAreNoTrouble) {
  // Two rows that both want one column by 800 nats: half each.
  const std::vector<double> weights = {800, 1, 800, 1};
  Monitor monitor;
  const MatchingSum sum = matching_sum(weights, 2, 2, StopCondition(monitor));
  EXPECT_NEAR(sum.log_total, 800 + std::log(2 * (1 + std::exp(1.0))), 1e-9);
  EXPECT_NEAR(sum.paired[0], 0.5, 1e-12);
  EXPECT_NEAR(sum.paired[1], 0.5 * std::exp(1.0) / (1 + std::exp(1.0)), 1e-12);
}

TEST(MatchingSampler, IsWithinItsOwnErrorsOfTheExactSum) {
  std::mt19937_64 random(11);
  std::size_t pairs = 0, covered = 0;
  for (int round = 0; round < 12; ++round) {
    const std::size_t rows = 4u + static_cast<std::size_t>(round % 5),
                      columns = 3u + static_cast<std::size_t>(round % 4);
    std::vector<double> weights(rows * columns);
    for (double& w : weights)
      w = random() % 8 == 0 ? -kInfinity : 8 * (static_cast<double>(random() >> 11) * 0x1p-53) - 3;
    Monitor monitor;
    const StopCondition stop(monitor);
    const MatchingSum exact = matching_sum(weights, rows, columns, stop);
    InferenceOptions options;
    options.samples = 8000;
    options.threads = 1u + static_cast<std::uint32_t>(round % 3);
    const SampledMatching sampled = sample_matchings(weights, rows, columns, options, stop);
    EXPECT_EQ(sampled.samples, 8000u);
    double on = 0;
    for (std::size_t c = 0; c < columns; ++c) on += exact.paired[c];
    EXPECT_NEAR(sampled.paired[columns].probability, on, 0.02);  // the first row, whoever it is paired with
    for (std::size_t r = 0; r < rows; ++r) {
      for (std::size_t c = 0; c < columns; ++c) {
        const Marginal& m = sampled.paired[r * (columns + 1) + c];
        const double p = exact.paired[r * columns + c];
        EXPECT_NEAR(m.probability, p, 0.02);
        if (p < 0.01 || p > 0.99) continue;
        ++pairs;
        covered += std::abs(m.probability - p) <= 1.96 * *m.mcse ? 1u : 0u;
      }
    }
  }
  EXPECT_GT(static_cast<double>(covered) / static_cast<double>(pairs), 0.88);
}

TEST(MatchingSampler, TheSameForAnyNumberOfThreads) {
  const std::vector<double> weights = {1, 2, 0.5, -1, 0, 3};
  const auto first = [&](std::uint32_t threads) {
    Monitor monitor;
    InferenceOptions options;
    options.samples = 1000;
    options.threads = threads;
    return sample_matchings(weights, 3, 2, options, StopCondition(monitor)).paired[0].probability;
  };
  EXPECT_EQ(first(1), first(4));
}

// --- the method

class RandomScene {
 public:
  explicit RandomScene(std::uint64_t seed) : random_(seed) {
    const std::size_t old_clusters = 1 + below(5), new_clusters = 1 + below(5);
    kind_ = below(3);
    learned_ = kind_ == 1;
    if (kind_ == 2) add_weighted();
    for (std::size_t o = 1; o <= old_clusters; ++o) {
      if (below(3) == 0) evidence_ += fmt::format("outOfView(O{})\n", o);
      if (learned_) evidence_ += fmt::format("{} seesPlace(O{})\n", grade(), o);
      for (std::size_t n = 1; n <= new_clusters; ++n) {
        if (n == 1 || below(12) != 0) evidence_ += fmt::format("{} similar(O{},N{})\n", grade(), o, n);
        if (below(12) != 0) evidence_ += fmt::format("{} proximity(O{},N{})\n", grade(), o, n);
        if (below(40) == 0) evidence_ += fmt::format("is(O{},N{},move)\n", o, n);
        if (below(20) == 0) evidence_ += fmt::format("!is(O{},N{},stay)\n", o, n);
      }
      if (below(12) == 0) evidence_ += fmt::format("!disappear(O{})\n", o);
    }
    if (below(5) == 0) evidence_ += "!appear(N1)\n";
    if (below(9) == 0) evidence_ += "appear(N1)\n";
  }

  std::string evidence() const { return evidence_; }
  std::string model() {
    if (kind_ == 0) return fmt::format("#include \"{}table1.mln\"\n", kModels);
    if (kind_ == 2) return weighted_;
    return fmt::format(
        "#include \"{}learned.mln\"\n{} is(o, n, stay)\n{} is(o, n, move)\n{} appear(n)\n{} disappear(o) ^ "
        "seesPlace(o)\n",
        kModels, weight(), weight(), weight(), weight());
  }
  std::vector<std::string> queries() const {
    std::vector<std::string> all = {"is,appear,disappear,hidden", "is(O1,N1,stay) v is(O1,N1,move)"};
    if (kind_ == 2) all.push_back("EXIST n is(O1, n, stay)");
    return all;
  }
  std::vector<std::string> open() const {
    return learned_ ? std::vector<std::string>{"same"} : std::vector<std::string>{};
  }

 private:
  // Table 1 with weights: what a row or column adds depends on the value that is on, not only on whether one is.
  void add_weighted() {
    weighted_ =
        "explanations = {move, stay, newview, not}\nsimilar(old, new)\nproximity(old, new)\noutOfView(old)\n"
        "is(old, new, explanations!)\ndisappear(old)\nappear(new)\nhidden(old)\n"
        "is(a, c, e) ^ is(b, c, f) ^ e != not ^ f != not => a = b.\n"
        "is(c, a, e) ^ is(c, b, f) ^ e != not ^ f != not => a = b.\n";
    const char* const formulas[] = {
        "is(o, n, stay) <=> similar(o, n) ^ proximity(o, n)",
        "is(o, n, move) <=> similar(o, n) ^ !proximity(o, n)",
        "is(o, n, newview) <=> !similar(o, n) ^ proximity(o, n)",
        "outOfView(o) => !(EXIST n (is(o, n, stay) v is(o, n, newview)))",
        "appear(n) <=> !(EXIST o (is(o, n, stay) v is(o, n, move) v is(o, n, newview)))",
        "disappear(o) <=> !(EXIST n (is(o, n, stay) v is(o, n, move) v is(o, n, newview))) ^ !outOfView(o)",
        "hidden(o) <=> !(EXIST n (is(o, n, stay) v is(o, n, move) v is(o, n, newview))) ^ outOfView(o)",
        "EXIST n is(o, n, move)",
        "appear(n) v (EXIST o (is(o, n, stay) v is(o, n, move)))",
        "hidden(o) ^ !(EXIST n is(o, n, stay))",
    };
    for (const char* formula : formulas) {
      if (below(4) != 0) weighted_ += fmt::format("{} {}\n", weight(), formula);
    }
    if (below(6) == 0) weighted_ += "EXIST n (is(O1, n, stay) v is(O1, n, move)).\n";
    if (below(6) == 0) weighted_ += "!(EXIST o is(o, N1, move)).\n";
  }

  std::size_t below(std::uint64_t n) { return static_cast<std::size_t>(random_() % n); }
  double uniform() { return static_cast<double>(random_() >> 11) * 0x1p-53; }
  double grade() { return below(20) == 0 ? 1e-9 : std::clamp(uniform(), 1e-6, 1 - 1e-6); }
  double weight() { return 6 * uniform() - 3; }

  std::mt19937_64 random_;
  std::size_t kind_ = 0;
  bool learned_ = false;
  std::string evidence_, weighted_;
};

TEST(Matching, AgreesWithEliminationOnRandomScenes) {
  std::size_t answered = 0, impossible = 0, refused = 0;
  for (std::uint64_t seed = 1; seed <= random_models(); ++seed) {
    RandomScene scene(seed);
    Diagnostics diagnostics;
    const auto model = parse_model(scene.model(), "scene.mln", diagnostics);
    ASSERT_TRUE(model) << diagnostics.render();
    const auto evidence = parse_evidence(*model, scene.evidence(), "scene.db", diagnostics);
    if (!evidence) continue;  // it contradicts itself
    SCOPED_TRACE(fmt::format("seed {}\n{}", seed, scene.evidence()));
    const auto query = parse_query(*model, evidence->front(), scene.queries(), diagnostics);
    ASSERT_TRUE(query) << diagnostics.render();
    GroundingOptions grounding;
    for (const std::string& name : scene.open()) grounding.open_world.push_back(*model->find_predicate(name));
    Monitor monitor;
    const GroundingResult ground_result = ground(*model, evidence->front(), *query, grounding, monitor);
    if (!ground_result.network) continue;  // a contradiction that the grounder sees
    const GroundNetwork& network = *ground_result.network;
    InferenceOptions options;
    options.method = "exact";
    const InferenceResult expected = infer(network, options, monitor);
    if (expected.termination == Termination::kTooWide) continue;
    options.method = "matching";
    const InferenceResult got = infer(network, options, monitor);
    if (got.termination == Termination::kRefused) {
      EXPECT_FALSE(got.message.empty());
      ++refused;
      continue;
    }
    ASSERT_EQ(got.termination, expected.termination) << got.message;
    if (expected.termination == Termination::kNoPossibleWorld) {
      ++impossible;
      continue;
    }
    ++answered;
    EXPECT_NEAR(*got.log_partition, *expected.log_partition, 1e-9 * (1 + std::abs(*expected.log_partition)));
    for (std::size_t q = 0; q < expected.marginals.size(); ++q) {
      EXPECT_NEAR(got.marginals[q].probability, expected.marginals[q].probability, 1e-8) << q;
    }
    options.method = "map";
    const InferenceResult best = infer(network, options, monitor);
    std::vector<ComponentId> components;
    for (std::size_t c = 0; c < network.component_count(); ++c) components.emplace_back(c);
    const MethodResult proved = run_exact_map({network, components, options, StopCondition(monitor), {}});
    ASSERT_TRUE(best.map);
    EXPECT_TRUE(best.map->optimal);
    EXPECT_NEAR(best.map->log_score, proved.map_score + network.constant_score(), 1e-7);
  }
  EXPECT_GT(answered, random_models() / 3);
  EXPECT_GT(impossible + refused, 0u);
  EXPECT_LT(refused, random_models() / 2);
}

TEST(Matching, RefusesWhatIsNoneAndSaysWhy) {
  const auto ask = [](const std::string& text, const std::string& evidence_text, const char* queried) {
    Diagnostics diagnostics;
    const auto model = parse_model(text, "model.mln", diagnostics);
    const auto evidence = parse_evidence(*model, evidence_text, "e.db", diagnostics);
    const auto query = parse_query(*model, evidence->front(), {queried}, diagnostics);
    Monitor monitor;
    const GroundingResult grounding = ground(*model, evidence->front(), *query, {}, monitor);
    InferenceOptions options;
    options.method = "matching";
    return infer(*grounding.network, options, monitor);
  };
  // Three people of whom any two exclude each other through different formulas: a triangle of pairs is one row, but a path of
  // four is none.
  const InferenceResult path = ask("P(a)\nnext(a, a)\n1 P(x)\nnext(x, y) => !P(x) v !P(y).\n",
                                   "next(A,B)\nnext(B,C)\nnext(C,D)\nnext(D,E)\nnext(E,A)\n", "P");
  EXPECT_EQ(path.termination,
            Termination::kRefused);  // a ring of five: pairs that alternate rows and columns do not close
  EXPECT_NE(path.message.find("no one-to-one matching"), std::string::npos) << path.message;
  const InferenceResult smokers = ask("S(a)\nF(a, a)\n1 F(x, y) ^ S(x) => S(y)\n", "F(A,B)\nF(B,C)\n", "S");
  EXPECT_EQ(smokers.termination, Termination::kRefused);
}

}  // namespace
}  // namespace sherlog
