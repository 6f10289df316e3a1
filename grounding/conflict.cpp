#include "grounding/conflict.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <limits>
#include <set>

namespace sherlog {
namespace {

// --- ground formulas as text -----------------------------------------------------------------------------------------

class GroundPrinter {
 public:
  GroundPrinter(const Model& model, const Evidence& evidence, const Formula& formula,
                std::span<const ConstantIndex> values)
      : model_(model), evidence_(evidence), formula_(formula), values_(values) {}

  std::string text(const FormulaNode& node) const { return print(node, kLoosest); }

 private:
  static constexpr int kLoosest = 0, kIff = 1, kImplies = 2, kOr = 3, kAnd = 4, kNot = 5;

  static int tightness(NodeKind kind) {
    switch (kind) {
      case NodeKind::kIff:
        return kIff;
      case NodeKind::kImplies:
        return kImplies;
      case NodeKind::kOr:
        return kOr;
      case NodeKind::kAnd:
        return kAnd;
      default:
        return kNot;
    }
  }

  std::string term(const Term& t, DomainId domain) const {
    if (!t.is_variable) return quoted_constant(evidence_.constant_name(model_, domain, t.index));
    const FormulaVariable& variable = formula_.variables[t.index];
    if (variable.quantified || values_[t.index] == kEveryConstant) return variable.name;
    return quoted_constant(evidence_.constant_name(model_, domain, values_[t.index]));
  }

  std::string joined(const FormulaNode& node, const char* connective, int inside) const {
    std::string result;
    for (const FormulaNode& child : node.children) {
      if (!result.empty()) result += connective;
      result += print(child, inside);
    }
    return result;
  }

  std::string sides(const FormulaNode& node, const char* sign) const {
    return term(node.terms[0], node.domain) + sign + term(node.terms[1], node.domain);
  }

  std::string quantified(const FormulaNode& node, const char* word) const {
    std::string result = word;
    for (std::size_t i = 0; i < node.bound.size(); ++i) {
      result += (i > 0 ? ", " : " ") + formula_.variables[node.bound[i]].name;
    }
    return result + " (" + print(node.children[0], kLoosest) + ")";
  }

  std::string bare(const FormulaNode& node) const {
    switch (node.kind) {
      case NodeKind::kAtom: {
        const Predicate& predicate = model_.predicate(node.predicate);
        std::string result = predicate.name + "(";
        for (std::size_t i = 0; i < node.terms.size(); ++i) {
          result += (i > 0 ? "," : "") + term(node.terms[i], predicate.domains[i]);
        }
        return result + ")";
      }
      case NodeKind::kEqual:
        return sides(node, " = ");
      case NodeKind::kLess:
        return sides(node, " < ");
      case NodeKind::kLessEqual:
        return sides(node, " <= ");
      case NodeKind::kNot:
        if (node.children[0].kind == NodeKind::kEqual) return sides(node.children[0], " != ");
        if (node.children[0].kind == NodeKind::kLess || node.children[0].kind == NodeKind::kLessEqual) {
          return "!(" + bare(node.children[0]) + ")";
        }
        return "!" + print(node.children[0], kNot);
      case NodeKind::kAnd:
        return joined(node, " ^ ", kAnd + 1);
      case NodeKind::kOr:
        return joined(node, " v ", kOr + 1);
      case NodeKind::kImplies:
        return print(node.children[0], kImplies + 1) + " => " + print(node.children[1], kImplies);
      case NodeKind::kIff:
        return joined(node, " <=> ", kIff + 1);
      case NodeKind::kExists:
        return quantified(node, "EXIST");
      case NodeKind::kForall:
        return quantified(node, "FORALL");
    }
    return "";
  }

  std::string print(const FormulaNode& node, int outside) const {
    const std::string text = bare(node);
    return tightness(node.kind) < outside ? "(" + text + ")" : text;
  }

