#include "tests/oracles/enumeration.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace sherlog::oracle {

bool evaluate(const GroundNetwork& network, Literal literal, const std::vector<std::uint32_t>& values) {
  if (literal.is_constant()) return literal == Literal::constant(true);
  bool truth = false;
  if (literal.is_atom()) {
    const VariableId v = network.variable_of(literal.atom());
    truth = values[v.index()] == network.value_of(literal.atom());
  } else {
    const auto inputs = network.gate_inputs(literal.gate());
    const auto true_inputs = std::ranges::count_if(inputs, [&](Literal l) { return evaluate(network, l, values); });
    switch (network.gate_kind(literal.gate())) {
      case GateKind::kOr:
        truth = true_inputs > 0;
        break;
      case GateKind::kIff:
        truth = true_inputs != 1;
        break;
      case GateKind::kAtMostOne:
        truth = true_inputs <= 1;
        break;
    }
  }
  return truth != literal.negated();
}

std::optional<double> score(const GroundNetwork& network, const std::vector<std::uint32_t>& values) {
  for (const Constraint& c : network.constraints()) {
    if (!evaluate(network, c.literal, values)) return std::nullopt;
  }
  double sum = network.constant_score();
  for (const Feature& f : network.features()) {
    if (evaluate(network, f.literal, values)) sum += f.weight;
  }
  return sum;
}

Enumeration enumerate(const GroundNetwork& network) {
  Enumeration result;
  std::vector<std::uint32_t> values(network.variable_count(), 0);
  std::vector<std::vector<std::uint32_t>> worlds;
  std::vector<double> scores;
  for (bool more = true; more;) {
    if (const auto s = score(network, values)) {
      worlds.push_back(values);
      scores.push_back(*s);
    }
    more = false;
    for (std::size_t v = 0; v < values.size(); ++v) {
      if (++values[v] < network.value_count(VariableId(v))) {
        more = true;
        break;
      }
      values[v] = 0;
    }
  }
  result.marginals.assign(network.queries().size(), 0.0);
  result.atom_marginals.assign(network.atom_count(), 0.0);
  result.worlds = static_cast<double>(scores.size());
  if (scores.empty()) return result;
  result.possible = true;
  result.best_score = *std::ranges::max_element(scores);
  double total = 0.0;
  for (std::size_t w = 0; w < worlds.size(); ++w) {
    const double p = std::exp(scores[w] - result.best_score);
    total += p;
    for (std::size_t q = 0; q < result.marginals.size(); ++q) {
      if (evaluate(network, network.queries()[q].literal, worlds[w])) result.marginals[q] += p;
    }
    for (std::size_t a = 0; a < result.atom_marginals.size(); ++a) {
      if (evaluate(network, Literal::atom(AtomId(a)), worlds[w])) result.atom_marginals[a] += p;
    }
  }
  for (double& m : result.marginals) m /= total;
  for (double& m : result.atom_marginals) m /= total;
  result.log_partition = result.best_score + std::log(total) + network.free_log_count();
  return result;
}

namespace {

Literal random_formula(NetworkBuilder& builder, std::mt19937_64& random, std::uint32_t max_inputs, int depth) {
  const auto below = [&](std::uint64_t n) { return static_cast<std::uint32_t>(random() % n); };
  const bool flip = below(2) == 0;
  if (depth == 0 || below(3) == 0) return Literal::atom(AtomId(below(builder.atom_count())), flip);
  Literal result;
  if (below(4) == 0) {
    const Literal a = random_formula(builder, random, max_inputs, depth - 1);
    result = builder.make_iff(a, random_formula(builder, random, max_inputs, depth - 1));
  } else {
    std::vector<Literal> inputs;
    for (std::uint32_t i = 0, n = 2 + below(max_inputs - 1); i < n; ++i) {
      inputs.push_back(random_formula(builder, random, max_inputs, depth - 1));
    }
    result = builder.make_or(inputs);
  }
  return flip ? ~result : result;
}

}  // namespace

GroundNetwork random_network(std::mt19937_64& random, const RandomNetworkOptions& options) {
  NetworkBuilder builder;
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  for (std::uint32_t v = 0; v < options.variables; ++v) {
    if (std::abs(uniform(random)) < options.block_share) {
      builder.add_anonymous(static_cast<std::uint32_t>(2 + random() % 3), random() % 2 == 0);
    } else {
      builder.add_boolean();
    }
  }
  const WeightId weight = builder.add_weight({FormulaId(0), {}, 1.0});
  for (std::uint32_t f = 0; f < options.features; ++f) {
    const Literal literal = random_formula(builder, random, options.max_inputs, 2);
    builder.add_feature(literal, options.weight * uniform(random), weight);
  }
  for (std::uint32_t c = 0; c < options.constraints; ++c) {
    const Literal literal = random_formula(builder, random, options.max_inputs, c % 3 == 0 ? 2 : 1);
    builder.add_constraint(literal, FormulaId(1));
  }
  for (std::uint32_t a = 0; a < builder.atom_count(); ++a) builder.add_query({Literal::atom(AtomId(a)), false, ""});
  for (int q = 0; q < 2; ++q) {
    builder.add_query({random_formula(builder, random, options.max_inputs, 1), true, "formula"});
  }
  return builder.build();
}

}  // namespace sherlog::oracle
