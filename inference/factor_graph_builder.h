// What a factor graph is put together from: tables, which are joined where they are over the same variables, and tests, which
// become auxiliary variables where one variable's values do not tell them.
//
// Idea      See factor_graph.h. Equal tests share one auxiliary variable.
#pragma once

#include <cmath>
#include <cstdint>
#include <limits>
#include <unordered_map>
#include <utility>
#include <vector>

#include "inference/factor_graph.h"

namespace sherlog {

struct WordsHash {
  std::size_t operator()(const std::vector<std::uint32_t>& words) const;
};

class FactorGraphBuilder {
 public:
  static constexpr std::uint32_t kNone = 0xffffffffu;

  FactorGraph graph;

  // `key`: where in the network it stands; an auxiliary one stands with the last of its inputs.
  std::uint32_t add_variable(std::uint32_t values, std::uint32_t key);
  std::uint32_t key(std::uint32_t variable) const { return key_[variable]; }
  // Orders the variables as FactorGraph::sweep says: once, when all tables are there.
  void make_sweep();

  // --- tables
  // A value is added to the score, or, for a feature to be recorded, 1 says where it is true.

  void add_constant(double value, std::uint32_t recorded);
  void add_unary(const ValueTest& test, double when_true, double when_false, std::uint32_t recorded = kNone);
  // value(truth of a, truth of b), symmetric.
  template <class Value>
  void add_binary(ValueTest a, ValueTest b, Value value, std::uint32_t recorded = kNone);
  // Adds the table to the one over the same variables. The scope may come in any order.
  void add_table(const std::vector<std::uint32_t>& scope, const std::vector<double>& table,
                 std::uint32_t recorded = kNone);
  // The number of the table over these variables, which are sorted; a new one is zero.
  std::uint32_t table_over(const std::vector<std::uint32_t>& sorted, std::size_t size);
  void add_feature(FactorGraph::OpenFeature&& open);

  // --- tests

  enum class Operation : std::uint32_t { kOr, kIff, kIndicator };

  static ValueTest negation(ValueTest test);
  // A test without constants in disguise.
  static ValueTest simplified(ValueTest test);
  // A new variable of two values, true and false, that tables are to determine.
  ValueTest auxiliary(std::uint32_t key);
  // The auxiliary variable that tells whether the test holds.
  ValueTest indicator(const ValueTest& test);
  // a v b, or a <=> b, as a test of one variable.
  ValueTest combined(ValueTest a, ValueTest b, Operation operation);
  // The OR of the tests (of different variables, sorted), link by link; with `at_most_one` two of them exclude each
  // other.
  ValueTest chain(const std::vector<ValueTest>& tests, bool at_most_one);
  // "At most one of these holds" as a truth that may be false too.
  ValueTest at_most_one_test(std::vector<ValueTest> tests);

 private:
  static constexpr std::uint64_t kLargePair = 64;  // two tests whose variables are larger get an indicator each

  static bool large_pair(const ValueTest& a, const ValueTest& b) {
    return a.accepted.size() * b.accepted.size() > kLargePair;
  }
  std::size_t index_in(const std::vector<std::uint32_t>& sorted, const std::vector<std::uint32_t>& scope,
                       std::size_t i) const;

  std::vector<std::uint32_t> key_;  // by variable
  std::unordered_map<std::vector<std::uint32_t>, std::uint32_t, WordsHash> table_of_;
  std::unordered_map<std::vector<std::uint32_t>, ValueTest, WordsHash> made_;
};

template <class Value>
void FactorGraphBuilder::add_binary(ValueTest a, ValueTest b, Value value, std::uint32_t recorded) {
  if (a.is_constant()) std::swap(a, b);  // the values asked for are symmetric
  if (b.is_constant()) {
    add_unary(a, value(true, b.value()), value(false, b.value()), recorded);
    return;
  }
  if (a.variable == b.variable) {
    std::vector<double> table;
    for (std::size_t k = 0; k < a.accepted.size(); ++k) table.push_back(value(a.accepted[k] != 0, b.accepted[k] != 0));
    add_table({a.variable}, table, recorded);
    return;
  }
  if (large_pair(a, b)) {
    a = indicator(a);
    b = indicator(b);
  }
  std::vector<double> table;
  for (const std::uint8_t x : a.accepted) {
    for (const std::uint8_t y : b.accepted) table.push_back(value(x != 0, y != 0));
  }
  add_table({a.variable, b.variable}, table, recorded);
}

}  // namespace sherlog