  const Model& model_;
  const Evidence& evidence_;
  const Formula& formula_;
  std::span<const ConstantIndex> values_;
};

// --- which evidence makes a ground formula false ---------------------------------------------------------------------

using GroundAtom = std::pair<PredicateId, std::vector<ConstantIndex>>;
using AtomSet = std::set<GroundAtom>;

enum class Truth : std::uint8_t { kFalse, kTrue, kUnknown };

Truth truth_of(bool value) { return value ? Truth::kTrue : Truth::kFalse; }
Truth opposite(Truth t) { return t == Truth::kUnknown ? t : truth_of(t == Truth::kFalse); }

class Explainer {
 public:
  Explainer(const Model& model, const Evidence& evidence, const AtomTable& atoms, const Formula& formula,
            std::vector<ConstantIndex> values)
      : model_(model), evidence_(evidence), atoms_(atoms), formula_(formula), values_(std::move(values)) {}

  // Looks for values of the variables that stand for every constant under which the evidence makes the formula false;
  // they stay as they are where there are none.
  const std::vector<ConstantIndex>& bound() {
    std::vector<std::uint32_t> unbound;
    double combinations = 1;
    for (std::uint32_t v = 0; v < values_.size(); ++v) {
      if (formula_.variables[v].quantified || values_[v] != kEveryConstant) continue;
      unbound.push_back(v);
      combinations *= atoms_.domain_size(formula_.variables[v].domain);
    }
    const bool found = combinations <= kMostToTry && bind(unbound, 0);
    if (!found) {
      for (std::uint32_t v : unbound) values_[v] = kEveryConstant;
    }
    return values_;
  }

  // Atoms that evidence decides and that suffice to make the formula false.
  AtomSet reasons() {
    // Where it took the rules of blocks as well: all that is known of its atoms.
    if (value(formula_.root) != Truth::kFalse) return decided_atoms();
    AtomSet result;
    support(formula_.root, Truth::kFalse, result);
    if (result.size() > kMostToShrink) return result;
    only_ = result;
    for (const GroundAtom& atom : result) {
      only_->erase(atom);
      if (value(formula_.root) != Truth::kFalse) only_->insert(atom);
    }
    return *only_;
  }

  // All of its atoms that evidence decides, up to a limit.
  AtomSet decided_atoms() {
    AtomSet result;
    collect(formula_.root, result);
    return result;
  }

 private:
  static constexpr std::size_t kMostToShrink = 256;
  static constexpr std::size_t kMostToCollect = 64;
  static constexpr double kMostToTry = 1e5;

  bool bind(const std::vector<std::uint32_t>& unbound, std::size_t depth) {
    if (depth == unbound.size()) return value(formula_.root) == Truth::kFalse;
    const std::uint32_t variable = unbound[depth];
    const std::uint32_t size = atoms_.domain_size(formula_.variables[variable].domain);
    for (ConstantIndex c = 0; c < size; ++c) {
      values_[variable] = c;
      if (bind(unbound, depth + 1)) return true;
    }
    return false;
  }

  GroundAtom ground(const FormulaNode& node) const {
    GroundAtom atom{node.predicate, {}};
    for (const Term& t : node.terms) atom.second.push_back(constant(t));
    return atom;
  }
  ConstantIndex constant(const Term& t) const { return t.is_variable ? values_[t.index] : t.index; }

  Truth atom_value(const FormulaNode& node) const {
    const GroundAtom atom = ground(node);
    if (std::ranges::find(atom.second, kEveryConstant) != atom.second.end()) return Truth::kUnknown;
    if (only_ && !only_->contains(atom)) return Truth::kUnknown;
    const std::uint32_t code = atoms_.code(atom.first, atom.second);
    return code >= atom_code::kOpen ? Truth::kUnknown : truth_of(code == atom_code::kTrue);
  }

  Truth compared(const FormulaNode& node) const {
    const ConstantIndex left = constant(node.terms[0]), right = constant(node.terms[1]);
    if (left == kEveryConstant || right == kEveryConstant) return Truth::kUnknown;
    if (node.kind == NodeKind::kEqual) return truth_of(left == right);
    const auto number = [&](ConstantIndex c) {
      const std::string& name = evidence_.constant_name(model_, node.domain, c);
      double result = 0;
      const auto [end, error] = std::from_chars(name.data(), name.data() + name.size(), result);
      return error == std::errc() && end == name.data() + name.size() ? result
                                                                      : std::numeric_limits<double>::quiet_NaN();
    };
    return truth_of(node.kind == NodeKind::kLess ? number(left) < number(right) : number(left) <= number(right));
  }

