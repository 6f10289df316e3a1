#include "inference/exact.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <optional>
#include <vector>

#include "inference/rng.h"

namespace sherlog {
namespace {

Literal first(const NetworkBuilder& builder, VariableId v) { return Literal::atom(builder.first_atom(v)); }

void query(NetworkBuilder& builder, Literal literal) { builder.add_query({literal, false, ""}); }

class Solver {
 public:
  explicit Solver(GroundNetwork network) : network_(std::move(network)) {
    for (std::size_t c = 0; c < network_.component_count(); ++c) components_.emplace_back(c);
  }
  MethodResult marginals() { return run_exact(context()); }
  MethodResult map() { return run_exact_map(context()); }
  InferenceOptions& options() { return options_; }
  const GroundNetwork& network() const { return network_; }
  ExactCost cost(ComponentId component) const { return exact_cost(network_, component, options_, stop_); }

 private:
  MethodContext context() const { return {network_, components_, options_, stop_, {}}; }
  GroundNetwork network_;
  Monitor monitor_;
  StopCondition stop_{monitor_};
  InferenceOptions options_;
  std::vector<ComponentId> components_;
};

// ---------------------------------------------------------------------------------------------------------------------
// Matching old to new objects: is(o, n) in {stay, move, newview, not}, at most one match in each row and column.

enum Explanation : std::uint32_t { kStay, kMove, kNewview, kNot };

struct Scene {
  std::vector<std::vector<double>> similar, proximity;  // grades by [old][new]
  std::vector<bool> out_of_view;                        // by old
  std::size_t olds() const { return similar.size(); }
  std::size_t news() const { return similar[0].size(); }
};

// Queries: is(o, n, stay | move | newview) for all o, n in order; appear(n); unmatched(o), which is disappear or
// hidden.
GroundNetwork matching_network(const Scene& scene) {
  NetworkBuilder builder;
  const WeightId weight = builder.add_weight({});
  const auto graded = [&](double p) {
    const Literal atom = first(builder, builder.add_boolean());
    builder.add_feature(atom, std::log(p), weight);
    builder.add_feature(~atom, std::log(1.0 - p), weight);
    return atom;
  };
  std::vector<std::vector<AtomId>> is(scene.olds());
  const auto value = [&](std::size_t o, std::size_t n, Explanation e) {
    return Literal::atom(AtomId(is[o][n].value + e));
  };
  for (std::size_t o = 0; o < scene.olds(); ++o) {
    for (std::size_t n = 0; n < scene.news(); ++n) is[o].push_back(builder.first_atom(builder.add_anonymous(4, false)));
  }
  for (std::size_t o = 0; o < scene.olds(); ++o) {
    for (std::size_t n = 0; n < scene.news(); ++n) {
      const Literal s = graded(scene.similar[o][n]), p = graded(scene.proximity[o][n]);
      const auto equals = [&](Explanation e, Literal a, Literal b) {
        std::vector<Literal> both{a, b};
        builder.add_constraint(builder.make_iff(value(o, n, e), builder.make_and(both)), FormulaId(0));
      };
      if (scene.out_of_view[o]) {
        // Only move and not are left; the grades' joint weight is that of their case.
        builder.add_constraint(~value(o, n, kStay), FormulaId(1));
        builder.add_constraint(~value(o, n, kNewview), FormulaId(1));
      }
      equals(kStay, s, p);
      equals(kMove, s, ~p);
      equals(kNewview, ~s, p);
    }
  }
  const auto exclude = [&](std::size_t o1, std::size_t n1, std::size_t o2, std::size_t n2) {
    for (const Explanation e1 : {kStay, kMove, kNewview}) {
      for (const Explanation e2 : {kStay, kMove, kNewview}) {
        std::vector<Literal> pair{~value(o1, n1, e1), ~value(o2, n2, e2)};
        builder.add_constraint(builder.make_or(pair), FormulaId(2));
      }
    }
  };
  for (std::size_t o = 0; o < scene.olds(); ++o) {
    for (std::size_t n = 0; n < scene.news(); ++n) {
      for (std::size_t other = 0; other < n; ++other) exclude(o, n, o, other);
      for (std::size_t other = 0; other < o; ++other) exclude(o, n, other, n);
    }
  }
  std::vector<Literal> appear, unmatched;
  const auto unless_matched = [&](std::vector<Literal> matches) {
    const Literal atom = first(builder, builder.add_boolean());
    builder.add_constraint(builder.make_iff(atom, ~builder.make_or(matches)), FormulaId(3));
    return atom;
  };
  for (std::size_t n = 0; n < scene.news(); ++n) {
    std::vector<Literal> matches;
    for (std::size_t o = 0; o < scene.olds(); ++o) {
      for (const Explanation e : {kStay, kMove, kNewview}) matches.push_back(value(o, n, e));
    }
    appear.push_back(unless_matched(std::move(matches)));
  }
  for (std::size_t o = 0; o < scene.olds(); ++o) {
    std::vector<Literal> matches;
    for (std::size_t n = 0; n < scene.news(); ++n) {
      for (const Explanation e : {kStay, kMove, kNewview}) matches.push_back(value(o, n, e));
    }
    unmatched.push_back(unless_matched(std::move(matches)));
  }
  for (std::size_t o = 0; o < scene.olds(); ++o) {
    for (std::size_t n = 0; n < scene.news(); ++n) {
      for (const Explanation e : {kStay, kMove, kNewview}) query(builder, value(o, n, e));
    }
  }
  for (const Literal atom : appear) query(builder, atom);
  for (const Literal atom : unmatched) query(builder, atom);
  return builder.build();
}

double case_weight(const Scene& scene, std::size_t o, std::size_t n, Explanation e) {
  const double s = scene.similar[o][n], p = scene.proximity[o][n];
  if (scene.out_of_view[o] && (e == kStay || e == kNewview)) return 0.0;
  return (e == kStay || e == kMove ? s : 1.0 - s) * (e == kStay || e == kNewview ? p : 1.0 - p);
}

// Sum over partial matchings of the product of the cases' weights, by dynamic programming over subsets of the new
// objects; optionally with is(o, n) = e forced.
struct Forced {
  std::size_t o, n;
  Explanation e;
};
double matching_sum(const Scene& scene, std::optional<Forced> forced = std::nullopt) {
  const std::size_t subsets = std::size_t{1} << scene.news();
  std::vector<double> sum(subsets, 0.0);
  sum[0] = 1.0;
  for (std::size_t o = 0; o < scene.olds(); ++o) {
    std::vector<double> next(subsets, 0.0);
    for (std::size_t choice = 0; choice <= scene.news(); ++choice) {  // == news(): unmatched
      double weight = 1.0;
      for (std::size_t n = 0; n < scene.news(); ++n) {
        double here = 0.0;
        for (const Explanation e : {kStay, kMove, kNewview, kNot}) {
          if ((e == kNot) == (choice == n)) continue;
          if (forced && forced->o == o && forced->n == n && forced->e != e) continue;
          here += case_weight(scene, o, n, e);
        }
        weight *= here;
      }
      const std::size_t bit = choice == scene.news() ? 0 : std::size_t{1} << choice;
      for (std::size_t set = 0; set < subsets; ++set) {
        if ((set & bit) == 0) next[set | bit] += sum[set] * weight;
      }
    }
    sum = next;
  }
  double total = 0.0;
  for (const double x : sum) total += x;
  return total;
}

Scene two_by_two(bool second_out_of_view) {
  return {{{0.9, 0.1}, {0.2, 0.8}}, {{0.7, 0.1}, {0.1, 0.6}}, {false, second_out_of_view}};
}

TEST(Exact, MatchingOfTwoObjectsHasTheKnownProbabilities) {
  // The sum is over matchings of products of s p, s (1-p), (1-s) p and (1-s)(1-p), worked out by hand elsewhere.
  Solver solver(matching_network(two_by_two(false)));
  const MethodResult result = solver.marginals();
  ASSERT_EQ(result.termination, Termination::kCompleted);
  EXPECT_NEAR(std::exp(*result.log_partition + solver.network().constant_score()), 0.58420032, 1e-8);
  const auto p = [&](std::size_t i) { return result.marginals[i].probability; };
  EXPECT_NEAR(p(0), 0.628921, 1e-6);  // is(O1, N1, stay)
  EXPECT_NEAR(p(1), 0.269538, 1e-6);  // move
  EXPECT_NEAR(p(2), 0.069880, 1e-6);  // newview
  EXPECT_NEAR(p(9), 0.479178, 1e-6);  // is(O2, N2, stay)
  EXPECT_NEAR(p(10), 0.319452, 1e-6);
  EXPECT_NEAR(p(11), 0.119795, 1e-6);
  EXPECT_NEAR(p(12), 0.030511, 1e-6);  // appear(N1)
  EXPECT_NEAR(p(13), 0.080795, 1e-6);
  EXPECT_NEAR(p(14), 0.030880, 1e-6);  // disappear(O1)
  EXPECT_NEAR(p(15), 0.080425, 1e-6);
}

TEST(Exact, MatchingWithAnObjectOutOfViewHasTheKnownProbabilities) {
  Solver solver(matching_network(two_by_two(true)));
  const MethodResult result = solver.marginals();
  ASSERT_EQ(result.termination, Termination::kCompleted);
  EXPECT_NEAR(std::exp(*result.log_partition + solver.network().constant_score()), 0.23404032, 1e-8);
  EXPECT_NEAR(result.marginals[10].probability, 0.797401, 1e-6);  // is(O2, N2, move)
  EXPECT_NEAR(result.marginals[15].probability, 0.200753, 1e-6);  // hidden(O2)
}

TEST(Exact, MatchingOfEightToSixEqualsDynamicProgrammingOverSubsets) {
  Rng rng(5, 0);
  Scene scene;
  for (int o = 0; o < 8; ++o) {
    std::vector<double> s, p;
    for (int n = 0; n < 6; ++n) {
      s.push_back(0.05 + 0.9 * rng.uniform());
      p.push_back(0.05 + 0.9 * rng.uniform());
    }
    scene.similar.push_back(s);
    scene.proximity.push_back(p);
    scene.out_of_view.push_back(o == 3);
  }
  Solver solver(matching_network(scene));
  const ExactCost cost = solver.cost(ComponentId(0));
  EXPECT_TRUE(cost.feasible);
  EXPECT_LE(cost.largest_log2, 16.0);  // one bit for each new object, a bit for the row, and a pair's four values
  const MethodResult result = solver.marginals();
  ASSERT_EQ(result.termination, Termination::kCompleted) << result.message;
  const double sum = matching_sum(scene);
  EXPECT_NEAR(*result.log_partition + solver.network().constant_score(), std::log(sum), 1e-9);
  std::size_t q = 0;
  for (std::size_t o = 0; o < 8; ++o) {
    for (std::size_t n = 0; n < 6; ++n) {
      for (const Explanation e : {kStay, kMove, kNewview}) {
        EXPECT_NEAR(result.marginals[q++].probability, matching_sum(scene, Forced{o, n, e}) / sum, 1e-9);
      }
    }
  }
}

// ---------------------------------------------------------------------------------------------------------------------
// Booleans with unary and pairwise weights: chains, trees, grids.

struct Pairwise {
  std::vector<double> unary;  // weight of "true"
  struct Edge {
    std::size_t a, b;
    double weight;  // of "both are true or both are false"
  };
  std::vector<Edge> edges;
};

GroundNetwork pairwise_network(const Pairwise& model) {
  NetworkBuilder builder;
  const WeightId weight = builder.add_weight({});
  std::vector<Literal> atoms;
  for (std::size_t i = 0; i < model.unary.size(); ++i) atoms.push_back(first(builder, builder.add_boolean()));
  for (std::size_t i = 0; i < atoms.size(); ++i) {
    builder.add_feature(atoms[i], model.unary[i], weight);
    query(builder, atoms[i]);
  }
  for (const auto& edge : model.edges)
    builder.add_feature(builder.make_iff(atoms[edge.a], atoms[edge.b]), edge.weight, weight);
  return builder.build();
}

// Forest where each vertex's only earlier neighbour is parent[i] < i: log Z and marginals by the usual two passes.
struct TreeAnswer {
  double log_partition;
  std::vector<double> marginals;
};
double log_add(double x, double y) { return std::max(x, y) + std::log1p(std::exp(-std::abs(x - y))); }
TreeAnswer solve_tree(const Pairwise& model, const std::vector<std::size_t>& parent,
                      const std::vector<double>& coupling) {
  using Logs = std::array<double, 2>;  // of "false" and "true"
  const auto pass = [](const Logs& x, double w) { return Logs{log_add(x[0] + w, x[1]), log_add(x[0], x[1] + w)}; };
  const std::size_t n = model.unary.size();
  std::vector<Logs> up(n), down(n, Logs{0.0, 0.0}), message(n);
  for (std::size_t i = 0; i < n; ++i) up[i] = {0.0, model.unary[i]};
  for (std::size_t i = n; i-- > 1;) {
    message[i] = pass(up[i], coupling[i]);
    up[parent[i]][0] += message[i][0];
    up[parent[i]][1] += message[i][1];
  }
  TreeAnswer out{log_add(up[0][0], up[0][1]), {}};
  for (std::size_t i = 0; i < n; ++i) {
    if (i > 0) {
      const std::size_t p = parent[i];
      down[i] = pass({up[p][0] + down[p][0] - message[i][0], up[p][1] + down[p][1] - message[i][1]}, coupling[i]);
    }
    out.marginals.push_back(1.0 / (1.0 + std::exp(up[i][0] + down[i][0] - up[i][1] - down[i][1])));
  }
  return out;
}

void expect_tree(std::size_t n, const std::function<std::size_t(std::size_t, Rng&)>& parent_of) {
  Rng rng(n, 0);
  Pairwise model;
  std::vector<std::size_t> parent(n, 0);
  std::vector<double> coupling(n, 0.0);
  for (std::size_t i = 0; i < n; ++i) {
    model.unary.push_back(2.0 * rng.uniform() - 1.0);
    if (i == 0) continue;
    parent[i] = parent_of(i, rng);
    coupling[i] = 3.0 * rng.uniform() - 1.5;
    model.edges.push_back({parent[i], i, coupling[i]});
  }
  Solver solver(pairwise_network(model));
  const MethodResult result = solver.marginals();
  ASSERT_EQ(result.termination, Termination::kCompleted) << result.message;
  const TreeAnswer expected = solve_tree(model, parent, coupling);
  EXPECT_NEAR(*result.log_partition + solver.network().constant_score(), expected.log_partition,
              1e-12 * std::max(1000.0, expected.log_partition));
  for (std::size_t i = 0; i < n; ++i) EXPECT_NEAR(result.marginals[i].probability, expected.marginals[i], 1e-9) << i;
}

TEST(Exact, AChainOf1200AtomsEqualsForwardBackward) {
  expect_tree(1200, [](std::size_t i, Rng&) { return i - 1; });
}

TEST(Exact, ATreeOf400AtomsEqualsTwoPasses) {
  expect_tree(400, [](std::size_t i, Rng& rng) { return rng.below(static_cast<std::uint32_t>(i)); });
}

TEST(Exact, AStarOf20000AtomsEqualsTwoPasses) {
  expect_tree(20000, [](std::size_t, Rng&) { return std::size_t{0}; });
}

TEST(Exact, AGridOf5By24EqualsTransferOverColumns) {
  constexpr std::size_t kRows = 5, kColumns = 24, kStates = 1u << kRows;
  Rng rng(6, 0);
  Pairwise model;
  const auto at = [](std::size_t row, std::size_t column) { return column * kRows + row; };
  for (std::size_t i = 0; i < kRows * kColumns; ++i) model.unary.push_back(2.0 * rng.uniform() - 1.0);
  std::vector<std::vector<double>> across(kColumns, std::vector<double>(kRows)), along = across;
  for (std::size_t c = 0; c < kColumns; ++c) {
    for (std::size_t r = 0; r < kRows; ++r) {
      along[c][r] = 2.0 * rng.uniform() - 1.0;
      across[c][r] = 2.0 * rng.uniform() - 1.0;
      if (r + 1 < kRows) model.edges.push_back({at(r, c), at(r + 1, c), along[c][r]});
      if (c + 1 < kColumns) model.edges.push_back({at(r, c), at(r, c + 1), across[c][r]});
    }
  }
  // Equality of two bits is asked of their difference: GCC 12.2 gets (x >> i & 1) == (x >> j & 1) wrong here at -O1.
  const auto bit = [](std::size_t state, std::size_t r) { return (state >> r & 1u) != 0; };
  const auto column_weight = [&](std::size_t c, std::size_t state) {
    double sum = 0.0;
    for (std::size_t r = 0; r < kRows; ++r) {
      if (bit(state, r)) sum += model.unary[at(r, c)];
      if (r + 1 < kRows && !bit(state ^ (state >> 1), r)) sum += along[c][r];
    }
    return std::exp(sum);
  };
  const auto step_weight = [&](std::size_t c, std::size_t left, std::size_t right) {
    double sum = 0.0;
    for (std::size_t r = 0; r < kRows; ++r) {
      if (!bit(left ^ right, r)) sum += across[c][r];
    }
    return std::exp(sum);
  };
  std::vector<std::vector<double>> forward(kColumns, std::vector<double>(kStates)), backward = forward;
  for (std::size_t c = 0; c < kColumns; ++c) {
    for (std::size_t s = 0; s < kStates; ++s) {
      double in = c == 0 ? 1.0 : 0.0;
      for (std::size_t t = 0; c > 0 && t < kStates; ++t) in += forward[c - 1][t] * step_weight(c - 1, t, s);
      forward[c][s] = in * column_weight(c, s);
    }
  }
  double total = 0.0;
  for (const double x : forward[kColumns - 1]) total += x;
  for (std::size_t c = kColumns; c-- > 0;) {
    for (std::size_t s = 0; s < kStates; ++s) {
      double out = c + 1 == kColumns ? 1.0 : 0.0;
      for (std::size_t t = 0; c + 1 < kColumns && t < kStates; ++t) {
        out += step_weight(c, s, t) * column_weight(c + 1, t) * backward[c + 1][t];
      }
      backward[c][s] = out;
    }
  }
  Solver solver(pairwise_network(model));
  const MethodResult result = solver.marginals();
  ASSERT_EQ(result.termination, Termination::kCompleted) << result.message;
  EXPECT_NEAR(*result.log_partition + solver.network().constant_score(), std::log(total), 1e-9);
  for (std::size_t c = 0; c < kColumns; ++c) {
    for (std::size_t r = 0; r < kRows; ++r) {
      double p = 0.0;
      for (std::size_t s = 0; s < kStates; ++s) p += bit(s, r) ? forward[c][s] * backward[c][s] / total : 0.0;
      EXPECT_NEAR(result.marginals[at(r, c)].probability, p, 1e-9);
    }
  }
}

// ---------------------------------------------------------------------------------------------------------------------
// What it says where it has no answer.

// A clique of `n` booleans and, beside it, one boolean with odds e^1.
GroundNetwork clique_and_atom(std::size_t n) {
  NetworkBuilder builder;
  const WeightId weight = builder.add_weight({});
  std::vector<Literal> atoms;
  for (std::size_t i = 0; i < n; ++i) atoms.push_back(first(builder, builder.add_boolean()));
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t j = 0; j < i; ++j) builder.add_feature(builder.make_iff(atoms[i], atoms[j]), 0.1, weight);
  }
  const Literal alone = first(builder, builder.add_boolean());
  builder.add_feature(alone, 1.0, weight);
  query(builder, atoms[0]);
  query(builder, alone);
  return builder.build();
}

