#include "learning/learned_model.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <limits>
#include <optional>
#include <string_view>

#include "mln/evidence.h"
#include "mln/printer.h"
#include "mln/shared_domains.h"
#include "mln/syntax.h"

namespace sherlog {
namespace {

constexpr std::size_t kLineLength = 110;

// A resolved formula as a syntax tree, some of its variables replaced by constants. Comparisons that have no variable left are
// decided: the reader could not know which domain such constants are of.
class TreeMaker {
 public:
  static constexpr std::int64_t kFree = -1;
  // Either is there.
  struct Part {
    std::optional<bool> truth;
    syntax::Formula tree;
  };

  // `constants`: by variable, or kFree. `declared`: by domain, whether the text lists its constants.
  TreeMaker(const Model& model, const Formula& formula, std::vector<std::int64_t> constants,
            const std::vector<bool>& declared)
      : model_(model),
        formula_(formula),
        constants_(std::move(constants)),
        declared_(declared),
        marked_(wants_marks()) {}

  Part make(const FormulaNode& node) const {
    switch (node.kind) {
      case NodeKind::kAtom:
        return {std::nullopt, atom(node)};
      case NodeKind::kEqual:
      case NodeKind::kLess:
      case NodeKind::kLessEqual:
        return comparison(node);
      case NodeKind::kNot:
        return negation(make(node.children[0]));
      case NodeKind::kAnd:
      case NodeKind::kOr:
        return junction(node);
      case NodeKind::kImplies:
      case NodeKind::kIff:
        return arrow(node);
      case NodeKind::kExists:
      case NodeKind::kForall:
        break;
    }
    Part part = make(node.children[0]);
    if (part.truth) return part;
    syntax::Formula tree;
    tree.kind = kind_of(node.kind);
    for (const std::uint32_t v : node.bound) tree.terms.push_back(variable(v));
    tree.children.push_back(std::move(part.tree));
    return {std::nullopt, std::move(tree)};
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

  syntax::Formula atom(const FormulaNode& node) const {
    const Predicate& predicate = model_.predicate(node.predicate);
    syntax::Formula tree;
    tree.kind = syntax::Kind::kAtom;
    tree.name = predicate.name;
    for (std::size_t i = 0; i < node.terms.size(); ++i) tree.terms.push_back(term(node.terms[i], predicate.domains[i]));
    return tree;
  }

  Part comparison(const FormulaNode& node) const {
    const std::optional<ConstantIndex> left = constant(node.terms[0]), right = constant(node.terms[1]);
    if (left && right) {
      if (node.kind == NodeKind::kEqual) return {*left == *right, {}};
      const double a = number(node.domain, *left), b = number(node.domain, *right);
      return {node.kind == NodeKind::kLess ? a < b : a <= b, {}};
    }
    syntax::Formula tree;
    tree.kind = kind_of(node.kind);
    for (const Term& side : node.terms) tree.terms.push_back(term(side, node.domain));
    return {std::nullopt, std::move(tree)};
  }

  static Part negation(Part part) {
    if (part.truth) return {!*part.truth, {}};
    // x != y reads better than !(x = y).
    if (part.tree.kind == syntax::Kind::kEqual) {
      part.tree.kind = syntax::Kind::kNotEqual;
      return part;
    }
    syntax::Formula tree;
    tree.kind = syntax::Kind::kNot;
    tree.children.push_back(std::move(part.tree));
    return {std::nullopt, std::move(tree)};
  }

  Part junction(const FormulaNode& node) const {
    const bool decisive = node.kind == NodeKind::kOr;
    syntax::Formula tree;
    tree.kind = kind_of(node.kind);
    for (const FormulaNode& child : node.children) {
      Part part = make(child);
      if (!part.truth) {
        tree.children.push_back(std::move(part.tree));
      } else if (*part.truth == decisive) {
        return part;
      }
    }
    if (tree.children.empty()) return {!decisive, {}};
    if (tree.children.size() == 1) return {std::nullopt, std::move(tree.children[0])};
    return {std::nullopt, std::move(tree)};
  }

  Part arrow(const FormulaNode& node) const {
    Part left = make(node.children[0]), right = make(node.children[1]);
    const bool implies = node.kind == NodeKind::kImplies;
    if (left.truth) {
      if (*left.truth) return right;
      return implies ? Part{true, {}} : negation(std::move(right));
    }
    if (right.truth) {
      if (!*right.truth) return negation(std::move(left));
      return implies ? right : left;
    }
    syntax::Formula tree;
    tree.kind = kind_of(node.kind);
    tree.children.push_back(std::move(left.tree));
    tree.children.push_back(std::move(right.tree));
    return {std::nullopt, std::move(tree)};
  }

  // Nothing for a variable.
  std::optional<ConstantIndex> constant(const Term& source) const {
    if (!source.is_variable) return source.index;
    if (constants_[source.index] == kFree) return std::nullopt;
    return static_cast<ConstantIndex>(constants_[source.index]);
  }

  double number(DomainId domain, ConstantIndex constant) const {
    const std::string& name = model_.domain(domain).constants[constant];
    double value = std::numeric_limits<double>::quiet_NaN();
    std::from_chars(name.data(), name.data() + name.size(), value);
    return value;
  }

  syntax::Term variable(std::uint32_t v) const {
    syntax::Term result;
    result.kind = marked_ ? syntax::Term::Kind::kVariable : syntax::Term::Kind::kIdentifier;
    result.name = formula_.variables[v].name;
    return result;
  }

  syntax::Term term(const Term& source, DomainId domain) const {
    const std::optional<ConstantIndex> index = constant(source);
    if (!index) return variable(source.index);
    syntax::Term result;
    result.name = model_.domain(domain).constants[*index];
    // Lower case is a variable to the reader, unless it knows the constant.
    const unsigned char first = result.name.empty() ? 'A' : static_cast<unsigned char>(result.name[0]);
    const bool plain = (first >= 'A' && first <= 'Z') || (first >= '0' && first <= '9') || first == '-' || first == '+';
    if (!plain && !declared_[domain.index()]) result.kind = syntax::Term::Kind::kQuoted;
    return result;
  }

  const Model& model_;
  const Formula& formula_;
  std::vector<std::int64_t> constants_;
  const std::vector<bool>& declared_;
  bool marked_;
};

// Domains whose constants the text lists.
std::vector<bool> declared_domains(const Model& model) {
  std::vector<bool> declared = shared_domains(model);
  for (std::size_t d = 0; d < declared.size(); ++d) declared[d] = declared[d] && !model.domains()[d].constants.empty();
  return declared;
}

TreeMaker::Part part_of_weight(const Model& model, const WeightTable& table, std::size_t weight,
                               const std::vector<bool>& declared) {
  const Formula& formula = model.formula(table.formula(weight));
  std::vector<std::int64_t> constants(formula.variables.size(), TreeMaker::kFree);
  const auto chosen = table.plus_constants(weight);
  std::size_t next = 0;
  for (std::size_t v = 0; v < constants.size(); ++v) {
    if (formula.variables[v].plus) constants[v] = chosen[next++];
  }
  return TreeMaker(model, formula, std::move(constants), declared).make(formula.root);
}

std::string text_of(const TreeMaker::Part& part) {
  if (part.truth) return *part.truth ? "true" : "false";
  return print(part.tree);
}

std::string hard_text(const Model& model, const Formula& formula, const std::vector<bool>& declared) {
  const std::vector<std::int64_t> constants(formula.variables.size(), TreeMaker::kFree);
  return text_of(TreeMaker(model, formula, constants, declared).make(formula.root));
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
  return text_of(part_of_weight(model, table, weight, declared_domains(model)));
}

std::vector<std::string> weight_texts(const Model& model, const WeightTable& table) {
  const std::vector<bool> declared = declared_domains(model);
  std::vector<std::string> texts;
  for (std::size_t w = 0; w < table.size(); ++w) texts.push_back(text_of(part_of_weight(model, table, w, declared)));
  return texts;
}

std::string learned_model_text(const Model& model, const WeightTable& table, std::span<const double> weights,
                               const std::string& heading) {
  std::string text = comment(heading) + "\n";
  const std::vector<bool> declared = declared_domains(model);
  for (std::size_t d = 0; d < model.domains().size(); ++d) {
    if (declared[d]) text += domain_text(model.domains()[d]);
  }
  text += "\n";
  for (const Predicate& predicate : model.predicates()) text += predicate_text(model, predicate);
  std::size_t w = 0;
  for (std::size_t f = 0; f < model.formulas().size(); ++f) {
    const Formula& formula = model.formulas()[f];
    const bool template_formula = std::ranges::any_of(formula.variables, &FormulaVariable::plus);
    text += template_formula || formula.hard ? "\n" : "";
    if (template_formula) text += "// " + formula.text + "\n";
    if (formula.hard) text += hard_text(model, formula, declared) + ".\n";
    for (; w < table.size() && table.formula(w) == FormulaId(f); ++w) {
      const TreeMaker::Part part = part_of_weight(model, table, w, declared);
      if (part.truth) continue;  // of no consequence, and not to be written
      if (formula.fixed) text += "#fixweight\n";
      const std::string body = print(part.tree);
      // A digit would be read on as part of the weight.
      const bool runs_on = std::string_view("+-*/^.0123456789").find(body.front()) != std::string_view::npos;
      text += fmt::format("{}{} {}\n", weights[w], runs_on ? ":" : "", body);
    }
  }
  return text;
}

}  // namespace sherlog
