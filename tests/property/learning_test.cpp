// Learning against its slow twin: random models and worlds, every likelihood at random weights, its gradient, its
// optimum, and the learned model read back.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <map>
#include <numeric>
#include <random>
#include <string>

#include "learning/learn.h"
#include "learning/learned_model.h"
#include "learning/methods.h"
#include "tests/oracles/naive_learning.h"

namespace sherlog {
namespace {

int random_models() {
  const char* wanted = std::getenv("SHERLOG_RANDOM_MODELS");
  return wanted != nullptr ? std::max(1, std::atoi(wanted)) : 200;
}

// One of a few models that together have all that matters: blocks of both kinds, templates, #unique, quantifiers,
// equality, hard formulas, several predicates in one formula, the same predicate twice; with random formulas left out.
class Writer {
 public:
  explicit Writer(std::uint64_t seed) : random_(seed) {}

  std::string model() {
    std::string text = "thing = {T1, T2}\nP(thing)\nR(thing, thing)\nk(thing, kind!)\nm(thing, mark?)\nS(place)\n";
    static const char* const kFormulas[] = {
        "P(x)",
        "P(x) => k(x, +y)",
        "R(x, y) => (P(x) <=> P(y))",
        "k(x, +a) ^ m(x, +b)",
        "#unique{+a, +b}\n0 k(x, +a) ^ k(y, +b) ^ x != y",
        "EXIST y (R(x, y)) => P(x)",
        "R(x, x) v !P(x)",
        "(EXIST z (S(z))) ^ k(x, +a)",
        "m(x, y) ^ m(z, y) ^ x != z",
        "!(k(x, y) ^ k(z, y)) v x = z",
        "R(x, y) ^ R(y, z) => R(x, z)",
        "P(x) <=> FORALL y (R(x, y) v x = y)",
        "*P(x) ^ *S(p)",
    };
    int count = 0;
    for (const char* formula : kFormulas) {
      if (coin(0.45)) text += write(formula), ++count;
    }
    if (count == 0) text += write(kFormulas[1]);
    if (coin(0.3)) text += "P(x) ^ R(x, x) => m(x, M1).\n";
    if (coin(0.2)) text += "!(m(x, M1) ^ k(x, K1)).\n";
    return text;
  }

  std::string database() {
    std::string text = "kind = {K1, K2}\nmark = {M1, M2}\n";
    if (coin(0.5)) text += "kind = {K3}\n";
    for (const char* thing : {"T1", "T2"}) {
      text += "k(" + std::string(thing) + ",K" + std::to_string(1 + random_() % 2) + ")\n";
      if (coin(0.5)) text += "m(" + std::string(thing) + ",M" + std::to_string(1 + random_() % 2) + ")\n";
      if (coin(0.5)) text += "P(" + std::string(thing) + ")\n";
      for (const char* other : {"T1", "T2"}) {
        if (coin(0.4)) text += "R(" + std::string(thing) + "," + other + ")\n";
      }
    }
    text += coin(0.7) ? "S(Home)\n" : "";
    text += coin(0.3) ? "!S(Away)\n" : "";
    return text;
  }

  double weight() { return std::uniform_real_distribution<double>(-1.5, 1.5)(random_); }
  bool coin(double p) { return std::uniform_real_distribution<double>(0, 1)(random_) < p; }

 private:
  static std::string write(const std::string& formula) {
    return (formula[0] == '#' ? formula : "0 " + (formula[0] == '*' ? ": " + formula : formula)) + "\n";
  }
  std::mt19937_64 random_;
};

struct Case {
  std::string model_text, data_text;
  std::unique_ptr<TrainingSet> set;
  std::unique_ptr<Model> model;
  std::vector<Evidence> databases;