TEST(Exact, SaysHowWideAComponentIsAndAnswersTheOthers) {
  Solver solver(clique_and_atom(60));
  const MethodResult result = solver.marginals();
  EXPECT_EQ(result.termination, Termination::kTooWide);
  EXPECT_EQ(result.message,
            "component 1 (60 variables) is too wide for exact: its largest table would have 2^60 entries (limit 2^24); "
            "use --method mcsat");
  EXPECT_FALSE(result.log_partition.has_value());
  EXPECT_TRUE(std::isnan(result.marginals[0].probability));
  EXPECT_NEAR(result.marginals[1].probability, 1.0 / (1.0 + std::exp(-1.0)), 1e-12);
  EXPECT_FALSE(solver.cost(ComponentId(0)).feasible);
  EXPECT_TRUE(solver.cost(ComponentId(1)).feasible);
}

// A block for each of `n` things with `values` values, and a weight for every pair of values of two blocks.
GroundNetwork blocks(std::uint64_t seed, std::size_t n, std::uint32_t values, double unary, double pair) {
  Rng rng(seed, 0);
  NetworkBuilder builder;
  const WeightId weight = builder.add_weight({});
  std::vector<std::uint32_t> atoms;
  const auto draw = [&](double spread) { return spread * (2.0 * rng.uniform() - 1.0); };
  for (std::size_t i = 0; i < n; ++i) {
    atoms.push_back(builder.first_atom(builder.add_anonymous(values, false)).value);
    for (std::uint32_t v = 0; v < values; ++v) {
      builder.add_feature(Literal::atom(AtomId(atoms[i] + v)), draw(unary), weight);
      query(builder, Literal::atom(AtomId(atoms[i] + v)));
    }
    for (std::size_t j = 0; j < i; ++j) {
      for (std::uint32_t v = 0; v < values * values; ++v) {
        std::vector<Literal> both{Literal::atom(AtomId(atoms[i] + v / values)),
                                  Literal::atom(AtomId(atoms[j] + v % values))};
        builder.add_feature(builder.make_and(both), draw(pair), weight);
      }
    }
  }
  return builder.build();
}

