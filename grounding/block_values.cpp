#include "grounding/block_values.h"

#include <algorithm>
#include <optional>

namespace sherlog {
namespace {

bool mentions(const NormalNode& node, std::uint32_t variable) {
  return std::ranges::binary_search(node.free, variable);
}

// The constant of `variable = constant`.
std::optional<Term> excepted_value(const NormalNode& node, std::uint32_t variable) {
  if (node.shape != NodeShape::kEqual || node.negated) return std::nullopt;
  const Term self = Term::variable(variable);
  if (node.left == self && !node.right.is_variable) return node.right;
  if (node.right == self && !node.left.is_variable) return node.left;
  return std::nullopt;
}

// Where the variable is the value of a '!' block that the disjunct denies.
std::optional<std::size_t> value_position(const NormalNode& node, std::uint32_t variable, const Model& model) {
  if (node.shape != NodeShape::kAtom || !node.negated) return std::nullopt;
  const Predicate& predicate = model.predicate(PredicateId(node.atom.predicate));
  if (predicate.block != BlockKind::kExactlyOne || std::ranges::count(predicate.marked, true) != 1) return std::nullopt;
  const auto position = static_cast<std::size_t>(std::ranges::find(predicate.marked, true) - predicate.marked.begin());
  const Term self = Term::variable(variable);
  if (node.atom.terms[position] != self || std::ranges::count(node.atom.terms, self) != 1) return std::nullopt;
  return position;
}

bool say_by_block(NormalNode& disjunction, std::uint32_t variable, const Model& model, const AtomTable& atoms) {
  const NormalNode* denied = nullptr;
  std::size_t position = 0;
  std::vector<Term> excepted;
  for (const NormalNode& child : disjunction.children) {
    if (!mentions(child, variable)) continue;
    if (const auto value = excepted_value(child, variable)) {
      if (std::ranges::find(excepted, *value) == excepted.end()) excepted.push_back(*value);
      continue;
    }
    const auto at = value_position(child, variable, model);
    if (!at || denied != nullptr) return false;
    denied = &child;
    position = *at;
  }
  if (denied == nullptr || excepted.empty()) return false;
  std::vector<NormalNode> children;
  for (const Term& value : excepted) {
    std::vector<Term> terms = denied->atom.terms;
    terms[position] = value;
    children.push_back(atom_node(atoms.pattern(PredicateId(denied->atom.predicate), std::move(terms)), false));
  }
  for (NormalNode& child : disjunction.children) {
    if (!mentions(child, variable)) children.push_back(std::move(child));
  }
  disjunction = any_of(std::move(children));
  return true;
}

}  // namespace

std::vector<std::uint32_t> say_by_blocks(NormalNode& disjunction, const Formula& formula, const Model& model,
                                         const AtomTable& atoms) {
  std::vector<std::uint32_t> gone;
  if (!formula.unique.empty()) return gone;  // its variables are bound together
  const std::vector<std::uint32_t> free = disjunction.free;
  for (const std::uint32_t variable : free) {
    if (disjunction.shape != NodeShape::kOr) break;
    if (say_by_block(disjunction, variable, model, atoms)) gone.push_back(variable);
  }
  return gone;
}

}  // namespace sherlog
