// Each exported text is read back by a small reader of that format and solved by brute force.
#include "grounding/export.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <sstream>
#include <string>
#include <vector>

#include "tests/oracles/enumeration.h"

namespace sherlog {
namespace {

template <class Exporter>
std::string text_of(Exporter exporter, const GroundNetwork& network) {
  std::ostringstream out;
  exporter(network, out);
  return out.str();
}

struct Uai {
  std::vector<std::size_t> sizes;
  std::vector<std::vector<std::size_t>> scopes;
  std::vector<std::vector<double>> tables;
};

Uai read_uai(const std::string& text) {
  std::istringstream in(text);
  std::string kind;
  std::size_t count = 0;
  Uai uai;
  in >> kind >> count;
  EXPECT_EQ(kind, "MARKOV");
  uai.sizes.resize(count);
  for (std::size_t& size : uai.sizes) in >> size;
  in >> count;
  uai.scopes.resize(count);
  uai.tables.resize(count);
  for (auto& scope : uai.scopes) {
    in >> count;
    scope.resize(count);
    for (std::size_t& variable : scope) in >> variable;
  }
  for (auto& table : uai.tables) {
    in >> count;
    table.resize(count);
    for (double& entry : table) in >> entry;
  }
  EXPECT_TRUE(in) << "the text ends too early";
  std::string rest;
  EXPECT_FALSE(in >> rest) << "text after the last table: " << rest;
  return uai;
}

// Sum over all assignments; a factor is multiplied in as soon as its variables are set, zeros cut the branch.
double uai_partition(const Uai& uai) {
  double constant = 1.0;
  std::vector<std::vector<std::size_t>> ready(uai.sizes.size());  // factors by the last variable of their scope
  for (std::size_t f = 0; f < uai.scopes.size(); ++f) {
    if (uai.scopes[f].empty()) {
      constant *= uai.tables[f].at(0);
      continue;
    }
    ready[*std::max_element(uai.scopes[f].begin(), uai.scopes[f].end())].push_back(f);
  }
  std::vector<std::size_t> values(uai.sizes.size(), 0);
  const auto sum_from = [&](auto&& self, std::size_t variable, double product) -> double {
    if (variable == uai.sizes.size()) return product;
    double sum = 0;
    for (values[variable] = 0; values[variable] < uai.sizes[variable]; ++values[variable]) {
      double next = product;
      for (std::size_t f : ready[variable]) {
        std::size_t index = 0;
        for (std::size_t v : uai.scopes[f]) index = index * uai.sizes[v] + values[v];
        next *= uai.tables[f].at(index);
      }
      if (next != 0) sum += self(self, variable + 1, next);
    }
    return sum;
  };
  return sum_from(sum_from, 0, constant);
}

struct Wcnf {
  std::size_t variables = 0;
  double top = 0, scale = 0, offset = 0;
  std::vector<std::pair<double, std::vector<int>>> clauses;
};

Wcnf read_wcnf(const std::string& text) {
  Wcnf wcnf;
  std::istringstream in(text);
  std::size_t clause_count = 0;
  for (std::string line; std::getline(in, line);) {
    std::istringstream words(line);
    std::string first, second;
    words >> first;
    if (first == "c") {
      words >> second;
      if (second == "scale") words >> wcnf.scale;
      if (second == "offset") words >> wcnf.offset;
    } else if (first == "p") {
      words >> second >> wcnf.variables >> clause_count >> wcnf.top;
    } else {
      std::vector<int> literals;
      for (int literal = 0; words >> literal && literal != 0;) literals.push_back(literal);
      wcnf.clauses.emplace_back(std::stod(first), std::move(literals));
    }
  }
  EXPECT_EQ(wcnf.clauses.size(), clause_count);
  return wcnf;
}

// The smallest cost of a world of the first `atoms` variables; the others are searched, too.
double wcnf_optimum(const Wcnf& wcnf) {
  std::vector<std::vector<std::size_t>> ready(wcnf.variables + 1);
  for (std::size_t c = 0; c < wcnf.clauses.size(); ++c) {
    int last = 0;
    for (int literal : wcnf.clauses[c].second) last = std::max(last, std::abs(literal));
    ready[static_cast<std::size_t>(last)].push_back(c);
  }
  std::vector<bool> values(wcnf.variables + 1, false);
  double best = std::numeric_limits<double>::infinity();
  const auto search = [&](auto&& self, std::size_t variable, double cost) -> void {
    if (cost >= best) return;
    if (variable > wcnf.variables) {
      best = cost;
      return;
    }
    for (const bool value : {false, true}) {
      values[variable] = value;
      double next = cost;
      for (std::size_t c : ready[variable]) {
        const auto& [weight, literals] = wcnf.clauses[c];
        const bool met = std::any_of(literals.begin(), literals.end(), [&](int literal) {
          return values[static_cast<std::size_t>(std::abs(literal))] == (literal > 0);
        });
        if (!met) next += weight;
      }
      if (next < wcnf.top) self(self, variable + 1, next);
    }
  };
  search(search, 1, 0);
  return best;
}

GroundNetwork wide_or() {
  NetworkBuilder builder;
  std::vector<Literal> inputs;
  for (int i = 0; i < 11; ++i) inputs.push_back(Literal::atom(builder.first_atom(builder.add_boolean()), i % 2 == 0));
  const WeightId weight = builder.add_weight({FormulaId(0), {}, -1.25});
  builder.add_feature(builder.make_or(inputs), -1.25, weight);
  return builder.build();
}

TEST(UaiExport, PartitionFunctionIsOurs) {
  std::mt19937_64 random(7);
  int constant_scores = 0;
  for (int i = 0; i < 40; ++i) {
    const GroundNetwork network = oracle::random_network(random);
    const auto expected = oracle::enumerate(network);
    const double sum = uai_partition(read_uai(text_of(export_uai, network)));
    if (!expected.possible) {
      EXPECT_EQ(sum, 0.0);
      continue;
    }
    EXPECT_NEAR(std::log(sum), expected.log_partition, 1e-9);
    constant_scores += network.constant_score() != 0.0 ? 1 : 0;
  }
  EXPECT_GT(constant_scores, 0);
}

TEST(UaiExport, ConstantScoreAndFreeAtomsAreInTheFile) {
  for (const bool with_variable : {false, true}) {
    NetworkBuilder builder;
    if (with_variable) {
      const AtomId atom = builder.first_atom(builder.add_boolean());
      builder.add_feature(Literal::atom(atom), 0.5, builder.add_weight({FormulaId(0), {}, 0.5}));
    }
    builder.add_constant_score(1.75);
    builder.add_free_log_count(2 * std::log(2.0));
    const Uai uai = read_uai(text_of(export_uai, builder.build()));
    // e^1.75 in each of the 4 worlds of the free atoms, times 1 + e^0.5 for the variable
    const double expected = 4 * std::exp(1.75) * (with_variable ? 1 + std::exp(0.5) : 1);
    EXPECT_NEAR(uai_partition(uai), expected, 1e-9 * expected);
  }
}

TEST(UaiExport, WeightsWithoutRoomAreRefused) {
  for (const double weight : {1e300, -1e300, 1e9}) {
    NetworkBuilder builder;
    const AtomId atom = builder.first_atom(builder.add_boolean());
    builder.add_feature(Literal::atom(atom), weight, builder.add_weight({FormulaId(0), {}, weight}));
    const GroundNetwork network = builder.build();
    std::ostringstream out;
    EXPECT_TRUE(export_uai(network, out).has_value()) << weight;
    EXPECT_EQ(out.str(), "");
    EXPECT_EQ(wcnf_optimum(read_wcnf(text_of(export_wcnf, network))), 0) << weight;
  }
}

TEST(UaiExport, GatesOverManyVariablesGetAuxiliaryVariables) {
  const GroundNetwork network = wide_or();
  const Uai uai = read_uai(text_of(export_uai, network));
  EXPECT_EQ(uai.sizes.size(), 11u + 10u);  // a chain of 10 ORs of two
  for (const auto& table : uai.tables) EXPECT_LE(table.size(), 8u);
  // 2^11 worlds, all but one of which make the OR true
  EXPECT_NEAR(uai_partition(uai), 2047 * std::exp(-1.25) + 1, 1e-9);
}

TEST(UaiExport, VeryLargeWeightsStayFinite) {
  NetworkBuilder builder;
  const AtomId atom = builder.first_atom(builder.add_boolean());
  const WeightId weight = builder.add_weight({FormulaId(0), {}, 1200.0});
  builder.add_feature(Literal::atom(atom), 1200.0, weight);
  const Uai uai = read_uai(text_of(export_uai, builder.build()));
  ASSERT_EQ(uai.tables.size(), 3u);  // 1200 = 3 * 400
  for (const auto& table : uai.tables) EXPECT_NEAR(std::log(table[0]), 400, 1e-9);
}

TEST(UaiExport, NetworkWithoutVariablesIsReadable) {
  const Uai uai = read_uai(text_of(export_uai, NetworkBuilder().build()));
  EXPECT_TRUE(uai.sizes.empty());
  EXPECT_TRUE(uai.tables.empty());
}

TEST(WcnfExport, OptimumIsTheMostProbableWorld) {
  std::mt19937_64 random(8);
  for (int i = 0; i < 40; ++i) {
    const GroundNetwork network = oracle::random_network(random);
    const auto expected = oracle::enumerate(network);
    const Wcnf wcnf = read_wcnf(text_of(export_wcnf, network));
    const double cost = wcnf_optimum(wcnf);
    if (!expected.possible) {
      EXPECT_EQ(cost, std::numeric_limits<double>::infinity());
      continue;
    }
    // Each weight is rounded by at most half a unit of the scale.
    const double rounding = 0.5 * static_cast<double>(network.features().size()) / wcnf.scale + 1e-9;
    EXPECT_NEAR(wcnf.offset - cost / wcnf.scale, expected.best_score, rounding);
  }
}

TEST(WcnfExport, ScaleShrinksSoThatHugeWeightsDoNotOverflow) {
  NetworkBuilder builder;
  const AtomId atom = builder.first_atom(builder.add_boolean());
  const WeightId weight = builder.add_weight({FormulaId(0), {}, 1e15});
  builder.add_feature(Literal::atom(atom), 1e15, weight);
  const Wcnf wcnf = read_wcnf(text_of(export_wcnf, builder.build()));
  EXPECT_LT(wcnf.top, 0x1p62);
  EXPECT_EQ(wcnf_optimum(wcnf), 0);
}

TEST(GraphExport, EveryVariableFeatureAndConstraintIsANode) {
  std::mt19937_64 random(9);
  const GroundNetwork network = oracle::random_network(random);
  const std::string graphml = text_of(export_graphml, network);
  const std::string dot = text_of(export_dot, network);
  const auto count = [](const std::string& text, const std::string& what) {
    std::size_t n = 0;
    for (std::size_t at = text.find(what); at != std::string::npos; at = text.find(what, at + 1)) ++n;
    return n;
  };
  const std::size_t nodes = network.variable_count() + network.features().size() + network.constraints().size();
  EXPECT_EQ(count(graphml, "<node "), nodes);
  EXPECT_EQ(count(dot, "shape="), nodes);
  EXPECT_EQ(count(graphml, "<edge "), count(dot, "--"));
  EXPECT_EQ(count(graphml, ">feature<"), network.features().size());
}

}  // namespace
}  // namespace sherlog
