// The weights of a model: one for each soft formula after expansion of its templates, in model order.
//
// Requires  Every + domain has all its constants in the model (mln/shared_domains.h).
// Errors    More weights than `limit`: size() is 0 and problem() says which formula has how many.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "grounding/network.h"
#include "grounding/tuple_table.h"
#include "mln/model.h"

namespace sherlog {

class WeightTable {
 public:
  static constexpr double kLimit = 5e7;

  explicit WeightTable(const Model& model, double limit = kLimit);

  std::size_t size() const { return formula_of_.size(); }
  const std::string& problem() const { return problem_; }
  FormulaId formula(std::size_t weight) const { return FormulaId(formula_of_[weight]); }
  // In the order of the formula's + variables.
  std::span<const ConstantIndex> plus_constants(std::size_t weight) const {
    const Instances& instances = instances_[formula_of_[weight]];
    return instances.table.tuple(static_cast<std::uint32_t>(weight - instances.first));
  }
  // The number of a network's weight, or size() where the table has none such.
  std::size_t find(const WeightedInstance& instance) const;

 private:
  struct Instances {
    std::size_t first = 0;
    TupleTable table;
  };
  void list(const Formula& formula, const std::vector<std::uint32_t>& plus, const Model& model, Instances& instances);

  std::vector<Instances> instances_;       // by formula
  std::vector<std::uint32_t> formula_of_;  // by weight
  std::string problem_;
};

}  // namespace sherlog
