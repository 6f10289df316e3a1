// The slow twin of learning: likelihoods from their definitions, by going through worlds and counting ground formulas.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "learning/training_set.h"

namespace sherlog::oracle {

// A complete world: for each predicate the truth of all its atoms, arguments read as mixed-radix numbers.
using CompleteWorld = std::vector<std::vector<bool>>;

class NaiveLearning {
 public:
  NaiveLearning(const TrainingSet& set, std::size_t database);

  // True groundings of each weight's formula.
  std::vector<double> counts(const CompleteWorld& world) const;
  bool meets_hard_formulas(const CompleteWorld& world) const;
  const CompleteWorld& observed() const { return observed_; }

  // Sum over groups of variables of log P(values as observed | the rest as observed). A group is a list of variables.
  double pseudo_likelihood(const std::vector<double>& weights,
                           const std::vector<std::vector<std::size_t>>& groups) const;
  // log P(all variables of these predicates | the rest).
  double likelihood(const std::vector<double>& weights, const std::vector<bool>& predicates) const;

  // Variables (blocks and single atoms), numbered; those of a predicate.
  std::vector<std::size_t> variables_of(PredicateId predicate) const;
  std::string key(std::size_t variable) const;  // its unmarked arguments

 private:
  struct Variable {
    PredicateId predicate;
    std::vector<std::size_t> atoms;  // addresses
    bool none = true;                // all of them may be false
    std::string key;
  };
  bool holds(const FormulaNode& node, const Formula& formula, std::vector<ConstantIndex>& values,
             const CompleteWorld& world) const;
  std::size_t address(PredicateId predicate, const std::vector<ConstantIndex>& arguments) const;
  std::size_t domain_size(DomainId domain) const;
  // Sum over the joint values of the variables of exp(w . n), and the term of the observed ones; logarithms.
  double log_share(const std::vector<double>& weights, const std::vector<std::size_t>& variables) const;
  template <class Visit>
  void each_binding(const Formula& formula, const Visit& visit) const;

  const TrainingSet& set_;
  const Evidence& evidence_;
  CompleteWorld observed_;
  std::vector<Variable> variables_;
};

}  // namespace sherlog::oracle
