// The checks of checks.h. The truth table is computed 64 rows at a time: a word holds the value of a node in 64 rows.
#include "mln/checks.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <map>
#include <string>
#include <unordered_map>
#include <vector>

#include "mln/typing.h"

namespace sherlog {

namespace {

constexpr std::size_t kMaxPatterns = 16;

bool is_quantifier(NodeKind kind) { return kind == NodeKind::kExists || kind == NodeKind::kForall; }

// Writes nodes so that equal strings are equal formulas. With `rename`, variables are numbered by first appearance;
// otherwise only those bound inside are, so that free variables keep their identity.
class KeyWriter {
 public:
  explicit KeyWriter(bool rename) : rename_(rename) {}

  void write(const FormulaNode& node) {
    key_ += static_cast<char>('a' + static_cast<int>(node.kind));
    if (node.kind == NodeKind::kAtom) number(node.predicate.value);
    if (is_quantifier(node.kind)) {
      number(node.bound.size());
      for (const std::uint32_t variable : node.bound) names_.emplace(variable, names_.size());
    }
    if (node.kind == NodeKind::kEqual && !rename_ && term_text(node.terms[1]) < term_text(node.terms[0])) {
      key_ += term_text(node.terms[1]) + term_text(node.terms[0]);
    } else {
      for (const Term& term : node.terms) key_ += term_text(term);
    }
    number(node.children.size());
    for (const FormulaNode& child : node.children) write(child);
  }

  void number(std::size_t value) {
    key_ += std::to_string(value);
    key_ += ' ';
  }

  std::size_t name_of(std::uint32_t variable) { return names_.emplace(variable, names_.size()).first->second; }
  const std::string& key() const { return key_; }

 private:
  std::string term_text(const Term& term) {
    if (!term.is_variable) return fmt::format("c{} ", term.index);
    const auto entry = names_.find(term.index);
    if (entry != names_.end()) return fmt::format("b{} ", entry->second);
    if (rename_) return fmt::format("b{} ", name_of(term.index));
    return fmt::format("v{} ", term.index);
  }

  bool rename_;
  std::string key_;
  std::unordered_map<std::uint32_t, std::size_t> names_;
};

// A formula as a list of operations on words, operands before operators.
class TruthTable {
 public:
  explicit TruthTable(const Formula& formula) { fits_ = compile(formula.root); }

  ConstantTruth decide() const {
    if (!fits_) return ConstantTruth::kVaries;
    const std::size_t rows = std::size_t{1} << patterns_.size();
    const std::uint64_t mask = rows >= 64 ? ~std::uint64_t{0} : (std::uint64_t{1} << rows) - 1;
    bool some_true = false;
    bool some_false = false;
    for (std::size_t first = 0; first < rows; first += 64) {
      const std::uint64_t word = evaluate(first);
      some_true = some_true || (word & mask) != 0;
      some_false = some_false || (~word & mask) != 0;
      if (some_true && some_false) return ConstantTruth::kVaries;
    }
    return some_true ? ConstantTruth::kAlwaysTrue : ConstantTruth::kAlwaysFalse;
  }

 private:
  enum class Code : std::uint8_t { kPattern, kTrue, kFalse, kNot, kAnd, kOr, kImplies, kIff };
  struct Operation {
    Code code;
    std::uint32_t operand;  // kPattern: which; kAnd, kOr: how many operands
  };

  bool compile_pattern(const FormulaNode& node) {
    KeyWriter writer(false);
    writer.write(node);
    const auto pattern = patterns_.emplace(writer.key(), static_cast<std::uint32_t>(patterns_.size())).first->second;
    operations_.push_back({Code::kPattern, pattern});
    return patterns_.size() <= kMaxPatterns;
  }

  bool compile_comparison(const FormulaNode& node) {
    const Term& left = node.terms[0];
    const Term& right = node.terms[1];
    if (left == right) {
      operations_.push_back({node.kind == NodeKind::kLess ? Code::kFalse : Code::kTrue, 0});
      return true;
    }
    if (node.kind == NodeKind::kEqual && !left.is_variable && !right.is_variable) {
      operations_.push_back({Code::kFalse, 0});
      return true;
    }
    return compile_pattern(node);
  }

