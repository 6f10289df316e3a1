// From syntax trees to a Model: declarations first, then every formula is typed against them (typing.h), then the whole
// is checked (checks.h). All messages are collected; a model with errors is not handed out.
#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <set>
#include <utility>

#include "mln/checks.h"
#include "mln/model.h"
#include "mln/parser.h"
#include "mln/printer.h"
#include "mln/typing.h"

namespace sherlog {

namespace {

constexpr std::int64_t kMaxRange = 10'000'000;  // constants of one range
constexpr std::size_t kMaxStarAtoms = 10;       // in one formula: it stands for 2^k formulas

// A *P(...) atom becomes P(...) or !P(...), by the next of `negative`.
void settle_stars(syntax::Formula& node, const std::vector<bool>& negative, std::size_t& next) {
  for (syntax::Formula& child : node.children) settle_stars(child, negative, next);
  if (node.kind != syntax::Kind::kStarAtom) return;
  node.kind = syntax::Kind::kAtom;
  if (!negative[next++]) return;
  syntax::Formula negation;
  negation.kind = syntax::Kind::kNot;
  negation.place = node.place;
  negation.children.push_back(std::move(node));
  node = std::move(negation);
}

// Negates the atoms (counted in text order by `next`) that `negative` names.
void negate_atoms(FormulaNode& node, const std::set<std::size_t>& negative, std::size_t& next) {
  for (FormulaNode& child : node.children) negate_atoms(child, negative, next);
  if (node.kind != NodeKind::kAtom || negative.count(next++) == 0) return;
  FormulaNode negation;
  negation.kind = NodeKind::kNot;
  negation.place = node.place;
  negation.children.push_back(std::move(node));
  node = std::move(negation);
}

std::optional<std::int64_t> whole_number(std::string_view text) {
  if (!text.empty() && text.front() == '+') text.remove_prefix(1);
  std::int64_t value = 0;
  const auto [end, failure] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (failure != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return value;
}

}  // namespace

class ModelBuilder : public Vocabulary {
 public:
  // `partial`: parts of the text were not understood, so what seems missing may be there.
  ModelBuilder(Diagnostics& diagnostics, bool partial) : diagnostics_(diagnostics), partial_(partial) {}

  std::optional<Model> build(const syntax::Model& parsed) {
    const std::size_t errors_before = diagnostics_.error_count();
    for (const syntax::Statement& statement : parsed.statements) {
      if (const auto* domain = std::get_if<syntax::DomainDeclaration>(&statement)) declare_domain(*domain);
    }
    for (const syntax::Statement& statement : parsed.statements) {
      if (const auto* predicate = std::get_if<syntax::PredicateDeclaration>(&statement)) declare_predicate(*predicate);
    }
    for (const Predicate& predicate : model_.predicates_) predicate_names_.push_back(predicate.name);
    for (const syntax::Statement& statement : parsed.statements) {
      if (const auto* formula = std::get_if<syntax::WeightedFormula>(&statement)) add_formula(*formula);
    }
    if (partial_ || diagnostics_.error_count() > errors_before) return std::nullopt;
    check_model(model_, diagnostics_);
    if (diagnostics_.error_count() > errors_before) return std::nullopt;
    model_.sources_ = diagnostics_.shared_sources();
    return std::move(model_);
  }

  std::optional<PredicateId> find_predicate(std::string_view name) const override {
    return model_.find_predicate(name);
  }
  const Predicate& predicate(PredicateId id) const override { return model_.predicate(id); }
  const std::string& domain_name(DomainId id) const override { return model_.domain(id).name; }
  bool is_member(DomainId domain, const std::string& name) const override {
    const Domain& members = model_.domain(domain);
    if (members.declared_count == 0) return false;
    const auto entry = members.index.find(name);
    return entry != members.index.end() && entry->second < members.declared_count;
  }