  explicit Case(int number) {
    Writer writer(static_cast<std::uint64_t>(number) * 6151 + 3);
    model_text = writer.model();
    data_text = writer.database();
    if (writer.coin(0.5)) data_text += "---\n" + writer.database();
    Diagnostics diagnostics;
    auto parsed = parse_model(model_text, "m.mln", diagnostics);
    EXPECT_TRUE(parsed) << diagnostics.render() << model_text;
    model = std::make_unique<Model>(std::move(*parsed));
    auto data = parse_evidence(*model, data_text, "t.db", diagnostics);
    EXPECT_TRUE(data) << diagnostics.render() << data_text;
    databases = std::move(*data);
    set = std::make_unique<TrainingSet>(*model, databases);
  }
  std::string text() const { return model_text + "\n" + data_text; }
};

std::vector<double> random_weights(std::size_t count, std::uint64_t seed) {
  Writer writer(seed);
  std::vector<double> weights(count);
  for (double& w : weights) w = writer.weight();
  return weights;
}

// What the definition says, or nothing where a database breaks a hard formula.
std::optional<double> naive_value(const Case& c, const LearningOptions& options, const std::vector<double>& weights) {
  double sum = 0.0;
  for (std::size_t d = 0; d < c.set->databases.size(); ++d) {
    const oracle::NaiveLearning naive(*c.set, d);
    if (!naive.meets_hard_formulas(naive.observed())) return std::nullopt;
    std::vector<bool> chosen = c.set->mentioned;
    if (!options.discriminative.empty()) {
      std::fill(chosen.begin(), chosen.end(), false);
      for (const PredicateId p : options.discriminative) chosen[p.index()] = true;
    }
    if (options.method == "cll") {
      sum += naive.likelihood(weights, chosen);
    } else if (options.method == "ll") {
      sum += naive.likelihood(weights, std::vector<bool>(chosen.size(), true));
    } else {
      std::vector<std::vector<std::size_t>> groups;
      std::map<std::string, std::vector<std::size_t>> joint;
      for (std::size_t p = 0; p < chosen.size(); ++p) {
        if (!chosen[p] || !c.set->mentioned[p]) continue;
        bool in_block = false;
        for (const auto& block : options.blocks) {
          in_block = in_block || std::find(block.begin(), block.end(), PredicateId(p)) != block.end();
        }
        for (const std::size_t v : naive.variables_of(PredicateId(p))) {
          if (in_block) {
            joint[naive.key(v)].push_back(v);
          } else {
            groups.push_back({v});
          }
        }
      }
      for (auto& [key, variables] : joint) groups.push_back(variables);
      sum += naive.pseudo_likelihood(weights, groups);
    }
  }
  return sum;
}

LearningOptions options_for(const Case& c, const std::string& method) {
  LearningOptions options;
  options.method = method;
  options.threads = 1;
  if (method == "dpll" || method == "cll") {
    options.discriminative = {*c.model->find_predicate("k"), *c.model->find_predicate("P")};
  }
  if (method == "bpll") {
    options.blocks = {{*c.model->find_predicate("k"), *c.model->find_predicate("P"), *c.model->find_predicate("m")}};
  }
  return options;
}

class Likelihood : public testing::TestWithParam<const char*> {};

TEST_P(Likelihood, AndItsGradientAreThoseOfTheDefinition) {
  Monitor monitor;
  const StopCondition stop(monitor);
  int compared = 0;
  const int models = std::string(GetParam()) == "ll" ? random_models() / 5 + 1 : random_models();  // the twin is slow
  for (int number = 0; number < models; ++number) {
    const Case c(number);
    const LearningOptions options = options_for(c, GetParam());
    const std::vector<double> weights = random_weights(c.set->weights.size(), static_cast<std::uint64_t>(number));
    const std::optional<double> expected = naive_value(c, options, weights);
    const PreparedOrProblem made = find_learning_method(GetParam())->prepare(*c.set, options, number % 2 == 0, stop);
    ASSERT_EQ(made.data != nullptr, expected.has_value()) << made.problem.message << "\n" << c.text();
    if (!expected) {
      EXPECT_EQ(made.problem.termination, Termination::kNoPossibleWorld);
      continue;
    }
    std::vector<std::uint32_t> all(c.set->databases.size());
    std::iota(all.begin(), all.end(), 0u);
    const auto objective = made.data->objective(all);
    std::vector<double> gradient(weights.size()), unused(weights.size());
    ASSERT_NEAR(objective->evaluate(weights, gradient), *expected, 1e-9) << number << "\n" << c.text();
    for (std::size_t w = 0; w < weights.size(); ++w) {
      std::vector<double> moved = weights;
      moved[w] += 1e-5;
      const double above = objective->evaluate(moved, unused);
      moved[w] -= 2e-5;
      const double below = objective->evaluate(moved, unused);
      ASSERT_NEAR(gradient[w], (above - below) / 2e-5, 1e-6) << number << "\n" << c.text();
      if (objective->support()[w] == 0.0) {
        ASSERT_EQ(gradient[w], 0.0) << number << "\n" << c.text();
      }
    }
    ++compared;
  }
  EXPECT_GT(compared, models / 3);
}

TEST_P(Likelihood, InformationIsMinusTheSlopeOfTheGradient) {
  Monitor monitor;
  const StopCondition stop(monitor);
  for (int number = 0; number < std::min(40, random_models()); ++number) {
    const Case c(number);
    const LearningOptions options = options_for(c, GetParam());
    const PreparedOrProblem made = find_learning_method(GetParam())->prepare(*c.set, options, false, stop);
    if (!made.data) continue;
    std::vector<std::uint32_t> all(c.set->databases.size());
    std::iota(all.begin(), all.end(), 0u);
    const auto objective = made.data->objective(all);
    const std::vector<double> weights = random_weights(c.set->weights.size(), static_cast<std::uint64_t>(number));
    std::vector<std::uint32_t> subset(weights.size());
    std::iota(subset.begin(), subset.end(), 0u);
    const Eigen::MatrixXd information = objective->information(weights, subset);
    std::vector<double> above(weights.size()), below(weights.size());
    for (std::size_t w = 0; w < weights.size(); ++w) {
      std::vector<double> moved = weights;
      moved[w] += 1e-5;
      objective->evaluate(moved, above);
      moved[w] -= 2e-5;
      objective->evaluate(moved, below);
      for (std::size_t v = 0; v < weights.size(); ++v) {
        ASSERT_NEAR(information(static_cast<Eigen::Index>(w), static_cast<Eigen::Index>(v)),
                    (below[v] - above[v]) / 2e-5, 1e-4);
      }
    }
  }
}

// No step in any direction improves the objective, and the learned model reads back to the bit.
TEST_P(Likelihood, IsLargestAtTheLearnedWeights) {
  Monitor monitor;
  const int models = std::min(std::string(GetParam()) == "ll" ? 6 : 30, random_models());
  for (int number = 0; number < models; ++number) {
    const Case c(number);
    LearningOptions options = options_for(c, GetParam());
    options.prior.stdev = number % 3 == 0 ? 1.0 : 5.0;
    options.prior.mean = number % 4 == 0 ? 0.5 : 0.0;
    options.prior.l1 = number % 5 == 0 ? 0.3 : 0.0;
    const LearningResult result = learn(*c.model, c.databases, options, monitor);
    if (result.termination == Termination::kNoPossibleWorld) continue;
    ASSERT_EQ(result.termination, Termination::kCompleted) << result.message << "\n" << c.text();
    EXPECT_TRUE(result.converged) << result.reason << "\n" << c.text();
    const auto value = [&](const std::vector<double>& weights) {
      double sum = *naive_value(c, options, weights);
      for (const double w : weights) sum += options.prior.log_density(w) - options.prior.l1 * std::abs(w);
      return sum;
    };
    std::vector<double> best;
    for (const LearnedWeight& w : result.weights) best.push_back(w.weight);
    const double top = value(best);
    EXPECT_NEAR(*result.objective_with_prior, top, 1e-8) << c.text();
    Writer writer(static_cast<std::uint64_t>(number) + 99);
    for (int direction = 0; direction < 4; ++direction) {
      for (const double step : {0.3, 1e-2, 1e-4}) {
        std::vector<double> moved = best;
        for (double& w : moved) w += step * writer.weight();
        ASSERT_LE(value(moved), top + 1e-9) << c.text();
      }
    }
    const WeightTable table(*result.model);
    const std::string text = learned_model_text(*result.model, table, best, "heading\nof two lines");
    Diagnostics diagnostics;
    const auto again = parse_model(text, "learned.mln", diagnostics);
    ASSERT_TRUE(again) << diagnostics.render() << text;
    std::vector<double> read;
    for (const Formula& formula : again->formulas()) {
      if (!formula.hard) read.push_back(formula.weight);
    }
    EXPECT_EQ(read, best) << text;
  }
}

// Sampled gradients against the exact likelihood. At the optimum of a concave function with curvature H, weights that are
// off by H^-1 g for noise g cost g' H^-1 g / 2 nats, and the noise of n draws has a covariance of at most H / n: d free
// weights cost d / (2 n) in the mean after one iteration. Averaging over 32 of them leaves room for draws of a chain, each
// of which is `worth` a part of an independent one.
void expect_near_optimum(const Model& model, const std::vector<Evidence>& databases, LearningOptions options,
                         double worth) {
  Monitor monitor;
  const StopCondition stop(monitor);
  options.method = "cll";
  const LearningResult best = learn(model, databases, options, monitor);
  ASSERT_EQ(best.termination, Termination::kCompleted) << best.message;
  const TrainingSet set(model, databases);
  const PreparedOrProblem made = find_learning_method("cll")->prepare(set, options, false, stop);
  ASSERT_TRUE(made.data) << made.problem.message;
  std::vector<std::uint32_t> all(databases.size());
  std::iota(all.begin(), all.end(), 0u);
  const auto objective = made.data->objective(all);
  options.method = "mcsat";
  options.samples = 2000;
  for (const char* expectation : {"auto", "mcsat"}) {
    options.expectation = expectation;
    const LearningResult found = learn(model, databases, options, monitor);
    ASSERT_EQ(found.termination, Termination::kCompleted) << found.message;
    EXPECT_TRUE(found.converged) << expectation << " " << found.reason;
    ASSERT_EQ(found.weights.size(), best.weights.size());
    std::vector<double> weights, unused(found.weights.size());
    double prior = 0.0, free = 0.0;
    for (std::size_t w = 0; w < found.weights.size(); ++w) {
      // It may take a formula that hard formulas decide for one that data speaks of, and never the other way round.
      EXPECT_TRUE(found.weights[w].identified || !best.weights[w].identified) << w;
      free += found.weights[w].identified ? 1.0 : 0.0;
      weights.push_back(found.weights[w].weight);
      prior += options.prior.log_density(weights.back());
    }
    const double gap = *best.objective_with_prior - objective->evaluate(weights, unused) - prior;
    EXPECT_GT(gap, -1e-6) << expectation;
    EXPECT_LT(gap, 1e-6 + free / (2.0 * worth * options.samples)) << expectation;
  }
}

TEST(SampledLearning, ComesNearTheOptimumOfTheExactLikelihood) {
  Monitor monitor;
  int compared = 0;
  for (int number = 0; number < std::min(40, random_models()); ++number) {
    const Case c(number);
    LearningOptions options = options_for(c, "cll");
    options.prior.stdev = number % 3 == 0 ? 1.0 : 3.0;
    if (learn(*c.model, c.databases, options, monitor).termination == Termination::kNoPossibleWorld) continue;
    SCOPED_TRACE(std::to_string(number) + "\n" + c.text());
    expect_near_optimum(*c.model, c.databases, options, 1.0);
    ++compared;
  }
  EXPECT_GT(compared, 10);
}

// Friends of friends that all do the same, in formulas that overlap: a count knows a small part of its own variance.
TEST(SampledLearning, IsNotThrownByCorrelatedCounts) {
  for (const std::string formulas :
       {"0 Smokes(x) ^ Smokes(x)\n0 !Smokes(x)\n0 Smokes(x) v Smokes(x)\n0 Smokes(x)\n"
        "0 Friends(x,y) => (Smokes(x) <=> Smokes(y))\n",
        "0 Smokes(x)\n0 Friends(x,y) ^ Smokes(x) ^ Smokes(y)\n0 Friends(x,y) ^ Smokes(x)\n"
        "0 Friends(x,y) ^ !Smokes(x) ^ !Smokes(y)\n0 Friends(x,y) ^ Friends(y,z) ^ Smokes(x) ^ Smokes(z)\n"}) {
    Writer random(41);
    std::string data;
    for (int d = 0; d < 6; ++d) {
      data += (d > 0 ? "---\n" : "") + std::string("person = {A, B, C, D, E, F, G, H}\n");
      const double share = d % 2 == 0 ? 0.85 : 0.15;
      for (char x = 'A'; x <= 'H'; ++x) {
        if (random.coin(share)) data += std::string("Smokes(") + x + ")\n";
        for (char y = 'A'; y <= 'H'; ++y) {
          if (x != y && random.coin(0.5)) data += std::string("Friends(") + x + "," + y + ")\n";
        }
      }
    }
    Diagnostics diagnostics;
    const auto model = parse_model("Smokes(person)\nFriends(person,person)\n" + formulas, "m.mln", diagnostics);
    ASSERT_TRUE(model) << diagnostics.render();
    const auto databases = parse_evidence(*model, data, "t.db", diagnostics);
    ASSERT_TRUE(databases) << diagnostics.render();
    LearningOptions options;
    options.discriminative = {*model->find_predicate("Smokes")};
    options.threads = 1;
    for (const double stdev : {1.0, 10.0}) {
      options.prior.stdev = stdev;
      SCOPED_TRACE(formulas + std::to_string(stdev));
      expect_near_optimum(*model, *databases, options, 0.25);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Methods, Likelihood, testing::Values("pll", "bpll", "dpll", "cll", "ll"),
                         [](const auto& method) { return std::string(method.param); });

}  // namespace
}  // namespace sherlog
