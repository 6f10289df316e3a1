#include "grounding/symmetry.h"

#include <algorithm>
#include <array>

namespace sherlog {
namespace {

constexpr std::size_t kMaxVariables = 8;  // 764 ways to exchange pairs of them

using Code = std::vector<std::uint32_t>;

std::uint32_t code_of(const Term& term, const std::vector<std::uint32_t>& image) {
  return term.is_variable ? image[term.index] << 1 : term.index << 1 | 1u;
}

// The literals as numbers, variables replaced by their images; sorted.
std::vector<Code> codes(const NormalNode& disjunction, const std::vector<std::uint32_t>& image) {
  std::vector<Code> out;
  for (const NormalNode& child : disjunction.children) {
    Code code = {static_cast<std::uint32_t>(child.shape), child.negated ? 1u : 0u};
    if (child.shape == NodeShape::kAtom) {
      code.push_back(child.atom.predicate);
      for (const Term& term : child.atom.terms) code.push_back(code_of(term, image));
    } else {
      std::array<std::uint32_t, 2> sides = {code_of(child.left, image), code_of(child.right, image)};
      if (child.shape == NodeShape::kEqual && sides[1] < sides[0]) std::swap(sides[0], sides[1]);
      code.insert(code.end(), sides.begin(), sides.end());
    }
    out.push_back(std::move(code));
  }
  std::ranges::sort(out);
  return out;
}

// Tries all ways to exchange further pairs among variables[from..].
bool extends(const NormalNode& disjunction, const Formula& formula, const std::vector<Code>& original,
             const std::vector<std::uint32_t>& variables, std::size_t from, std::vector<std::uint32_t>& image) {
  if (from == variables.size()) return codes(disjunction, image) == original;
  const std::uint32_t v = variables[from];
  if (extends(disjunction, formula, original, variables, from + 1, image)) return true;
  if (image[v] != v) return false;  // exchanged already
  for (std::size_t i = from + 1; i < variables.size(); ++i) {
    const std::uint32_t w = variables[i];
    if (image[w] != w || formula.variables[v].domain != formula.variables[w].domain) continue;
    image[v] = w;
    image[w] = v;
    if (extends(disjunction, formula, original, variables, from + 1, image)) return true;
    image[v] = v;
    image[w] = w;
  }
  return false;
}

}  // namespace

std::optional<std::pair<std::uint32_t, std::uint32_t>> symmetric_pair(const NormalNode& disjunction,
                                                                      const Formula& formula) {
  if (disjunction.shape != NodeShape::kOr || disjunction.free.size() > kMaxVariables || !formula.unique.empty()) {
    return std::nullopt;
  }
  if (!std::ranges::all_of(disjunction.children, &NormalNode::is_literal)) return std::nullopt;
  std::vector<std::uint32_t> image(formula.variables.size());
  for (std::uint32_t v = 0; v < image.size(); ++v) image[v] = v;
  const std::vector<Code> original = codes(disjunction, image);
  for (const NormalNode& child : disjunction.children) {
    if (child.shape != NodeShape::kEqual || child.negated || !child.left.is_variable || !child.right.is_variable)
      continue;
    const std::uint32_t x = child.left.index, y = child.right.index;
    if (x == y || formula.variables[x].domain != formula.variables[y].domain) continue;
    std::vector<std::uint32_t> others;
    for (std::uint32_t v : disjunction.free) {
      if (v != x && v != y) others.push_back(v);
    }
    std::vector<std::uint32_t> exchanged = image;
    std::swap(exchanged[x], exchanged[y]);
    if (extends(disjunction, formula, original, others, 0, exchanged)) return std::pair{x, y};
  }
  return std::nullopt;
}

}  // namespace sherlog
