#include "grounding/normal_form.h"

#include <algorithm>
#include <charconv>
#include <limits>

namespace sherlog {
namespace {

NormalNode constant(bool value) {
  NormalNode node;
  node.shape = value ? NodeShape::kTrue : NodeShape::kFalse;
  return node;
}

// Fills `free` and `quantified` from the children and terms.
NormalNode with_free_variables(NormalNode node) {
  auto& free = node.free;
  for (const Term& term : node.atom.terms) {
    if (term.is_variable) free.push_back(term.index);
  }
  if (node.is_literal() && node.shape != NodeShape::kAtom) {
    for (const Term& term : {node.left, node.right}) {
      if (term.is_variable) free.push_back(term.index);
    }
  }
  node.quantified = node.shape == NodeShape::kExists || node.shape == NodeShape::kForall;
  for (const NormalNode& child : node.children) {
    free.insert(free.end(), child.free.begin(), child.free.end());
    node.quantified = node.quantified || child.quantified;
  }
  std::erase_if(free, [&](std::uint32_t v) { return std::ranges::find(node.bound, v) != node.bound.end(); });
  std::ranges::sort(free);
  free.erase(std::unique(free.begin(), free.end()), free.end());
  return node;
}

// AND or OR of the children: nested ones are flattened, constants simplified away.
NormalNode combine(NodeShape shape, std::vector<NormalNode> children) {
  const NodeShape neutral = shape == NodeShape::kAnd ? NodeShape::kTrue : NodeShape::kFalse;
  const NodeShape dominant = shape == NodeShape::kAnd ? NodeShape::kFalse : NodeShape::kTrue;
  NormalNode node;
  node.shape = shape;
  for (NormalNode& child : children) {
    if (child.shape == dominant) return constant(dominant == NodeShape::kTrue);
    if (child.shape == neutral) continue;
    if (child.shape == shape) {
      std::ranges::move(child.children, std::back_inserter(node.children));
    } else {
      node.children.push_back(std::move(child));
    }
  }
  if (node.children.empty()) return constant(neutral == NodeShape::kTrue);
  if (node.children.size() == 1) return std::move(node.children.front());
  return with_free_variables(std::move(node));
}

class Normaliser {
 public:
  Normaliser(const Formula& formula, const AtomTable& atoms, ConstantNumbers& numbers)
      : formula_(formula), atoms_(atoms), numbers_(numbers) {}

  NormalNode normalise(const FormulaNode& node, bool negated) {
    switch (node.kind) {
      case NodeKind::kAtom:
        return atom(node, negated);
      case NodeKind::kEqual:
        return comparison(NodeShape::kEqual, node, negated);
      case NodeKind::kLess:
        return comparison(NodeShape::kLess, node, negated);
      case NodeKind::kLessEqual:
        return comparison(NodeShape::kLessEqual, node, negated);
      case NodeKind::kNot:
        return normalise(node.children[0], !negated);
      case NodeKind::kAnd:
      case NodeKind::kOr: {
        std::vector<NormalNode> children;
        for (const FormulaNode& child : node.children) children.push_back(normalise(child, negated));
        return combine((node.kind == NodeKind::kAnd) != negated ? NodeShape::kAnd : NodeShape::kOr,
                       std::move(children));
      }
      case NodeKind::kImplies: {
        std::vector<NormalNode> children;
        children.push_back(normalise(node.children[0], !negated));
        children.push_back(normalise(node.children[1], negated));
        return combine(negated ? NodeShape::kAnd : NodeShape::kOr, std::move(children));
      }
      case NodeKind::kIff:
        return equivalence(node, negated);
      case NodeKind::kExists:
      case NodeKind::kForall:
        return quantify((node.kind == NodeKind::kExists) != negated ? NodeShape::kExists : NodeShape::kForall,
                        node.bound, normalise(node.children[0], negated));
    }
    return constant(true);
  }

  NormalNode disjunction(const FormulaNode& left, bool left_negated, const FormulaNode& right, bool right_negated) {
    std::vector<NormalNode> children;
    children.push_back(normalise(left, left_negated));
    children.push_back(normalise(right, right_negated));
    return combine(NodeShape::kOr, std::move(children));
  }

 private:
  NormalNode atom(const FormulaNode& node, bool negated) {
    return atom_node(atoms_.pattern(node.predicate, node.terms), negated);
  }

  NormalNode comparison(NodeShape shape, const FormulaNode& node, bool negated) {
    NormalNode result;
    result.shape = shape;
    result.negated = negated;
    result.left = node.terms[0];
    result.right = node.terms[1];
    if (shape != NodeShape::kEqual) result.numbers = numbers_.of(node.domain);
    return with_free_variables(std::move(result));
  }

