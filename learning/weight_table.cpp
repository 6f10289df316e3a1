#include "learning/weight_table.h"

#include <fmt/format.h>

#include <algorithm>

namespace sherlog {
namespace {

std::vector<std::uint32_t> plus_variables(const Formula& formula) {
  std::vector<std::uint32_t> plus;
  for (std::uint32_t v = 0; v < formula.variables.size(); ++v) {
    if (formula.variables[v].plus) plus.push_back(v);
  }
  return plus;
}

// Of the orderings of a #unique group's constants only the ascending one has a weight.
bool in_order(const Formula& formula, const std::vector<std::uint32_t>& plus, const std::vector<ConstantIndex>& key) {
  for (const auto& group : formula.unique) {
    std::int64_t last = -1;
    for (const std::uint32_t variable : group) {
      const auto found = std::ranges::find(plus, variable);
      if (found == plus.end()) continue;
      const std::int64_t constant = key[static_cast<std::size_t>(found - plus.begin())];
      if (constant <= last) return false;
      last = constant;
    }
  }
  return true;
}

}  // namespace

WeightTable::WeightTable(const Model& model, double limit) {
  instances_.resize(model.formulas().size());
  double total = 0.0;
  for (std::size_t f = 0; f < model.formulas().size(); ++f) {
    const Formula& formula = model.formulas()[f];
    if (formula.hard) continue;
    const std::vector<std::uint32_t> plus = plus_variables(formula);
    double count = 1.0;
    for (const std::uint32_t v : plus) {
      count *= static_cast<double>(model.domain(formula.variables[v].domain).constants.size());
    }
    total += count;
    if (total > limit) {
      problem_ = fmt::format("the template '{}' ({}) has {:.3g} weights; at most {:.3g} can be learned", formula.text,
                             model.sources().describe({formula.place.file, formula.place.line, 0, 0}), count, limit);
      formula_of_.clear();
      return;
    }
    Instances& instances = instances_[f];
    instances.first = formula_of_.size();
    instances.table = TupleTable(plus.size());
    list(formula, plus, model, instances);
    formula_of_.resize(instances.first + instances.table.size(), static_cast<std::uint32_t>(f));
  }
}

void WeightTable::list(const Formula& formula, const std::vector<std::uint32_t>& plus, const Model& model,
                       Instances& instances) {
  std::vector<std::size_t> sizes;
  sizes.reserve(plus.size());
  for (const std::uint32_t v : plus) sizes.push_back(model.domain(formula.variables[v].domain).constants.size());
  if (std::ranges::find(sizes, 0u) != sizes.end()) return;
  std::vector<ConstantIndex> key(plus.size(), 0);
  while (true) {  // like an odometer: the last constant runs fastest
    if (in_order(formula, plus, key)) instances.table.insert(key);
    std::size_t digit = plus.size();
    while (digit > 0 && ++key[digit - 1] == sizes[digit - 1]) key[--digit] = 0;
    if (digit == 0) return;
  }
}

std::size_t WeightTable::find(const WeightedInstance& instance) const {
  const Instances& instances = instances_[instance.formula.index()];
  const std::uint32_t entry = instances.table.find(instance.plus_constants);
  return entry == TupleTable::kNone ? size() : instances.first + entry;
}

}  // namespace sherlog