TEST(Exact, SearchesWhatIsTooWideForElimination) {
  Solver eliminated(blocks(3, 5, 9, 12.0, 0.8)), searched(blocks(3, 5, 9, 12.0, 0.8));
  searched.options().max_table_log2 = 8;  // 9^5 is 2^16
  ASSERT_FALSE(searched.cost(ComponentId(0)).feasible);
  const MethodResult expected = eliminated.marginals(), result = searched.marginals();
  ASSERT_EQ(expected.termination, Termination::kCompleted);
  ASSERT_EQ(result.termination, Termination::kCompleted) << result.message;
  EXPECT_NEAR(*result.log_partition, *expected.log_partition, 1e-9);
  EXPECT_NE(*result.log_partition, *expected.log_partition);  // summed in another way
  for (std::size_t q = 0; q < expected.marginals.size(); ++q) {
    EXPECT_NEAR(result.marginals[q].probability, expected.marginals[q].probability, 1e-9);
  }
  EXPECT_EQ(searched.map().termination, Termination::kTooWide);
}

TEST(Exact, SearchIsCheapWhereMassIsConcentrated) {
  Monitor monitor;
  const StopCondition stop(monitor);
  InferenceOptions options;
  options.max_table_log2 = 10;
  EXPECT_TRUE(search_is_cheap(blocks(1, 5, 9, 12.0, 0.8), ComponentId(0), options, {}, stop));
  EXPECT_FALSE(search_is_cheap(clique_and_atom(60), ComponentId(0), options, {}, stop));
}