  // Calls visit() for every binding of a quantifier's variables until it returns false.
  template <class Visit>
  bool for_each_binding(const FormulaNode& node, Visit visit, std::size_t depth = 0) {
    if (depth == node.bound.size()) return visit();
    const std::uint32_t variable = node.bound[depth];
    const std::uint32_t size = atoms_.domain_size(formula_.variables[variable].domain);
    for (ConstantIndex c = 0; c < size; ++c) {
      values_[variable] = c;
      if (!for_each_binding(node, visit, depth + 1)) return false;
    }
    return true;
  }

  Truth any_of(const FormulaNode& node, Truth dominant) {
    Truth result = opposite(dominant);
    for (const FormulaNode& child : node.children) {
      const Truth t = value(child);
      if (t == dominant) return dominant;
      if (t == Truth::kUnknown) result = t;
    }
    return result;
  }

  Truth value(const FormulaNode& node) {
    switch (node.kind) {
      case NodeKind::kAtom:
        return atom_value(node);
      case NodeKind::kEqual:
      case NodeKind::kLess:
      case NodeKind::kLessEqual:
        return compared(node);
      case NodeKind::kNot:
        return opposite(value(node.children[0]));
      case NodeKind::kAnd:
        return any_of(node, Truth::kFalse);
      case NodeKind::kOr:
        return any_of(node, Truth::kTrue);
      case NodeKind::kImplies: {
        const Truth body = value(node.children[0]);
        if (body == Truth::kFalse) return Truth::kTrue;
        const Truth head = value(node.children[1]);
        return head == Truth::kTrue || body == Truth::kTrue ? head : Truth::kUnknown;
      }
      case NodeKind::kIff: {
        const Truth left = value(node.children[0]), right = value(node.children[1]);
        if (left == Truth::kUnknown || right == Truth::kUnknown) return Truth::kUnknown;
        return truth_of(left == right);
      }
      case NodeKind::kExists:
      case NodeKind::kForall: {
        const Truth dominant = truth_of(node.kind == NodeKind::kExists);
        Truth result = opposite(dominant);
        for_each_binding(node, [&] {
          const Truth t = value(node.children[0]);
          if (t != opposite(dominant)) result = t;
          return t != dominant;
        });
        return result;
      }
    }
    return Truth::kUnknown;
  }

  // Adds atoms that suffice to give the node the value `t`, which it has.
  void support(const FormulaNode& node, Truth t, AtomSet& atoms) {
    switch (node.kind) {
      case NodeKind::kAtom:
        atoms.insert(ground(node));
        return;
      case NodeKind::kNot:
        support(node.children[0], opposite(t), atoms);
        return;
      case NodeKind::kAnd:
      case NodeKind::kOr: {
        const bool one_is_enough = (node.kind == NodeKind::kOr) == (t == Truth::kTrue);
        for (const FormulaNode& child : node.children) {
          if (one_is_enough && value(child) != t) continue;
          support(child, t, atoms);
          if (one_is_enough) return;
        }
        return;
      }
      case NodeKind::kImplies:
        if (t == Truth::kFalse || value(node.children[0]) != Truth::kFalse) support(node.children[1], t, atoms);
        if (t == Truth::kFalse || value(node.children[0]) == Truth::kFalse)
          support(node.children[0], opposite(t), atoms);
        return;
      case NodeKind::kIff:
        for (const FormulaNode& child : node.children) support(child, value(child), atoms);
        return;
      case NodeKind::kExists:
      case NodeKind::kForall: {
        const bool one_is_enough = (node.kind == NodeKind::kExists) == (t == Truth::kTrue);
        for_each_binding(node, [&] {
          if (one_is_enough && value(node.children[0]) != t) return true;
          support(node.children[0], t, atoms);
          return !one_is_enough;
        });
        return;
      }
      default:
        return;
    }
  }

