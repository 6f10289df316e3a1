// A formula of first-order logic with everything resolved: predicates, domains, variables and constants are numbers.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "mln/diagnostics.h"
#include "mln/ids.h"

namespace sherlog {

// A variable of the enclosing Formula (index into Formula::variables), or a constant of the argument's domain.
struct Term {
  bool is_variable = false;
  std::uint32_t index = 0;

  static Term variable(std::uint32_t i) { return {true, i}; }
  static Term constant(ConstantIndex c) { return {false, c}; }
  bool operator==(const Term&) const = default;
};

enum class NodeKind : std::uint8_t {
  kAtom,
  kEqual,
  kLess,
  kLessEqual,
  kNot,
  kAnd,
  kOr,
  kImplies,
  kIff,
  kExists,
  kForall
};

// != is kNot of kEqual; > and >= are kLess and kLessEqual with the sides exchanged.
struct FormulaNode {
  NodeKind kind = NodeKind::kAtom;
  PredicateId predicate;              // kAtom
  DomainId domain;                    // kEqual, kLess, kLessEqual: the domain that both sides share
  std::vector<Term> terms;            // kAtom: arguments; kEqual, kLess, kLessEqual: two sides
  std::vector<std::uint32_t> bound;   // kExists, kForall: variables (indices into Formula::variables)
  std::vector<FormulaNode> children;  // kNot, kExists, kForall: 1; kImplies, kIff: 2; kAnd, kOr: 2 or more
  Place place;
};

struct FormulaVariable {
  std::string name;  // without ? and +
  DomainId domain;
  bool quantified = false;  // bound by a quantifier inside; every other is universally quantified on the outside
  bool plus = false;        // +x: one weight for each constant
};

struct Formula {
  FormulaNode root;
  std::vector<FormulaVariable> variables;  // each quantifier has variables of its own, also where names are reused
  double weight = 0.0;                     // nats; without meaning where hard
  bool hard = false;
  bool fixed = false;                              // not learned
  bool has_weight = true;                          // false: no weight was written, 0 is assumed in inference
  std::vector<std::vector<std::uint32_t>> unique;  // groups of variables whose constants are an unordered combination
  std::string text;                                // as the printer writes it, without weight and '.'
  Place place;
};

}  // namespace sherlog