TEST(Exact, KeepsTheTableLimit) {
  Solver solver(clique_and_atom(10));
  EXPECT_EQ(solver.map().termination, Termination::kCompleted);
  solver.options().max_table_log2 = 9;
  EXPECT_EQ(solver.map().termination, Termination::kTooWide);
}

TEST(Exact, KeepsALimitOnAllTablesTogether) {
  // Two hundred cliques of 10 along a chain: the largest table fits, 200 of them do not.
  Pairwise model;
  for (std::size_t clique = 0; clique < 200; ++clique) {
    for (std::size_t i = 0; i < 10; ++i) {
      model.unary.push_back(0.1);
      for (std::size_t j = 0; j < i; ++j) model.edges.push_back({clique * 10 + i, clique * 10 + j, 0.2});
    }
    if (clique > 0) model.edges.push_back({clique * 10 - 1, clique * 10, 0.3});
  }
  Solver solver(pairwise_network(model));
  EXPECT_EQ(solver.marginals().termination, Termination::kCompleted);
  solver.options().max_table_log2 = 10;
  const MethodResult result = solver.marginals();
  EXPECT_EQ(result.termination, Termination::kTooWide);
  EXPECT_NE(result.message.find("entries together (limit 2^15)"), std::string::npos) << result.message;
}

