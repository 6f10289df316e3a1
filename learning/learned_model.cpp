#include "learning/learned_model.h"

#include <fmt/format.h>

#include <algorithm>
#include <string_view>

#include "mln/evidence.h"
#include "mln/printer.h"
#include "mln/shared_domains.h"
#include "mln/syntax.h"

namespace sherlog {
namespace {

constexpr std::size_t kLineLength = 110;

// A resolved formula as a syntax tree, some of its variables replaced by constants.
class TreeMaker {
 public:
  static constexpr std::int64_t kFree = -1;

  // `constants`: by variable, or kFree.
  TreeMaker(const Model& model, const Formula& formula, std::vector<std::int64_t> constants)
      : model_(model), formula_(formula), constants_(std::move(constants)), marked_(wants_marks()) {}

  syntax::Formula make(const FormulaNode& node) const {
    syntax::Formula tree;
    tree.kind = kind_of(node.kind);
    if (node.kind == NodeKind::kAtom) {
      const Predicate& predicate = model_.predicate(node.predicate);
      tree.name = predicate.name;
      for (std::size_t i = 0; i < node.terms.size(); ++i)
        tree.terms.push_back(term(node.terms[i], predicate.domains[i]));
    } else {
      for (const Term& side : node.terms) tree.terms.push_back(term(side, node.domain));
    }
    for (const std::uint32_t v : node.bound) tree.terms.push_back(variable(v));
    // x != y reads better than !(x = y).
    if (node.kind == NodeKind::kNot && node.children[0].kind == NodeKind::kEqual) {
      tree = make(node.children[0]);
      tree.kind = syntax::Kind::kNotEqual;
      return tree;
    }
    for (const FormulaNode& child : node.children) tree.children.push_back(make(child));
    return tree;
  }

 private:
  bool wants_marks() const {
    for (const FormulaVariable& v : formula_.variables) {
      if (formula_.text.find("?" + v.name) != std::string::npos) return true;
      if (model_.domain(v.domain).find(v.name)) return true;
    }
    return false;
  }

  static syntax::Kind kind_of(NodeKind kind) {
    switch (kind) {
      case NodeKind::kAtom:
        return syntax::Kind::kAtom;
      case NodeKind::kEqual:
        return syntax::Kind::kEqual;
      case NodeKind::kLess:
        return syntax::Kind::kLess;
      case NodeKind::kLessEqual:
        return syntax::Kind::kLessEqual;
      case NodeKind::kNot:
        return syntax::Kind::kNot;
      case NodeKind::kAnd:
        return syntax::Kind::kAnd;
      case NodeKind::kOr:
        return syntax::Kind::kOr;
      case NodeKind::kImplies:
        return syntax::Kind::kImplies;
      case NodeKind::kIff:
        return syntax::Kind::kIff;
      case NodeKind::kExists:
        return syntax::Kind::kExists;
      case NodeKind::kForall:
        return syntax::Kind::kForall;
    }
    return syntax::Kind::kAtom;
  }

  syntax::Term variable(std::uint32_t v) const {
    syntax::Term result;
    result.kind = marked_ ? syntax::Term::Kind::kVariable : syntax::Term::Kind::kIdentifier;
    result.name = formula_.variables[v].name;
    return result;
  }

  syntax::Term term(const Term& source, DomainId domain) const {
    if (source.is_variable && constants_[source.index] == kFree) return variable(source.index);
    const auto constant = source.is_variable ? static_cast<ConstantIndex>(constants_[source.index]) : source.index;
    syntax::Term result;
    result.name = model_.domain(domain).constants[constant];
    return result;
  }

  const Model& model_;
  const Formula& formula_;
  std::vector<std::int64_t> constants_;
  bool marked_;
};

std::string formula_text(const Model& model, const Formula& formula, std::vector<std::int64_t> constants) {
  return print(TreeMaker(model, formula, std::move(constants)).make(formula.root));
}

std::string hard_text(const Model& model, const Formula& formula) {
  return formula_text(model, formula, std::vector<std::int64_t>(formula.variables.size(), TreeMaker::kFree));
}

// name = {A, B, ...}, broken into lines.
std::string domain_text(const Domain& domain) {
  std::string text = domain.name + " = {", line = text;
  text.clear();
  for (std::size_t i = 0; i < domain.constants.size(); ++i) {
    std::string word = quoted_constant(domain.constants[i]) + (i + 1 < domain.constants.size() ? ", " : "");
    if (line.size() + word.size() > kLineLength) {
      text += line + "\n";
      line = "    ";
    }
    line += word;
  }
  return text + line + "}\n";
}

std::string predicate_text(const Model& model, const Predicate& predicate) {
  std::string text = (predicate.closed ? "*" : "") + predicate.name + "(";
  for (std::size_t i = 0; i < predicate.arity(); ++i) {
    if (i > 0) text += ", ";
    text += model.domain(predicate.domains[i]).name;
    if (predicate.marked[i]) text += predicate.block == BlockKind::kExactlyOne ? "!" : "?";
  }
  return text + ")\n";
}

std::string comment(const std::string& heading) {
  std::string text;
  for (std::size_t begin = 0; begin < heading.size();) {
    const std::size_t end = std::min(heading.find('\n', begin), heading.size());
    text += "// " + heading.substr(begin, end - begin) + "\n";
    begin = end + 1;
  }
  return text;
}

}  // namespace

std::string weight_text(const Model& model, const WeightTable& table, std::size_t weight) {
  const Formula& formula = model.formula(table.formula(weight));
  std::vector<std::int64_t> constants(formula.variables.size(), TreeMaker::kFree);
  const auto chosen = table.plus_constants(weight);
  std::size_t next = 0;
  for (std::size_t v = 0; v < constants.size(); ++v) {
    if (formula.variables[v].plus) constants[v] = chosen[next++];
  }
  return formula_text(model, formula, std::move(constants));
}

std::string learned_model_text(const Model& model, const WeightTable& table, std::span<const double> weights,
                               const std::string& heading) {
  std::string text = comment(heading) + "\n";
  const std::vector<bool> shared = shared_domains(model);
  for (std::size_t d = 0; d < model.domains().size(); ++d) {
    if (shared[d] && !model.domains()[d].constants.empty()) text += domain_text(model.domains()[d]);
  }
  text += "\n";
  for (const Predicate& predicate : model.predicates()) text += predicate_text(model, predicate);
  std::size_t w = 0;
  for (std::size_t f = 0; f < model.formulas().size(); ++f) {
    const Formula& formula = model.formulas()[f];
    const bool template_formula = std::ranges::any_of(formula.variables, &FormulaVariable::plus);
    text += template_formula || formula.hard ? "\n" : "";
    if (template_formula) text += "// " + formula.text + "\n";
    if (formula.hard) text += hard_text(model, formula) + ".\n";
    for (; w < table.size() && table.formula(w) == FormulaId(f); ++w) {
      if (formula.fixed) text += "#fixweight\n";
      const std::string body = weight_text(model, table, w);
      // A digit would be read on as part of the weight.
      const bool runs_on = std::string_view("+-*/^.0123456789").find(body.front()) != std::string_view::npos;
      text += fmt::format("{}{} {}\n", weights[w], runs_on ? ":" : "", body);
    }
  }
  return text;
}

}  // namespace sherlog