  std::optional<ConstantIndex> constant(DomainId id, const syntax::Term& term) override {
    Domain& domain = model_.domains_[id.index()];
    const auto [entry, is_new] =
        domain.index.try_emplace(term.name, static_cast<ConstantIndex>(domain.constants.size()));
    if (!is_new) return entry->second;
    if (domain.declared) {
      // Only constants that could be meant are suggested, and only while somebody may read it.
      const bool shown = diagnostics_.warning_count() < Diagnostics::kMaxShown;
      diagnostics_.warning("widened-domain", term.place,
                           fmt::format("'{}' is not among the declared constants of domain '{}' and is added{}",
                                       term.name, domain.name, shown ? suggestion(term.name, domain.constants) : ""),
                           {{domain.place, fmt::format("'{}' is declared here", domain.name)}});
    }
    domain.constants.push_back(term.name);
    return entry->second;
  }

  std::vector<Note> declaration_note(const Predicate& predicate) const override {
    return {{predicate.place, fmt::format("'{}' is declared here", predicate.name)}};
  }

  void unknown_predicate(const syntax::Formula& atom) override {
    if (partial_) return;
    diagnostics_.error(
        "unknown-predicate", atom.place,
        fmt::format("predicate '{}' is not declared{}", atom.name, suggestion(atom.name, predicate_names_)));
  }

 private:
  DomainId domain_named(const std::string& name, const Place& place) {
    const auto [entry, is_new] = model_.domain_index_.try_emplace(name, DomainId(model_.domains_.size()));
    if (is_new) {
      Domain domain;
      domain.name = name;
      domain.place = place;
      model_.domains_.push_back(std::move(domain));
    }
    return entry->second;
  }

  // The constants that a declaration lists, each with the term it comes from.
  std::optional<std::vector<std::string>> listed_constants(const syntax::DomainDeclaration& declaration) {
    std::vector<std::string> constants;
    if (!declaration.range) {
      constants.reserve(declaration.constants.size());
      for (const syntax::Term& term : declaration.constants) constants.push_back(term.name);
      return constants;
    }
    if (declaration.constants.size() != 2) return std::nullopt;
    const std::string& low = declaration.constants[0].name;
    const std::string& high = declaration.constants[1].name;
    const std::optional<std::int64_t> first = whole_number(low);
    const std::optional<std::int64_t> last = whole_number(high);
    if (!first || !last) {
      const syntax::Term& wrong = declaration.constants[first ? 1 : 0];
      diagnostics_.error("range", wrong.place, fmt::format("a range needs whole numbers, '{}' is none", wrong.name));
      return std::nullopt;
    }
    if (*last < *first) {
      diagnostics_.error("range", declaration.place, fmt::format("range from {} to {} is empty", low, high));
      return std::nullopt;
    }
    // Unsigned, as the distance may not fit into a signed number.
    const std::uint64_t distance = static_cast<std::uint64_t>(*last) - static_cast<std::uint64_t>(*first);
    if (distance >= static_cast<std::uint64_t>(kMaxRange)) {
      diagnostics_.error("range", declaration.place,
                         fmt::format("range from {} to {} has more than {} constants", low, high, kMaxRange));
      return std::nullopt;
    }
    constants.reserve(distance + 1);
    for (std::int64_t value = *first; value < *last; ++value) constants.push_back(std::to_string(value));
    constants.push_back(std::to_string(*last));
    return constants;
  }

  void declare_domain(const syntax::DomainDeclaration& declaration) {
    std::optional<std::vector<std::string>> constants = listed_constants(declaration);
    if (!constants) return;
    Domain& domain = model_.domains_[domain_named(declaration.name, declaration.place).index()];
    if (domain.declared) {
      const std::set<std::string> before(domain.constants.begin(), domain.constants.end());
      const std::set<std::string> now(constants->begin(), constants->end());
      if (before == now) return;
      diagnostics_.error("redeclared", declaration.place,
                         fmt::format("domain '{}' is declared with other constants elsewhere", domain.name),
                         {{domain.place, fmt::format("'{}' is declared here", domain.name)}});
      return;
    }
    domain.declared = true;
    domain.place = declaration.place;
    for (std::size_t i = 0; i < constants->size(); ++i) {
      std::string& name = (*constants)[i];
      const auto index = static_cast<ConstantIndex>(domain.constants.size());
      if (domain.index.try_emplace(name, index).second) {
        domain.constants.push_back(std::move(name));
      } else {
        diagnostics_.warning("duplicate-constant", declaration.constants[i].place,
                             fmt::format("constant '{}' is listed twice in domain '{}'", name, domain.name));
      }
    }
    domain.declared_count = domain.constants.size();
  }