  void collect(const FormulaNode& node, AtomSet& atoms) {
    if (atoms.size() >= kMostToCollect) return;
    if (node.kind == NodeKind::kAtom) {
      collect_atom(node, atoms);
    } else if (node.kind == NodeKind::kExists || node.kind == NodeKind::kForall) {
      for_each_binding(node, [&] {
        collect(node.children[0], atoms);
        return atoms.size() < kMostToCollect;
      });
    } else {
      for (const FormulaNode& child : node.children) collect(child, atoms);
    }
  }

  // Under every constant for a variable that is not bound.
  void collect_atom(const FormulaNode& node, AtomSet& atoms) {
    const auto unbound =
        std::ranges::find_if(node.terms, [&](const Term& term) { return constant(term) == kEveryConstant; });
    if (unbound == node.terms.end()) {
      if (atom_value(node) != Truth::kUnknown) atoms.insert(ground(node));
      return;
    }
    const std::uint32_t variable = unbound->index;
    const std::uint32_t size = atoms_.domain_size(formula_.variables[variable].domain);
    for (ConstantIndex c = 0; c < size && atoms.size() < kMostToCollect; ++c) {
      values_[variable] = c;
      collect_atom(node, atoms);
    }
    values_[variable] = kEveryConstant;
  }

  const Model& model_;
  const Evidence& evidence_;
  const AtomTable& atoms_;
  const Formula& formula_;
  std::vector<ConstantIndex> values_;
  std::optional<AtomSet> only_;  // every other atom is forgotten
};

// --- the items -------------------------------------------------------------------------------------------------------

std::span<const ConstantIndex> stated_arguments(const PredicateEvidence& stated, std::size_t i, std::size_t arity) {
  return {stated.arguments.data() + i * arity, arity};
}

class Items {
 public:
  Items(const Model& model, const Evidence& evidence) : model_(model), evidence_(evidence) {}

  // What decides the atom: its own line, those of its block, or that it is closed.
  void add_reason(PredicateId id, std::span<const ConstantIndex> arguments, bool closed) {
    const Predicate& predicate = model_.predicate(id);
    const PredicateEvidence& stated = evidence_.of(id);
    for (std::size_t i = 0; i < stated.size(); ++i) {
      if (std::ranges::equal(stated_arguments(stated, i, predicate.arity()), arguments) &&
          is_decision(stated.kinds[i])) {
        add_line(id, i);
        return;
      }
    }
    if (closed && predicate.block != BlockKind::kExactlyOne) {
      add({fmt::format("{} is not stated and {} is closed", atom_text(model_, evidence_, id, arguments),
                       predicate.name),
           predicate.place, false});
      // The place of the declaration belongs to the model: an item of the evidence has none.
      items_.back().place = Place{};
      return;
    }
    if (!add_block(id, arguments)) {
      add({atom_text(model_, evidence_, id, arguments) + " is the only value of its block", Place{}, false});
    }
  }

  // The stated value of the atom's block, or all its denied values. False where the evidence says nothing of it.
  bool add_block(PredicateId id, std::span<const ConstantIndex> arguments) {
    const Predicate& predicate = model_.predicate(id);
    const PredicateEvidence& stated = evidence_.of(id);
    std::vector<std::size_t> denied;
    for (std::size_t i = 0; i < stated.size(); ++i) {
      const auto other = stated_arguments(stated, i, predicate.arity());
      bool same_block = true;
      for (std::size_t k = 0; k < other.size(); ++k)
        same_block = same_block && (predicate.marked[k] || other[k] == arguments[k]);
      if (!same_block) continue;
      if (stated.kinds[i] == EvidenceKind::kTrue) {
        add_line(id, i);
        return true;
      }
      if (stated.kinds[i] == EvidenceKind::kFalse) denied.push_back(i);
    }
    for (std::size_t i : denied) add_line(id, i);
    return !denied.empty();
  }

  void add(Conflict::Item item) {
    if (std::ranges::none_of(items_, [&](const Conflict::Item& other) { return other.text == item.text; })) {
      items_.push_back(std::move(item));
    }
  }

  Conflict finish(std::string sentence) {
    Conflict result;
    result.items = std::move(items_);
    result.sentence = std::move(sentence);
    result.model_sources = std::make_shared<const Sources>(model_.sources());
    result.evidence_sources = std::make_shared<const Sources>(evidence_.sources());
    return result;
  }

