#include "cli/conflict_evidence.h"

#include <algorithm>
#include <functional>
#include <optional>

namespace sherlog::cli {
namespace {

class Collector {
 public:
  Collector(const Model& model, const Evidence& evidence, std::vector<ConstantIndex> by_variable,
            const Formula& formula)
      : model_(model), evidence_(evidence), formula_(formula), values_(std::move(by_variable)) {}

  void visit(const FormulaNode& node) {
    if (steps_++ > kMaxSteps) return;
    if (node.kind == NodeKind::kAtom) return visit_atom(node);
    if (node.kind == NodeKind::kExists || node.kind == NodeKind::kForall) return visit_bound(node, 0);
    for (const FormulaNode& child : node.children) visit(child);
  }
  std::vector<StatedAtom> take() { return std::move(found_); }

 private:
  static constexpr std::size_t kMaxSteps = 20000;  // a message is not worth more

  void visit_bound(const FormulaNode& node, std::size_t depth) {
    if (depth == node.bound.size()) {
      for (const FormulaNode& child : node.children) visit(child);
      return;
    }
    const std::uint32_t variable = node.bound[depth];
    const std::size_t size = evidence_.domain_size(model_, formula_.variables[variable].domain);
    for (std::size_t c = 0; c < size && steps_ <= kMaxSteps; ++c) {
      values_[variable] = static_cast<ConstantIndex>(c);
      visit_bound(node, depth + 1);
    }
  }

  void visit_atom(const FormulaNode& node) {
    const PredicateEvidence& stated = evidence_.of(node.predicate);
    std::vector<ConstantIndex> arguments;
    for (const Term& term : node.terms) arguments.push_back(term.is_variable ? values_[term.index] : term.index);
    const auto fits = [](ConstantIndex wanted, ConstantIndex stated_one) {
      return wanted == stated_one || wanted == kEveryConstant;
    };
    for (std::size_t i = 0; i < stated.size(); ++i) {
      if (stated.kinds[i] != EvidenceKind::kTrue && stated.kinds[i] != EvidenceKind::kFalse) continue;
      const auto begin = stated.arguments.begin() + static_cast<std::ptrdiff_t>(i * arguments.size());
      if (!std::equal(arguments.begin(), arguments.end(), begin, fits)) continue;
      const StatedAtom atom{node.predicate, i};
      if (std::find(found_.begin(), found_.end(), atom) == found_.end()) found_.push_back(atom);
    }
  }

  const Model& model_;
  const Evidence& evidence_;
  const Formula& formula_;
  std::vector<ConstantIndex> values_;
  std::vector<StatedAtom> found_;
  std::size_t steps_ = 0;
};

}  // namespace

std::vector<StatedAtom> stated_atoms_of(const Model& model, const Evidence& evidence, const Formula& formula,
                                        std::vector<ConstantIndex> by_variable) {
  Collector collector(model, evidence, std::move(by_variable), formula);
  collector.visit(formula.root);
  return collector.take();
}

}  // namespace sherlog::cli
