#include "inference/factor_graph_builder.h"

#include <algorithm>
#include <numeric>
#include <tuple>

namespace sherlog {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

std::vector<std::uint32_t> signature(const ValueTest& a, const ValueTest& b, FactorGraphBuilder::Operation operation) {
  std::vector<std::uint32_t> words{static_cast<std::uint32_t>(operation), a.variable, b.variable};
  for (const ValueTest* test : {&a, &b}) {
    std::uint32_t word = 1, count = 0;
    for (const std::uint8_t accepted : test->accepted) {
      word = word << 1 | accepted;
      if (++count % 30 == 0) {
        words.push_back(word);
        word = 1;
      }
    }
    words.push_back(word);
  }
  return words;
}

}  // namespace

std::size_t WordsHash::operator()(const std::vector<std::uint32_t>& words) const {
  std::uint64_t h = 0x9e3779b97f4a7c15u + words.size();
  for (const std::uint32_t w : words) {
    h ^= w;
    h *= 0xff51afd7ed558ccdu;
    h ^= h >> 32;
  }
  return h;
}

// A variable can go once the last table it shares with earlier ones has been met.
void FactorGraphBuilder::make_sweep() {
  std::vector<std::uint32_t> last = key_;
  for (const auto& scope : graph.scopes) {
    std::uint32_t met = 0;
    for (const std::uint32_t v : scope) met = std::max(met, key_[v]);
    for (const std::uint32_t v : scope) last[v] = std::max(last[v], met);
  }
  graph.sweep.resize(key_.size());
  std::iota(graph.sweep.begin(), graph.sweep.end(), 0u);
  std::sort(graph.sweep.begin(), graph.sweep.end(), [&](std::uint32_t a, std::uint32_t b) {
    return std::tie(last[a], key_[a], a) < std::tie(last[b], key_[b], b);
  });
}

ValueTest FactorGraphBuilder::negation(ValueTest test) {
  for (auto& accepted : test.accepted) accepted ^= 1;
  return test;
}

ValueTest FactorGraphBuilder::simplified(ValueTest test) {
  if (test.is_constant()) return test;
  const auto ones = std::count(test.accepted.begin(), test.accepted.end(), std::uint8_t{1});
  if (ones == 0) return ValueTest::constant(false);
  if (ones == static_cast<std::ptrdiff_t>(test.accepted.size())) return ValueTest::constant(true);
  return test;
}

std::uint32_t FactorGraphBuilder::add_variable(std::uint32_t values, std::uint32_t key) {
  const auto variable = static_cast<std::uint32_t>(graph.cardinalities.size());
  graph.cardinalities.push_back(values);
  key_.push_back(key);
  return variable;
}

ValueTest FactorGraphBuilder::auxiliary(std::uint32_t key) { return {add_variable(2, key), {0, 1}}; }

ValueTest FactorGraphBuilder::indicator(const ValueTest& test) {
  if (test.is_constant() || test.accepted.size() == 2) return test;
  auto [it, fresh] = made_.emplace(signature(test, ValueTest::constant(true), Operation::kIndicator), ValueTest{});
  if (!fresh) return it->second;
  ValueTest aux = auxiliary(key_[test.variable]);
  it->second = aux;
  std::vector<double> table;
  for (const std::uint8_t accepted : test.accepted) {
    table.push_back(accepted != 0 ? -kInfinity : 0.0);
    table.push_back(accepted != 0 ? 0.0 : -kInfinity);
  }
  add_table({test.variable, aux.variable}, table);
  return aux;
}

ValueTest FactorGraphBuilder::combined(ValueTest a, ValueTest b, Operation operation) {
  if (a.is_constant()) std::swap(a, b);
  if (b.is_constant()) {
    if (operation == Operation::kOr) return b.value() ? b : a;
    return b.value() ? a : negation(a);
  }
  if (a.variable == b.variable) {
    for (std::size_t k = 0; k < a.accepted.size(); ++k) {
      const bool truth =
          operation == Operation::kOr ? (a.accepted[k] | b.accepted[k]) != 0 : a.accepted[k] == b.accepted[k];
      a.accepted[k] = truth ? 1 : 0;
    }
    return simplified(a);
  }
  if (large_pair(a, b)) {
    a = indicator(a);
    b = indicator(b);
  }
  auto [it, fresh] = made_.emplace(signature(a, b, operation), ValueTest{});
  if (!fresh) return it->second;
  ValueTest aux = auxiliary(std::max(key_[a.variable], key_[b.variable]));
  it->second = aux;
  std::vector<double> table;
  for (const std::uint8_t x : a.accepted) {
    for (const std::uint8_t y : b.accepted) {
      const bool truth = operation == Operation::kOr ? (x | y) != 0 : x == y;
      table.push_back(truth ? -kInfinity : 0.0);
      table.push_back(truth ? 0.0 : -kInfinity);
    }
  }
  add_table({a.variable, b.variable, aux.variable}, table);
  return aux;
}