 private:
  static bool is_decision(EvidenceKind kind) { return kind == EvidenceKind::kTrue || kind == EvidenceKind::kFalse; }

  void add_line(PredicateId id, std::size_t i) {
    const PredicateEvidence& stated = evidence_.of(id);
    const auto arguments = stated_arguments(stated, i, model_.predicate(id).arity());
    add({(stated.kinds[i] == EvidenceKind::kFalse ? "!" : "") + atom_text(model_, evidence_, id, arguments),
         stated.places[i], false});
  }

  const Model& model_;
  const Evidence& evidence_;
  std::vector<Conflict::Item> items_;
};

}  // namespace

std::string ground_formula_text(const Model& model, const Evidence& evidence, const Formula& formula,
                                std::span<const ConstantIndex> by_variable) {
  return GroundPrinter(model, evidence, formula, by_variable).text(formula.root);
}

Conflict conflict_of_formula(const Model& model, const Evidence& evidence, const AtomTable& atoms, FormulaId id,
                             std::vector<ConstantIndex> by_variable) {
  const Formula& formula = model.formula(id);
  Items items(model, evidence);
  Explainer explainer(model, evidence, atoms, formula, std::move(by_variable));
  items.add({ground_formula_text(model, evidence, formula, explainer.bound()), formula.place, true});
  const AtomSet reasons = explainer.reasons();
  for (const auto& [predicate, arguments] : reasons) items.add_reason(predicate, arguments, !atoms.is_open(predicate));
  return items.finish(reasons.empty() ? "a hard formula can never hold" : "the evidence contradicts a hard formula");
}

Conflict conflict_of_formulas(const Model& model, const Evidence& evidence, const AtomTable& atoms,
                              const std::vector<GroundFormula>& formulas) {
  Items items(model, evidence);
  for (const GroundFormula& ground : formulas) {
    const Formula& formula = model.formula(ground.formula);
    items.add({ground_formula_text(model, evidence, formula, ground.by_variable), formula.place, true});
  }
  bool evidence_matters = false;
  for (const GroundFormula& ground : formulas) {
    Explainer explainer(model, evidence, atoms, model.formula(ground.formula), ground.by_variable);
    for (const auto& [predicate, arguments] : explainer.decided_atoms()) {
      items.add_reason(predicate, arguments, !atoms.is_open(predicate));
      evidence_matters = true;
    }
  }
  return items.finish(evidence_matters ? "the evidence and the hard formulas contradict each other"
                                       : "the hard formulas contradict each other");
}

Conflict conflict_of_block(const Model& model, const Evidence& evidence, const AtomTable::EmptyBlock& block) {
  const Predicate& predicate = model.predicate(block.predicate);
  Items items(model, evidence);
  if (!block.arguments.empty()) {
    items.add_block(block.predicate, block.arguments);
    return items.finish(fmt::format("'{}' needs exactly one true value in each block, and the evidence denies them all",
                                    predicate.name));
  }
  std::string domain;
  for (std::size_t i = 0; i < predicate.arity(); ++i) {
    const bool empty = evidence.domain_size(model, predicate.domains[i]) == 0;
    if (domain.empty() && predicate.marked[i] && empty) domain = model.domain(predicate.domains[i]).name;
  }
  items.add({predicate.name, predicate.place, true});
  return items.finish(
      fmt::format("'{}' needs exactly one value from '{}', and that domain has no constants", predicate.name, domain));
}

Conflict conflict_of_soft_atom(const Model& model, const Evidence& evidence, const AtomTable& atoms,
                               PredicateId predicate, std::span<const ConstantIndex> arguments, double degree,
                               const Place& place) {
  Items items(model, evidence);
  const std::string atom = atom_text(model, evidence, predicate, arguments);
  items.add({fmt::format("{:g} {}", degree, atom), place, false});
  items.add_reason(predicate, arguments, !atoms.is_open(predicate));
  const bool is_true = atoms.code(predicate, arguments) == atom_code::kTrue;
  return items.finish(fmt::format("the posterior of {} cannot be {:g}: the other evidence makes it {}", atom, degree,
                                  is_true ? "true" : "false"));
}

}  // namespace sherlog