  bool compile(const FormulaNode& node) {
    switch (node.kind) {
      case NodeKind::kAtom:
      case NodeKind::kExists:
      case NodeKind::kForall:
        return compile_pattern(node);
      case NodeKind::kEqual:
      case NodeKind::kLess:
      case NodeKind::kLessEqual:
        return compile_comparison(node);
      default:
        break;
    }
    for (const FormulaNode& child : node.children) {
      if (!compile(child)) return false;
    }
    const Code code = node.kind == NodeKind::kNot       ? Code::kNot
                      : node.kind == NodeKind::kAnd     ? Code::kAnd
                      : node.kind == NodeKind::kOr      ? Code::kOr
                      : node.kind == NodeKind::kImplies ? Code::kImplies
                                                        : Code::kIff;
    operations_.push_back({code, static_cast<std::uint32_t>(node.children.size())});
    return true;
  }

  // The pattern's value in the 64 rows from `first` on: row r has it true where bit `pattern` of r is set.
  static std::uint64_t pattern_word(std::uint32_t pattern, std::size_t first) {
    constexpr std::array<std::uint64_t, 6> kLow = {0xAAAAAAAAAAAAAAAA, 0xCCCCCCCCCCCCCCCC, 0xF0F0F0F0F0F0F0F0,
                                                   0xFF00FF00FF00FF00, 0xFFFF0000FFFF0000, 0xFFFFFFFF00000000};
    if (pattern < kLow.size()) return kLow[pattern];
    return ((first >> pattern) & 1u) != 0 ? ~std::uint64_t{0} : 0;
  }

  std::uint64_t evaluate(std::size_t first) const {
    std::vector<std::uint64_t> stack;
    const auto pop = [&stack] {
      const std::uint64_t word = stack.back();
      stack.pop_back();
      return word;
    };
    for (const Operation& operation : operations_) {
      std::uint64_t word = 0;
      switch (operation.code) {
        case Code::kPattern:
          word = pattern_word(operation.operand, first);
          break;
        case Code::kTrue:
          word = ~std::uint64_t{0};
          break;
        case Code::kFalse:
          break;
        case Code::kNot:
          word = ~pop();
          break;
        case Code::kAnd:
          word = ~std::uint64_t{0};
          for (std::uint32_t i = 0; i < operation.operand; ++i) word &= pop();
          break;
        case Code::kOr:
          for (std::uint32_t i = 0; i < operation.operand; ++i) word |= pop();
          break;
        case Code::kImplies: {
          const std::uint64_t right = pop();
          word = ~pop() | right;
          break;
        }
        case Code::kIff: {
          const std::uint64_t right = pop();
          word = ~(pop() ^ right);
          break;
        }
      }
      stack.push_back(word);
    }
    return stack.back();
  }

