// Random products of tables, for whatever sums and maximises over them.
#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>
#include <vector>

#include "inference/elimination.h"
#include "inference/rng.h"

namespace sherlog {

struct RandomTables {
  std::uint32_t variables = 8;   // at most
  std::uint32_t values = 4;      // of each, at most
  std::uint32_t tables = 0;      // at most; 0: three for each variable
  double spread = 1.0;           // entries lie between -spread and spread
  std::uint32_t impossible = 6;  // one entry in so many is; 0: none
};

struct Tables {
  std::vector<std::uint32_t> cardinalities;
  std::vector<std::vector<std::uint32_t>>
      scopes;  // one to three variables in any order; the same ones now and then twice
  LogTables tables;
};

inline Tables random_tables(std::uint64_t seed, const RandomTables& wanted) {
  Rng rng(seed, 0);
  Tables c;
  const std::uint32_t n = 1 + rng.below(wanted.variables);
  for (std::uint32_t v = 0; v < n; ++v) c.cardinalities.push_back(1 + rng.below(wanted.values));
  const std::uint32_t count = 1 + rng.below(wanted.tables > 0 ? wanted.tables : 3 * n);
  for (std::uint32_t t = 0; t < count; ++t) {
    std::vector<std::uint32_t> scope;
    const std::uint32_t size = 1 + rng.below(std::min(n, 3u));
    while (scope.size() < size) {
      const std::uint32_t v = rng.below(n);
      if (std::ranges::find(scope, v) == scope.end()) scope.push_back(v);
    }
    std::size_t entries = 1;
    for (const std::uint32_t v : scope) entries *= c.cardinalities[v];
    std::vector<double> table;
    for (std::size_t i = 0; i < entries; ++i) {
      const bool zero = wanted.impossible > 0 && rng.below(wanted.impossible) == 0;
      table.push_back(zero ? -std::numeric_limits<double>::infinity() : wanted.spread * (2.0 * rng.uniform() - 1.0));
    }
    c.scopes.push_back(scope);
    c.tables.push_back(table);
  }
  return c;
}

}  // namespace sherlog