  NormalNode equivalence(const FormulaNode& node, bool negated) {
    NormalNode left = normalise(node.children[0], false);
    const bool left_is_constant = left.shape == NodeShape::kTrue || left.shape == NodeShape::kFalse;
    if (left_is_constant) return normalise(node.children[1], negated != (left.shape == NodeShape::kFalse));
    NormalNode right = normalise(node.children[1], false);
    const bool right_is_constant = right.shape == NodeShape::kTrue || right.shape == NodeShape::kFalse;
    if (right_is_constant) return normalise(node.children[0], negated != (right.shape == NodeShape::kFalse));
    NormalNode result;
    result.shape = NodeShape::kIff;
    result.negated = negated;
    result.children.push_back(std::move(left));
    result.children.push_back(std::move(right));
    return with_free_variables(std::move(result));
  }

  bool is_empty(std::uint32_t variable) const { return atoms_.domain_size(formula_.variables[variable].domain) == 0; }

  NormalNode quantify(NodeShape shape, std::vector<std::uint32_t> bound, NormalNode child) {
    if (child.shape == shape) {  // EXIST x EXIST y
      bound.insert(bound.end(), child.bound.begin(), child.bound.end());
      NormalNode inner = std::move(child.children.front());
      child = std::move(inner);
    }
    if (std::ranges::any_of(bound, [&](std::uint32_t v) { return is_empty(v); }))
      return constant(shape == NodeShape::kForall);
    if (child.shape == (shape == NodeShape::kExists ? NodeShape::kOr : NodeShape::kAnd)) {
      std::vector<NormalNode> parts;
      for (NormalNode& part : child.children) parts.push_back(quantify(shape, bound, std::move(part)));
      return combine(child.shape, std::move(parts));
    }
    std::erase_if(bound, [&](std::uint32_t v) { return !std::ranges::binary_search(child.free, v); });
    if (bound.empty()) return child;
    NormalNode result;
    result.shape = shape;
    result.bound = std::move(bound);
    result.children.push_back(std::move(child));
    return with_free_variables(std::move(result));
  }

  const Formula& formula_;
  const AtomTable& atoms_;
  ConstantNumbers& numbers_;
};

}  // namespace

const std::vector<double>* ConstantNumbers::of(DomainId domain) {
  const auto [entry, is_new] = numbers_.try_emplace(domain);
  if (is_new) {
    for (ConstantIndex c = 0; c < evidence_.domain_size(model_, domain); ++c) {
      const std::string& name = evidence_.constant_name(model_, domain, c);
      double value = 0;
      const auto [end, error] = std::from_chars(name.data(), name.data() + name.size(), value);
      const bool is_number = error == std::errc() && end == name.data() + name.size();
      entry->second.push_back(is_number ? value : std::numeric_limits<double>::quiet_NaN());
    }
  }
  return &entry->second;
}

NormalNode normal_form(const Formula& formula, const AtomTable& atoms, ConstantNumbers& numbers) {
  return Normaliser(formula, atoms, numbers).normalise(formula.root, false);
}

std::optional<std::pair<NormalNode, NormalNode>> implications(const Formula& formula, const AtomTable& atoms,
                                                              ConstantNumbers& numbers) {
  const FormulaNode* root = &formula.root;
  bool negated = false;
  for (; root->kind == NodeKind::kNot; root = &root->children[0]) negated = !negated;
  if (root->kind != NodeKind::kIff) return {};
  // !(A <=> B) is A <=> !B.
  Normaliser normaliser(formula, atoms, numbers);
  NormalNode there = normaliser.disjunction(root->children[0], true, root->children[1], negated);
  NormalNode back = normaliser.disjunction(root->children[0], false, root->children[1], !negated);
  if (there.shape != NodeShape::kOr || back.shape != NodeShape::kOr) return {};
  return std::pair(std::move(there), std::move(back));
}

NormalNode atom_node(AtomPattern atom, bool negated) {
  NormalNode node;
  node.shape = NodeShape::kAtom;
  node.negated = negated;
  node.atom = std::move(atom);
  return with_free_variables(std::move(node));
}

NormalNode any_of(std::vector<NormalNode> children) { return combine(NodeShape::kOr, std::move(children)); }

NormalNode earlier(std::uint32_t left, std::uint32_t right) {
  NormalNode node;
  node.shape = NodeShape::kEarlier;
  node.left = Term::variable(left);
  node.right = Term::variable(right);
  return with_free_variables(std::move(node));
}

}  // namespace sherlog