  bool fits_ = false;
  std::map<std::string, std::uint32_t> patterns_;
  std::vector<Operation> operations_;
};

void mark_predicates(const FormulaNode& node, std::vector<bool>& used) {
  if (node.kind == NodeKind::kAtom) used[node.predicate.index()] = true;
  for (const FormulaNode& child : node.children) mark_predicates(child, used);
}

void check_unused(const Model& model, Diagnostics& diagnostics) {
  std::vector<bool> used_predicates(model.predicates().size(), false);
  for (const Formula& formula : model.formulas()) mark_predicates(formula.root, used_predicates);
  std::vector<bool> used_domains(model.domains().size(), false);
  for (std::size_t i = 0; i < model.predicates().size(); ++i) {
    const Predicate& predicate = model.predicates()[i];
    for (const DomainId domain : predicate.domains) used_domains[domain.index()] = true;
    if (used_predicates[i] || model.formulas().empty()) continue;
    diagnostics.warning("unused-predicate", predicate.place,
                        fmt::format("predicate '{}' is in no formula", predicate.name));
  }
  for (std::size_t i = 0; i < model.domains().size(); ++i) {
    const Domain& domain = model.domains()[i];
    if (used_domains[i] || !domain.declared) continue;
    diagnostics.warning("unused-domain", domain.place, fmt::format("no predicate uses domain '{}'", domain.name));
  }
}

void check_constant_truth(const Formula& formula, Diagnostics& diagnostics) {
  switch (constant_truth(formula)) {
    case ConstantTruth::kVaries:
      return;
    case ConstantTruth::kAlwaysTrue:
      diagnostics.warning("tautology", formula.place, "formula is always true: it changes no probability");
      return;
    case ConstantTruth::kAlwaysFalse:
      if (formula.hard) {
        diagnostics.warning("contradiction", formula.place,
                            "hard formula is always false: no world is possible where it has a grounding");
      } else {
        diagnostics.warning("contradiction", formula.place, "formula is always false: it changes no probability");
      }
      return;
  }
}

void check_compared_domains(const Model& model, Diagnostics& diagnostics) {
  const std::vector<std::optional<Place>> places = compared_domains(model);
  for (std::size_t d = 0; d < places.size(); ++d) {
    const Domain& domain = model.domains()[d];
    if (!places[d]) continue;
    const auto wrong = std::find_if(domain.constants.begin(), domain.constants.end(),
                                    [](const std::string& constant) { return !numeric_value(constant); });
    if (wrong == domain.constants.end()) continue;
    std::vector<Note> notes;
    if (domain.declared) notes.push_back({domain.place, fmt::format("'{}' is declared here", domain.name)});
    diagnostics.error(
        "not-numeric", *places[d],
        fmt::format("numbers alone can be compared, and constant '{}' of domain '{}' is none", *wrong, domain.name),
        std::move(notes));
  }
}

void check_duplicates(const Model& model, Diagnostics& diagnostics) {
  std::unordered_map<std::string, const Formula*> first;
  for (const Formula& formula : model.formulas()) {
    const auto [entry, is_new] = first.emplace(formula_key(formula), &formula);
    if (is_new) continue;
    const bool both_soft = !formula.hard && !entry->second->hard;
    diagnostics.warning(
        "duplicate-formula", formula.place,
        both_soft ? "formula repeats an earlier one: their weights add up" : "formula repeats an earlier one",
        {{entry->second->place, "the same formula is here"}});
  }
}

}  // namespace

void add_compared_domains(const FormulaNode& node, std::vector<std::optional<Place>>& places) {
  if (node.kind == NodeKind::kLess || node.kind == NodeKind::kLessEqual) {
    std::optional<Place>& place = places[node.domain.index()];
    if (!place) place = node.place;
  }
  for (const FormulaNode& child : node.children) add_compared_domains(child, places);
}

std::vector<std::optional<Place>> compared_domains(const Model& model) {
  std::vector<std::optional<Place>> places(model.domains().size());
  for (const Formula& formula : model.formulas()) add_compared_domains(formula.root, places);
  return places;
}

ConstantTruth constant_truth(const Formula& formula) { return TruthTable(formula).decide(); }

std::string formula_key(const Formula& formula) {
  KeyWriter writer(true);
  writer.write(formula.root);
  std::vector<std::size_t> plus;
  for (std::uint32_t i = 0; i < formula.variables.size(); ++i) {
    if (formula.variables[i].plus) plus.push_back(writer.name_of(i));
  }
  std::sort(plus.begin(), plus.end());
  for (const std::size_t name : plus) writer.number(name);
  for (const std::vector<std::uint32_t>& group : formula.unique) {
    std::vector<std::size_t> names;
    names.reserve(group.size());
    for (const std::uint32_t variable : group) names.push_back(writer.name_of(variable));
    std::sort(names.begin(), names.end());
    writer.number(names.size());
    for (const std::size_t name : names) writer.number(name);
  }
  return writer.key();
}

void check_model(const Model& model, Diagnostics& diagnostics) {
  check_unused(model, diagnostics);
  for (const Formula& formula : model.formulas()) check_constant_truth(formula, diagnostics);
  check_duplicates(model, diagnostics);
  check_compared_domains(model, diagnostics);
}

}  // namespace sherlog