TEST(Exact, KeepsTheMemoryLimit) {
  Solver solver(clique_and_atom(20));
  solver.options().max_memory = 1'000'000;
  const MethodResult result = solver.marginals();
  EXPECT_EQ(result.termination, Termination::kMemoryLimit);
  EXPECT_NE(result.message.find("component 1 (20 variables)"), std::string::npos) << result.message;
  EXPECT_FALSE(std::isnan(result.marginals[1].probability));
}

TEST(Exact, GivesUpQuicklyOnAHopelessComponent) {
  // 3,000 booleans, 40,000 random pairs: no order is of any use.
  Rng rng(7, 0);
  Pairwise model;
  model.unary.assign(3000, 0.1);
  for (int i = 0; i < 40000; ++i) {
    const std::size_t a = rng.below(3000), b = rng.below(3000);
    if (a != b) model.edges.push_back({a, b, 0.5});
  }
  Solver solver(pairwise_network(model));
  const MethodResult result = solver.marginals();
  EXPECT_EQ(result.termination, Termination::kTooWide);
  EXPECT_NE(result.message.find("(3,000 variables)"), std::string::npos) << result.message;
  EXPECT_NE(result.message.find("at least 2^"), std::string::npos) << result.message;
}

TEST(Exact, NamesConstraintsThatContradictEachOther) {
  // a v b, a v !b, !a v c, !a v !c: impossible, all four are needed, and propagation alone does not see it. One more
  // is not.
  NetworkBuilder builder;
  const Literal a = first(builder, builder.add_boolean());
  const Literal b = first(builder, builder.add_boolean());
  const Literal c = first(builder, builder.add_boolean());
  const std::vector<std::vector<Literal>> clauses{{b, c}, {a, b}, {a, ~b}, {~a, c}, {~a, ~c}};
  for (std::size_t i = 0; i < clauses.size(); ++i) {
    std::vector<Literal> inputs = clauses[i];
    builder.add_constraint(builder.make_or(inputs), FormulaId(i));
  }
  query(builder, a);
  Solver solver(builder.build());
  for (const MethodResult& result : {solver.marginals(), solver.map()}) {
    EXPECT_EQ(result.termination, Termination::kNoPossibleWorld);
    EXPECT_EQ(result.conflict, (std::vector<std::uint32_t>{1, 2, 3, 4}));
  }
}

