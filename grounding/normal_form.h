// Formulas made ready for grounding: negations at the leaves, quantifiers pushed inwards, atoms with their addresses.
//
// Idea      Implications become disjunctions, nested ORs and ANDs are flattened, so that `A => (B <=> C)` is one
//           disjunction with an equivalence in it. EXIST over a disjunction is a disjunction of EXISTs (and FORALL over
//           a conjunction a conjunction), each with only the variables that it uses: what is left under a quantifier is
//           a conjunctive query, the shape that joins can answer. The formula is rewritten, never split: it keeps one
//           weight.
#pragma once

#include <optional>
#include <utility>
#include <vector>

#include "grounding/atom_table.h"
#include "mln/formula.h"

namespace sherlog {

enum class NodeShape : std::uint8_t {
  kTrue,
  kFalse,
  kAtom,
  kEqual,
  kLess,  // by the numbers that the constants spell
  kLessEqual,
  kEarlier,  // by position in the domain: the order of #unique; stands beside the formula, not in it
  kAnd,
  kOr,
  kIff,
  kExists,
  kForall,
};

struct NormalNode {
  NodeShape shape = NodeShape::kTrue;
  bool negated = false;                          // kAtom, kEqual, kLess, kLessEqual, kIff
  AtomPattern atom;                              // kAtom
  Term left, right;                              // kEqual, kLess, kLessEqual, kEarlier
  const std::vector<double>* numbers = nullptr;  // kLess, kLessEqual: by constant; not a number: no comparison holds
  std::vector<NormalNode> children;              // kExists, kForall: 1; kIff: 2
  std::vector<std::uint32_t> bound;              // kExists, kForall
  std::vector<std::uint32_t> free;               // variables that occur free, sorted
  bool quantified = false;                       // a quantifier occurs in it
  std::size_t plan = 0;                          // kExists, kForall: see FormulaJoin
  std::vector<Literal> scratch;

  bool is_literal() const { return shape >= NodeShape::kAtom && shape <= NodeShape::kEarlier; }
};

// The numbers that the constants of each domain spell, read when first asked for.
class ConstantNumbers {
 public:
  ConstantNumbers(const Model& model, const Evidence& evidence) : model_(model), evidence_(evidence) {}
  const std::vector<double>* of(DomainId domain);

 private:
  const Model& model_;
  const Evidence& evidence_;
  std::map<DomainId, std::vector<double>> numbers_;
};

NormalNode normal_form(const Formula& formula, const AtomTable& atoms, ConstantNumbers& numbers);
// The two implications of a formula that is an equivalence or the negation of one at the top; nothing for others, or where one of them
// is constant.
std::optional<std::pair<NormalNode, NormalNode>> implications(const Formula& formula, const AtomTable& atoms,
                                                              ConstantNumbers& numbers);
// Parts for those who rewrite a formula further.
NormalNode atom_node(AtomPattern atom, bool negated);
NormalNode any_of(std::vector<NormalNode> children);
// left comes before right in their domain.
NormalNode earlier(std::uint32_t left, std::uint32_t right);

}  // namespace sherlog
