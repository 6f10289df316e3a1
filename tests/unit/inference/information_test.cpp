// Mutual information against the sum over all worlds that it is.
#include "inference/information.h"

#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <random>
#include <vector>

#include "inference/query_entropy.h"
#include "tests/oracles/enumeration.h"

namespace sherlog {
namespace {

using Values = std::vector<std::uint32_t>;

// Every world with its probability.
std::vector<std::pair<Values, double>> worlds(const GroundNetwork& network) {
  std::vector<std::pair<Values, double>> result;
  Values values(network.variable_count(), 0);
  double sum = 0;
  while (true) {
    if (const auto score = oracle::score(network, values)) {
      result.emplace_back(values, std::exp(*score));
      sum += result.back().second;
    }
    std::size_t v = 0;
    while (v < values.size() && ++values[v] == network.value_count(VariableId(v))) values[v++] = 0;
    if (v == values.size()) break;
  }
  for (auto& [world, p] : result) p /= sum;
  return result;
}

Values part(const Values& world, const std::vector<VariableId>& variables) {
  Values result;
  for (const VariableId v : variables) result.push_back(world[v.index()]);
  return result;
}

double entropy(const GroundNetwork& network, const std::vector<VariableId>& variables) {
  std::map<Values, double> probability;
  for (const auto& [world, p] : worlds(network)) probability[part(world, variables)] += p;
  double sum = 0;
  for (const auto& [values, p] : probability) sum -= p > 0 ? p * std::log(p) : 0;
  return sum;
}

double information(const GroundNetwork& network, std::vector<VariableId> queried,
                   const std::vector<VariableId>& outcome) {
  const double apart = entropy(network, queried) + entropy(network, outcome);
  queried.insert(queried.end(), outcome.begin(), outcome.end());
  return apart - entropy(network, queried);
}

struct Question {
  GroundNetwork network;
  std::vector<VariableId> queried, outcome;
};

// Blocks and booleans with random formulas and a hard one; some variables are asked for, some are seen, some are hidden.
Question random_question(std::mt19937_64& random, std::uint32_t variables) {
  NetworkBuilder builder;
  Question question;
  std::vector<VariableId> all;
  for (std::uint32_t i = 0; i < variables; ++i) {
    all.push_back(random() % 3 == 0 ? builder.add_anonymous(3, random() % 2 == 0) : builder.add_boolean());
  }
  const auto literal = [&] { return Literal::atom(AtomId(random() % builder.atom_count()), random() % 2 == 0); };
  const auto formula = [&] {
    std::vector<Literal> inputs{literal(), literal()};
    if (random() % 3 == 0) inputs.push_back(literal());
    return random() % 2 == 0 ? builder.make_or(inputs) : builder.make_and(inputs);
  };
  for (std::uint32_t i = 0; i < 2 * variables; ++i) {
    const double weight = static_cast<double>(random() % 400) / 100.0 - 2.0;
    builder.add_feature(formula(), weight, builder.add_weight({FormulaId(0), {}, weight}));
  }
  std::vector<Literal> hard{literal(), literal(), literal()};
  (void)builder.add_constraint(builder.make_or(hard), FormulaId(0));
  for (const VariableId v : all) {
    const auto role = random() % 3;
    if (role == 0) question.outcome.push_back(v);
    if (role == 1) question.queried.push_back(v);
  }
  for (const VariableId v : question.queried) {
    builder.add_query({Literal::atom(builder.first_atom(v)), false, ""});
  }
  question.network = builder.build();
  return question;
}

InformationOptions exact_questions() {
  InformationOptions options;
  options.inference.method = "exact";
  return options;
}

TEST(Information, EqualsTheSumOverAllWorlds) {
  std::mt19937_64 random(1);
  Monitor monitor;
  int positive = 0;
  for (int trial = 0; trial < 150; ++trial) {
    const Question question = random_question(random, 7);
    const double expected = information(question.network, question.queried, question.outcome);
    const Information found = expected_information(question.network, question.outcome, exact_questions(), monitor);
    ASSERT_EQ(found.termination, Termination::kCompleted) << found.message;
    EXPECT_NEAR(found.expected_drop, expected, 1e-8) << "trial " << trial;
    EXPECT_GE(found.expected_drop, 0.0);
    EXPECT_FALSE(found.mcse);
    positive += expected > 1e-3 ? 1 : 0;
  }
  EXPECT_GT(positive, 50);
}

// With few joint values allowed hidden variables cannot be summed out beside the outcome: they join the frontier.
TEST(Information, HiddenVariablesMayJoinTheFrontier) {
  // Asked - Hidden - (forty booleans seen): given Hidden each is seen apart; summed out with it they would be 2^41.
  NetworkBuilder builder;
  const VariableId asked = builder.add_boolean(), hidden = builder.add_boolean();
  const auto atom = [&](VariableId v) { return Literal::atom(builder.first_atom(v)); };
  const auto connect = [&](VariableId a, VariableId b, double weight) {
    builder.add_feature(builder.make_iff(atom(a), atom(b)), weight, builder.add_weight({FormulaId(0), {}, weight}));
  };
  connect(asked, hidden, 1.0);
  std::vector<VariableId> outcome;
  for (int i = 0; i < 40; ++i) {
    outcome.push_back(builder.add_boolean());
    connect(hidden, outcome.back(), 2.0);
  }
  builder.add_query({atom(asked), false, ""});
  Monitor monitor;
  const Information found = expected_information(builder.build(), outcome, exact_questions(), monitor);
  ASSERT_EQ(found.termination, Termination::kCompleted) << found.message;
  EXPECT_EQ(found.outcomes, 41u);  // only how many are true matters
  // Forty looks leave no doubt about Hidden: what remains is the entropy of Asked given it, with p = e / (1 + e).
  const double p = std::exp(1.0) / (1.0 + std::exp(1.0));
  EXPECT_NEAR(found.expected_drop, std::log(2.0) + p * std::log(p) + (1 - p) * std::log(1 - p), 1e-6);
}

TEST(Information, DrawsAreWithinTheirErrorAndNeverNegative) {
  std::mt19937_64 random(2);
  Monitor monitor;
  int drawn = 0;
  for (int trial = 0; trial < 60; ++trial) {
    const Question question = random_question(random, 6);
    InformationOptions options = exact_questions();
    options.max_outcomes = 1;
    options.draws = 4000;
    const Information found = expected_information(question.network, question.outcome, options, monitor);
    ASSERT_EQ(found.termination, Termination::kCompleted) << found.message;
    EXPECT_GE(found.expected_drop, 0.0);
    const Information again = expected_information(question.network, question.outcome, options, monitor);
    EXPECT_EQ(found.expected_drop, again.expected_drop);
    if (!found.mcse) continue;
    ++drawn;
    EXPECT_NEAR(found.expected_drop, information(question.network, question.queried, question.outcome),
                5 * *found.mcse + 1e-6);
  }
  EXPECT_GT(drawn, 10);
}

TEST(Information, OutcomeThatSaysNothingIsWorthNothing) {
  NetworkBuilder builder;
  const VariableId asked = builder.add_boolean(), other = builder.add_boolean(), seen = builder.add_boolean();
  const auto weight = builder.add_weight({FormulaId(0), {}, 1.0});
  builder.add_feature(Literal::atom(builder.first_atom(seen)), 1.0, weight);
  builder.add_feature(
      builder.make_iff(Literal::atom(builder.first_atom(other)), Literal::atom(builder.first_atom(seen))), 1.0, weight);
  builder.add_query({Literal::atom(builder.first_atom(asked)), false, ""});
  Monitor monitor;
  const std::vector<VariableId> outcome{seen};
  const Information found = expected_information(builder.build(), outcome, exact_questions(), monitor);
  EXPECT_EQ(found.termination, Termination::kCompleted);
  EXPECT_EQ(found.expected_drop, 0.0);
  EXPECT_EQ(found.outcomes, 1u);
}

TEST(Information, WhatCannotBeAnsweredIsRefused) {
  Monitor monitor;
  {
    NetworkBuilder builder;
    const VariableId asked = builder.add_boolean();
    builder.add_query({Literal::atom(builder.first_atom(asked)), false, ""});
    const std::vector<VariableId> outcome{asked};
    EXPECT_EQ(expected_information(builder.build(), outcome, exact_questions(), monitor).termination,
              Termination::kRefused);
  }
  {
    NetworkBuilder builder;
    const VariableId asked = builder.add_boolean(), seen = builder.add_boolean();
    builder.add_query({Literal::atom(builder.first_atom(asked)), true, "X0"});
    const std::vector<VariableId> outcome{seen};
    EXPECT_EQ(expected_information(builder.build(), outcome, exact_questions(), monitor).termination,
              Termination::kRefused);
  }
  {
    // One outcome that is tied to fifteen asked booleans by one formula: 2^15 joint values.
    NetworkBuilder builder;
    const VariableId seen = builder.add_boolean();
    std::vector<Literal> inputs{Literal::atom(builder.first_atom(seen))};
    for (int i = 0; i < 15; ++i) {
      inputs.push_back(Literal::atom(builder.first_atom(builder.add_boolean())));
      builder.add_query({inputs.back(), false, ""});
    }
    builder.add_feature(builder.make_or(inputs), 1.0, builder.add_weight({FormulaId(0), {}, 1.0}));
    const std::vector<VariableId> outcome{seen};
    const Information found = expected_information(builder.build(), outcome, exact_questions(), monitor);
    EXPECT_EQ(found.termination, Termination::kTooWide);
    EXPECT_FALSE(found.message.empty());
  }
}

TEST(QueryEntropy, EqualsTheSumOverAllWorlds) {
  std::mt19937_64 random(3);
  Monitor monitor;
  int joint = 0;
  for (int trial = 0; trial < 60; ++trial) {
    const Question question = random_question(random, 6);
    const QueryEntropy found = query_entropy(question.network, exact_questions().inference, monitor);
    ASSERT_EQ(found.termination, Termination::kCompleted) << found.message;
    double marginal = 0;
    for (const VariableId v : question.queried) marginal += entropy(question.network, {v});
    EXPECT_NEAR(found.marginal, marginal, 1e-9);
    if (!found.joint) continue;
    EXPECT_NEAR(*found.joint, entropy(question.network, question.queried), 1e-7);
    ++joint;
  }
  EXPECT_GT(joint, 3);

  // All variables are asked for: the joint entropy comes from log Z.
  NetworkBuilder builder;
  std::vector<VariableId> all;
  for (int i = 0; i < 5; ++i) {
    all.push_back(builder.add_anonymous(3, i % 2 == 0));
    builder.add_query({Literal::atom(builder.first_atom(all.back())), false, ""});
  }
  for (int i = 0; i < 12; ++i) {
    std::vector<Literal> inputs{Literal::atom(AtomId(random() % 15)), Literal::atom(AtomId(random() % 15), true)};
    const double weight = static_cast<double>(random() % 600) / 100.0 - 3.0;
    builder.add_feature(builder.make_or(inputs), weight, builder.add_weight({FormulaId(0), {}, weight}));
  }
  const GroundNetwork network = builder.build();
  const QueryEntropy found = query_entropy(network, exact_questions().inference, monitor);
  ASSERT_TRUE(found.joint);
  EXPECT_NEAR(*found.joint, entropy(network, all), 1e-7);
  EXPECT_LT(*found.joint, found.marginal);
}

}  // namespace
}  // namespace sherlog