TEST(Exact, WeighsAFormulaAsAWhole) {
  // Feature 2 (a ^ b): worlds weigh 1, 1, 1, e^2. Query of the formula itself too.
  NetworkBuilder builder;
  const WeightId weight = builder.add_weight({});
  const Literal a = first(builder, builder.add_boolean());
  const Literal b = first(builder, builder.add_boolean());
  std::vector<Literal> both{a, b};
  const Literal formula = builder.make_and(both);
  builder.add_feature(formula, 2.0, weight);
  query(builder, a);
  builder.add_query({formula, true, "a ^ b"});
  Solver solver(builder.build());
  const MethodResult result = solver.marginals();
  const double e2 = std::exp(2.0);
  EXPECT_NEAR(*result.log_partition + solver.network().constant_score(), std::log(3.0 + e2), 1e-12);
  EXPECT_NEAR(result.marginals[0].probability, (1.0 + e2) / (3.0 + e2), 1e-12);
  EXPECT_NEAR(result.marginals[1].probability, e2 / (3.0 + e2), 1e-12);
  const MethodResult best = solver.map();
  EXPECT_NEAR(best.map_score + solver.network().constant_score(), 2.0, 1e-12);
  EXPECT_EQ(best.values, (std::vector<std::uint32_t>{0, 0}));
}

}  // namespace
}  // namespace sherlog
