#include "mln/shared_domains.h"

namespace sherlog {

std::vector<bool> shared_domains(const Model& model) {
  std::vector<bool> shared(model.domains().size(), false);
  for (std::size_t d = 0; d < shared.size(); ++d) shared[d] = model.domains()[d].declared;
  for (const Predicate& predicate : model.predicates()) {
    for (std::size_t i = 0; i < predicate.arity(); ++i) {
      if (predicate.block != BlockKind::kNone && predicate.marked[i]) shared[predicate.domains[i].index()] = true;
    }
  }
  for (const Formula& formula : model.formulas()) {
    for (const FormulaVariable& variable : formula.variables) {
      if (variable.plus) shared[variable.domain.index()] = true;
    }
  }
  return shared;
}

Model with_shared_constants(const Model& model, std::span<const Evidence> databases, const std::vector<bool>& domains) {
  Model result = model;
  for (const Evidence& evidence : databases) {
    for (std::size_t d = 0; d < domains.size(); ++d) {
      if (!domains[d]) continue;
      Domain& domain = result.domains_[d];
      for (const std::string& name : evidence.added_[d]) {
        const auto next = static_cast<ConstantIndex>(domain.constants.size());
        if (domain.index.try_emplace(name, next).second) domain.constants.push_back(name);
      }
    }
  }
  return result;
}

Evidence renumbered(const Evidence& evidence, const Model& from, const Model& to) {
  Evidence result = evidence;
  std::vector<std::vector<ConstantIndex>> number(from.domains().size());
  for (std::size_t d = 0; d < number.size(); ++d) {
    const std::size_t known = from.domains()[d].constants.size();
    result.added_[d].clear();
    result.added_index_[d].clear();
    for (std::size_t c = 0; c < known; ++c) number[d].push_back(static_cast<ConstantIndex>(c));
    for (const std::string& name : evidence.added_[d]) {
      if (const auto found = to.domains()[d].find(name)) {
        number[d].push_back(*found);
        continue;
      }
      const auto next = static_cast<ConstantIndex>(to.domains()[d].constants.size() + result.added_[d].size());
      result.added_[d].push_back(name);
      result.added_index_[d].emplace(name, next);
      number[d].push_back(next);
    }
  }
  for (std::size_t p = 0; p < from.predicates().size(); ++p) {
    const Predicate& predicate = from.predicates()[p];
    std::vector<ConstantIndex>& arguments = result.predicates_[p].arguments;
    for (std::size_t i = 0; i < arguments.size(); ++i) {
      arguments[i] = number[predicate.domains[i % predicate.arity()].index()][arguments[i]];
    }
  }
  return result;
}

Evidence without(const Evidence& evidence, const std::vector<bool>& predicates) {
  Evidence result = evidence;
  for (std::size_t p = 0; p < predicates.size(); ++p) {
    if (predicates[p]) result.predicates_[p] = {};
  }
  return result;
}

}  // namespace sherlog