  void declare_predicate(const syntax::PredicateDeclaration& declaration) {
    Predicate predicate;
    predicate.name = declaration.name;
    predicate.closed = declaration.closed;
    predicate.place = declaration.place;
    for (const syntax::Argument& argument : declaration.arguments) {
      predicate.domains.push_back(domain_named(argument.domain, argument.place));
      predicate.marked.push_back(argument.mark != 0);
      if (argument.mark == 0) continue;
      const BlockKind block = argument.mark == '!' ? BlockKind::kExactlyOne : BlockKind::kAtMostOne;
      if (predicate.block != BlockKind::kNone && predicate.block != block) {
        diagnostics_.error("mixed-marks", argument.place,
                           fmt::format("predicate '{}' marks arguments with both '!' and '?'", predicate.name));
        return;
      }
      predicate.block = block;
    }
    const auto [entry, is_new] =
        model_.predicate_index_.try_emplace(predicate.name, PredicateId(model_.predicates_.size()));
    if (is_new) {
      model_.predicates_.push_back(std::move(predicate));
      return;
    }
    const Predicate& before = model_.predicate(entry->second);
    if (before.domains == predicate.domains && before.marked == predicate.marked && before.block == predicate.block &&
        before.closed == predicate.closed) {
      return;
    }
    diagnostics_.error("redeclared", predicate.place,
                       fmt::format("predicate '{}' is declared differently elsewhere", predicate.name),
                       {{before.place, fmt::format("'{}' is declared here", predicate.name)}});
  }

  void add_formula(const syntax::WeightedFormula& statement) {
    const std::size_t errors_before = diagnostics_.error_count();
    std::optional<TypedFormula> typed = type_formula(statement.formula, *this, diagnostics_);
    if (statement.weight && !statement.hard && !std::isfinite(*statement.weight)) {
      diagnostics_.error("weight", statement.place, "a weight is a finite number; a hard formula ends in '.'");
    }
    if (!typed) return;
    Formula& formula = typed->formula;
    formula.place = statement.formula.place.line != 0 ? statement.formula.place : statement.place;
    formula.hard = statement.hard || statement.negated;
    formula.fixed = statement.fixed;
    formula.has_weight = statement.weight.has_value() || formula.hard;
    formula.weight = statement.weight && !formula.hard ? *statement.weight : 0.0;
    if (!statement.unique.empty()) add_unique_group(statement, formula);
    if (typed->star_atoms.size() > kMaxStarAtoms) {
      diagnostics_.error(
          "template", statement.place,
          fmt::format("formula has {} '*' atoms and would stand for 2^{} formulas; at most {} are allowed",
                      typed->star_atoms.size(), typed->star_atoms.size(), kMaxStarAtoms));
    }
    if (diagnostics_.error_count() > errors_before) return;
    if (!formula.has_weight && !partial_) {
      diagnostics_.warning("no-weight", formula.place,
                           "formula has neither a weight nor a final '.': its weight is taken to be 0");
    }
    add_expansions(statement, *typed);
  }