ValueTest FactorGraphBuilder::chain(const std::vector<ValueTest>& tests, bool at_most_one) {
  // The state along a long chain is a bit from its first link on, not that link's whole variable.
  ValueTest any = tests.size() > 2 ? indicator(tests[0]) : tests[0];
  for (std::size_t i = 1; i < tests.size(); ++i) {
    if (at_most_one) {
      add_binary(any, tests[i], [](bool a, bool b) { return a && b ? -kInfinity : 0.0; });
    }
    any = combined(any, tests[i], Operation::kOr);
  }
  return any;
}

// "At most one of these holds" as a truth that may be false too: a second chain knows whether two did.
ValueTest FactorGraphBuilder::at_most_one_test(std::vector<ValueTest> tests) {
  const auto key = [&](const ValueTest& test) { return test.is_constant() ? 0 : key_[test.variable]; };
  std::stable_sort(tests.begin(), tests.end(), [&](const ValueTest& a, const ValueTest& b) { return key(a) < key(b); });
  ValueTest any = ValueTest::constant(false), two = ValueTest::constant(false);
  for (const ValueTest& test : tests) {
    two = combined(two, negation(combined(negation(any), negation(test), Operation::kOr)), Operation::kOr);
    any = combined(any, test, Operation::kOr);
  }
  return negation(two);
}

void FactorGraphBuilder::add_constant(double value, std::uint32_t recorded) {
  if (recorded == kNone) {
    graph.constant += value;
  } else if (value != 0.0) {
    graph.true_features.push_back(recorded);
  }
}

void FactorGraphBuilder::add_unary(const ValueTest& test, double when_true, double when_false, std::uint32_t recorded) {
  if (test.is_constant()) {
    add_constant(test.value() ? when_true : when_false, recorded);
    return;
  }
  std::vector<double> table;
  for (const std::uint8_t accepted : test.accepted) table.push_back(accepted != 0 ? when_true : when_false);
  add_table({test.variable}, table, recorded);
}

void FactorGraphBuilder::add_table(const std::vector<std::uint32_t>& scope, const std::vector<double>& table,
                                   std::uint32_t recorded) {
  std::vector<std::uint32_t> sorted = scope;
  std::sort(sorted.begin(), sorted.end());
  const std::uint32_t number = table_over(sorted, table.size());
  std::vector<double>& target = graph.tables[number];
  const auto true_entries =
      static_cast<std::size_t>(std::count_if(table.begin(), table.end(), [](double x) { return x != 0.0; }));
  const bool negated = 2 * true_entries > table.size();
  FactorGraph::OpenFeature open{recorded, number, negated, {}};
  const bool in_order = sorted == scope;
  for (std::size_t i = 0; i < table.size(); ++i) {
    const std::size_t index = in_order ? i : index_in(sorted, scope, i);
    if (recorded == kNone) {
      target[index] += table[i];
    } else if ((table[i] != 0.0) != negated) {
      open.entries.push_back(static_cast<std::uint32_t>(index));
    }
  }
  if (recorded == kNone) return;
  std::sort(open.entries.begin(), open.entries.end());
  add_feature(std::move(open));
}

std::uint32_t FactorGraphBuilder::table_over(const std::vector<std::uint32_t>& sorted, std::size_t size) {
  const auto [it, fresh] = table_of_.emplace(sorted, static_cast<std::uint32_t>(graph.tables.size()));
  if (fresh) {
    graph.scopes.push_back(sorted);
    graph.tables.emplace_back(size, 0.0);
    graph.table_bytes += size * sizeof(double) + 200;
  }
  return it->second;
}

void FactorGraphBuilder::add_feature(FactorGraph::OpenFeature&& open) {
  graph.table_bytes += open.entries.size() * sizeof(std::uint32_t) + sizeof(open);
  graph.features.push_back(std::move(open));
}

// Where entry `i` of a table over `scope` stands in the one over the same variables sorted.
std::size_t FactorGraphBuilder::index_in(const std::vector<std::uint32_t>& sorted,
                                         const std::vector<std::uint32_t>& scope, std::size_t i) const {
  std::size_t index = 0;
  for (std::size_t d = scope.size(); d-- > 0;) {
    const std::size_t value = i % graph.cardinalities[scope[d]];
    i /= graph.cardinalities[scope[d]];
    std::size_t stride = 1;
    for (std::size_t e = sorted.size(); sorted[e - 1] != scope[d]; --e) stride *= graph.cardinalities[sorted[e - 1]];
    index += value * stride;
  }
  return index;
}

}  // namespace sherlog