  void add_unique_group(const syntax::WeightedFormula& statement, Formula& formula) {
    std::vector<std::uint32_t> group;
    const auto fail = [&](std::string text) { diagnostics_.error("unique", statement.place, std::move(text)); };
    for (const std::string& written : statement.unique) {
      const std::string name = written.substr(std::min(written.find_first_not_of("+?"), written.size()));
      const auto found = std::find_if(formula.variables.begin(), formula.variables.end(),
                                      [&](const FormulaVariable& v) { return v.name == name && !v.quantified; });
      if (found == formula.variables.end())
        return fail(fmt::format("'{}' in #unique is no variable of the formula", name));
      if (!found->plus) return fail(fmt::format("'{}' in #unique is not written '+{}' in the formula", name, name));
      const auto index = static_cast<std::uint32_t>(found - formula.variables.begin());
      if (std::find(group.begin(), group.end(), index) != group.end()) {
        return fail(fmt::format("'{}' stands twice in #unique", name));
      }
      if (!group.empty() && formula.variables[group.front()].domain != found->domain) {
        return fail(fmt::format("'{}' and '{}' in #unique have different domains, '{}' and '{}'",
                                formula.variables[group.front()].name, name,
                                domain_name(formula.variables[group.front()].domain), domain_name(found->domain)));
      }
      group.push_back(index);
    }
    if (group.size() < 2) return fail("#unique needs at least two variables");
    formula.unique.push_back(std::move(group));
  }

  // One formula for each combination of signs of the '*' atoms: the last one changes fastest, positive first.
  void add_expansions(const syntax::WeightedFormula& statement, const TypedFormula& typed) {
    const std::size_t stars = typed.star_atoms.size();
    for (std::size_t signs = 0; signs < (std::size_t{1} << stars); ++signs) {
      std::vector<bool> negative(stars);
      std::set<std::size_t> negated_atoms;
      for (std::size_t i = 0; i < stars; ++i) {
        negative[i] = ((signs >> (stars - 1 - i)) & 1u) != 0;
        if (negative[i]) negated_atoms.insert(typed.star_atoms[i]);
      }
      Formula formula = typed.formula;
      std::size_t next = 0;
      if (stars > 0) negate_atoms(formula.root, negated_atoms, next);
      syntax::Formula text = statement.formula;
      next = 0;
      if (stars > 0) settle_stars(text, negative, next);
      if (statement.negated) negate(formula, text);
      formula.text = print(text);
      model_.formulas_.push_back(std::move(formula));
    }
  }

  static void negate(Formula& formula, syntax::Formula& text) {
    FormulaNode root;
    root.kind = NodeKind::kNot;
    root.place = formula.root.place;
    root.children.push_back(std::move(formula.root));
    formula.root = std::move(root);
    syntax::Formula negation;
    negation.kind = syntax::Kind::kNot;
    negation.place = text.place;
    negation.children.push_back(std::move(text));
    text = std::move(negation);
  }

  Diagnostics& diagnostics_;
  bool partial_;
  Model model_;
  std::vector<std::string> predicate_names_;
};

std::optional<Model> resolve(const syntax::Model& parsed, Diagnostics& diagnostics) {
  return ModelBuilder(diagnostics, false).build(parsed);
}

std::optional<Model> parse_model(std::string_view text, const std::string& name, Diagnostics& diagnostics) {
  const std::size_t errors_before = diagnostics.error_count();
  const syntax::Model parsed = parse_syntax(text, name, diagnostics);
  return ModelBuilder(diagnostics, diagnostics.error_count() > errors_before).build(parsed);
}

std::optional<Model> parse_model_file(const std::string& path, Diagnostics& diagnostics) {
  return parse_model_files({path}, diagnostics);
}

std::optional<Model> parse_model_files(const std::vector<std::string>& paths, Diagnostics& diagnostics) {
  const std::size_t errors_before = diagnostics.error_count();
  syntax::Model all;
  for (const std::string& path : paths) {
    const std::optional<std::string> text = read_text_file(path, diagnostics);
    if (!text) continue;
    syntax::Model parsed = parse_syntax(*text, path, diagnostics);
    std::move(parsed.statements.begin(), parsed.statements.end(), std::back_inserter(all.statements));
    all.depth.insert(all.depth.end(), parsed.depth.begin(), parsed.depth.end());
  }
  return ModelBuilder(diagnostics, diagnostics.error_count() > errors_before).build(all);
}

}  // namespace sherlog
