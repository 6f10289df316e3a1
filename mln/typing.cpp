// Typing of one formula; see typing.h. Three walks: `collect` opens scopes and decides the terms of atoms,
// `decide_comparisons` carries domains across equalities, `build` makes the tree. Recursion is as deep as the parser
// allows formulas to be.
#include "mln/typing.h"

#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <limits>
#include <map>
#include <unordered_map>
#include <utility>

#include "mln/lexer.h"

namespace sherlog {

namespace {

constexpr std::uint32_t kNone = std::numeric_limits<std::uint32_t>::max();

bool is_comparison(syntax::Kind kind) {
  switch (kind) {
    case syntax::Kind::kEqual:
    case syntax::Kind::kNotEqual:
    case syntax::Kind::kLess:
    case syntax::Kind::kLessEqual:
    case syntax::Kind::kGreater:
    case syntax::Kind::kGreaterEqual:
      return true;
    default:
      return false;
  }
}

bool writes_question_marks(const syntax::Formula& node) {
  for (const syntax::Term& term : node.terms) {
    if (term.kind == syntax::Term::Kind::kVariable) return true;
  }
  for (const syntax::Formula& child : node.children) {
    if (writes_question_marks(child)) return true;
  }
  return false;
}

class Typer {
 public:
  Typer(Vocabulary& vocabulary, Diagnostics& diagnostics) : vocabulary_(vocabulary), diagnostics_(diagnostics) {}

  std::optional<TypedFormula> run(const syntax::Formula& formula) {
    question_style_ = writes_question_marks(formula);
    collect(formula);
    decide_comparisons();
    report_variables_without_domain();
    if (failed_) return std::nullopt;
    warn_about_double_names();
    TypedFormula result;
    result.formula.root = build(formula);
    if (failed_) return std::nullopt;
    result.formula.place = formula.place;
    for (Variable& variable : variables_) result.formula.variables.push_back(std::move(variable.typed));
    result.star_atoms = std::move(star_atoms_);
    return result;
  }

 private:
  struct Variable {
    FormulaVariable typed;
    bool has_domain = false;
    bool plain = false;  // written without '?'
    Place domain_place;  // where its domain comes from
    Place place;         // where it is first met
  };
  // One term of an atom or a comparison, in text order.
  struct Slot {
    const syntax::Term* term = nullptr;
    std::uint32_t bound = kNone;     // the enclosing quantifier's variable of that name
    std::uint32_t variable = kNone;  // once decided; kNone: a constant
    DomainId domain;
  };
  struct Comparison {
    std::size_t slot = 0;  // of the left side; the right side follows
    bool decided = false;
  };
  struct Binding {
    std::uint32_t variable;
    bool plain;
  };

  void error(std::string code, const Place& place, std::string text, std::vector<Note> notes = {}) {
    failed_ = true;
    diagnostics_.error(std::move(code), place, std::move(text), std::move(notes));
  }

  void collect(const syntax::Formula& node) {
    if (node.kind == syntax::Kind::kAtom || node.kind == syntax::Kind::kStarAtom) {
      collect_atom(node);
    } else if (is_comparison(node.kind)) {
      comparisons_.push_back({slots_.size(), false});
      for (const syntax::Term& term : node.terms) slots_.push_back(open_slot(term));
    } else if (node.kind == syntax::Kind::kExists || node.kind == syntax::Kind::kForall) {
      collect_quantifier(node);
    } else {
      for (const syntax::Formula& child : node.children) collect(child);
    }
  }

  void collect_atom(const syntax::Formula& node) {
    const std::optional<PredicateId> id = vocabulary_.find_predicate(node.name);
    if (!id) {
      vocabulary_.unknown_predicate(node);
      failed_ = atom_failed_ = true;
      return;
    }
    const Predicate& predicate = vocabulary_.predicate(*id);
    if (predicate.arity() != node.terms.size()) {
      atom_failed_ = true;
      error("arity", node.place,
            fmt::format("predicate '{}' takes {}, {} given", node.name, counted(predicate.arity(), "argument"),
                        node.terms.size()),
            vocabulary_.declaration_note(predicate));
      return;
    }
    if (node.kind == syntax::Kind::kStarAtom) star_atoms_.push_back(atom_count_);
    ++atom_count_;
    for (std::size_t i = 0; i < node.terms.size(); ++i) {
      Slot slot = open_slot(node.terms[i]);
      decide(slot, predicate.domains[i]);
      slots_.push_back(slot);
    }
  }

  void collect_quantifier(const syntax::Formula& node) {
    std::vector<std::uint32_t> bound;
    const std::size_t position = quantifiers_.size();
    quantifiers_.emplace_back();
    std::size_t opened = 0;
    for (const syntax::Term& term : node.terms) {
      if (!check_quantified(term, bound)) continue;
      const std::uint32_t variable = add_variable(term, true);
      scopes_[term.name].push_back({variable, term.kind == syntax::Term::Kind::kIdentifier});
      bound.push_back(variable);
      ++opened;
    }
    quantifiers_[position] = bound;
    for (const syntax::Formula& child : node.children) collect(child);
    for (std::size_t i = 0; i < opened; ++i) scopes_[variables_[bound[i]].typed.name].pop_back();
  }

  bool check_quantified(const syntax::Term& term, const std::vector<std::uint32_t>& before) {
    if (term.kind == syntax::Term::Kind::kQuoted || term.kind == syntax::Term::Kind::kNumber) {
      error("quantifier", term.place, fmt::format("a quantifier binds variables, '{}' is a constant", term.name));
      return false;
    }
    if (term.plus) {
      error("template", term.place, fmt::format("'+{}' cannot be bound by a quantifier", term.name));
      return false;
    }
    for (const std::uint32_t variable : before) {
      if (variables_[variable].typed.name != term.name) continue;
      error("quantifier", term.place, fmt::format("variable '{}' is bound twice", term.name));
      return false;
    }
    return true;
  }

  Slot open_slot(const syntax::Term& term) const {
    Slot slot;
    slot.term = &term;
    const bool plain = term.kind == syntax::Term::Kind::kIdentifier;
    if (!plain && term.kind != syntax::Term::Kind::kVariable) return slot;
    const auto scope = scopes_.find(term.name);
    if (scope == scopes_.end()) return slot;
    for (auto binding = scope->second.rbegin(); binding != scope->second.rend(); ++binding) {
      // A plain name inside EXIST ?x stays a constant; ?x inside EXIST x is that x.
      if (plain && !binding->plain) continue;
      slot.bound = binding->variable;
      break;
    }
    return slot;
  }

  std::uint32_t add_variable(const syntax::Term& term, bool quantified) {
    Variable variable;
    variable.typed.name = term.name;
    variable.typed.quantified = quantified;
    variable.plain = term.kind == syntax::Term::Kind::kIdentifier;
    variable.place = term.place;
    variables_.push_back(std::move(variable));
    return static_cast<std::uint32_t>(variables_.size() - 1);
  }

  std::uint32_t free_variable(const syntax::Term& term) {
    const auto [entry, is_new] = free_.try_emplace(term.name, kNone);
    if (is_new) entry->second = add_variable(term, false);
    return entry->second;
  }

  // Whether the slot is a variable in `domain`; notes names that are both.
  bool is_variable_in(const Slot& slot, DomainId domain) {
    const syntax::Term& term = *slot.term;
    if (term.kind == syntax::Term::Kind::kVariable) return true;
    if (term.kind != syntax::Term::Kind::kIdentifier) return false;
    const bool member = vocabulary_.is_member(domain, term.name);
    if (slot.bound != kNone) {
      if (member) bound_members_.try_emplace(term.name, term.place, domain);
      return true;
    }
    if (member) member_places_.try_emplace(term.name, term.place, domain);
    return !member && !question_style_ && !is_capitalised(term.name);
  }

  // Settles what the term is, given the domain of the place where it stands.
  void decide(Slot& slot, DomainId domain) {
    const syntax::Term& term = *slot.term;
    slot.domain = domain;
    if (!is_variable_in(slot, domain)) {
      if (term.plus) {
        const bool misses_mark =
            question_style_ && !is_capitalised(term.name) && term.kind == syntax::Term::Kind::kIdentifier;
        error("template", term.place,
              fmt::format("'+' needs a variable, '{}' is a constant{}", term.name,
                          misses_mark ? fmt::format("; write '+?{}'", term.name) : ""));
      }
      return;
    }
    slot.variable = slot.bound != kNone ? slot.bound : free_variable(term);
    Variable& variable = variables_[slot.variable];
    if (term.plus) {
      if (variable.typed.quantified) {
        error("template", term.place, fmt::format("'+{}' cannot be bound by a quantifier", term.name));
      }
      variable.typed.plus = true;
    }
    set_domain(variable, domain, term.place);
  }

  void set_domain(Variable& variable, DomainId domain, const Place& place) {
    if (!variable.has_domain) {
      variable.has_domain = true;
      variable.typed.domain = domain;
      variable.domain_place = place;
      return;
    }
    if (variable.typed.domain == domain) return;
    const std::string& first = vocabulary_.domain_name(variable.typed.domain);
    const std::string& second = vocabulary_.domain_name(domain);
    error("type", place,
          fmt::format("variable '{}' stands for '{}' here, but for '{}' elsewhere in the formula", variable.typed.name,
                      second, first),
          {{variable.domain_place, fmt::format("here '{}' stands for '{}'", variable.typed.name, first)}});
  }

  // The domain that a side of a comparison has by itself.
  std::optional<DomainId> own_domain(const Slot& slot) const {
    std::uint32_t index = slot.bound;
    if (index == kNone) {
      const bool can_be_variable = slot.term->kind == syntax::Term::Kind::kVariable ||
                                   (slot.term->kind == syntax::Term::Kind::kIdentifier && !question_style_);
      const auto entry = free_.find(slot.term->name);
      if (!can_be_variable || entry == free_.end()) return std::nullopt;
      index = entry->second;
    }
    if (!variables_[index].has_domain) return std::nullopt;
    return variables_[index].typed.domain;
  }

  bool is_plain_member(const Slot& slot, std::optional<DomainId> domain) const {
    return domain && slot.bound == kNone && slot.term->kind == syntax::Term::Kind::kIdentifier &&
           vocabulary_.is_member(*domain, slot.term->name);
  }

  // Settles both sides if one of them has a domain.
  bool decide_comparison(std::size_t position) {
    Slot& left = slots_[position];
    Slot& right = slots_[position + 1];
    const std::optional<DomainId> left_domain = own_domain(left);
    const std::optional<DomainId> right_domain = own_domain(right);
    if (!left_domain && !right_domain) return false;
    DomainId domain = left_domain ? *left_domain : *right_domain;
    if (is_plain_member(left, right_domain)) domain = *right_domain;
    decide(left, domain);
    decide(right, domain);
    return true;
  }

  void decide_comparisons() {
    bool changed = true;
    while (changed) {
      changed = false;
      for (Comparison& comparison : comparisons_) {
        if (comparison.decided || !decide_comparison(comparison.slot)) continue;
        comparison.decided = changed = true;
      }
    }
    if (atom_failed_) return;
    for (const Comparison& comparison : comparisons_) {
      if (comparison.decided) continue;
      for (std::size_t side = 0; side < 2; ++side) report_no_domain(*slots_[comparison.slot + side].term);
    }
  }

  void report_no_domain(const syntax::Term& term) {
    const bool constant =
        term.kind == syntax::Term::Kind::kQuoted || term.kind == syntax::Term::Kind::kNumber ||
        (term.kind == syntax::Term::Kind::kIdentifier && (question_style_ || is_capitalised(term.name)));
    if (!reported_.insert_or_assign(term.name, true).second) return;
    error(
        "no-domain", term.place,
        fmt::format("{} '{}' has no domain: no predicate gives it one", constant ? "constant" : "variable", term.name));
  }

  void report_variables_without_domain() {
    if (atom_failed_) return;
    for (const Variable& variable : variables_) {
      if (variable.has_domain || reported_.count(variable.typed.name) > 0) continue;
      error("no-domain", variable.place,
            fmt::format("variable '{}' has no domain: the formula that its quantifier binds does not use it",
                        variable.typed.name));
    }
  }

  void warn_about_double_names() {
    for (const auto& [name, member] : bound_members_) {
      diagnostics_.warning("variable-and-constant", member.first,
                           fmt::format("'{}' is a variable here, but also a constant of domain '{}'", name,
                                       vocabulary_.domain_name(member.second)));
    }
    for (const auto& [name, member] : member_places_) {
      for (const Variable& variable : variables_) {
        if (!variable.plain || variable.typed.name != name) continue;
        diagnostics_.warning(
            "variable-and-constant", member.first,
            fmt::format("'{}' is a constant of domain '{}' here, but a variable elsewhere in the formula", name,
                        vocabulary_.domain_name(member.second)),
            {{variable.place, fmt::format("here '{}' is a variable", name)}});
        break;
      }
    }
  }

  Term build_term() {
    const Slot& slot = slots_[next_slot_++];
    if (slot.variable != kNone) return Term::variable(slot.variable);
    const std::optional<ConstantIndex> constant = vocabulary_.constant(slot.domain, *slot.term);
    if (!constant) failed_ = true;
    return Term::constant(constant.value_or(0));
  }

  FormulaNode build_atom(const syntax::Formula& node) {
    FormulaNode result;
    result.kind = NodeKind::kAtom;
    result.place = node.place;
    result.predicate = *vocabulary_.find_predicate(node.name);
    result.terms.reserve(node.terms.size());
    for (std::size_t i = 0; i < node.terms.size(); ++i) result.terms.push_back(build_term());
    return result;
  }

  FormulaNode build_comparison(const syntax::Formula& node) {
    FormulaNode result;
    result.place = node.place;
    result.domain = slots_[next_slot_].domain;
    const bool equality = node.kind == syntax::Kind::kEqual || node.kind == syntax::Kind::kNotEqual;
    for (const syntax::Term& term : node.terms) {
      result.terms.push_back(build_term());
      if (equality || result.terms.back().is_variable || numeric_value(term.name)) continue;
      error("not-numeric", term.place, fmt::format("'{}' is not a number and cannot be compared", term.name));
    }
    const bool strict = node.kind == syntax::Kind::kLess || node.kind == syntax::Kind::kGreater;
    result.kind = equality ? NodeKind::kEqual : strict ? NodeKind::kLess : NodeKind::kLessEqual;
    if (node.kind == syntax::Kind::kGreater || node.kind == syntax::Kind::kGreaterEqual) {
      std::swap(result.terms[0], result.terms[1]);
    }
    if (node.kind != syntax::Kind::kNotEqual) return result;
    FormulaNode negation;
    negation.kind = NodeKind::kNot;
    negation.place = node.place;
    negation.children.push_back(std::move(result));
    return negation;
  }

  static NodeKind connective(syntax::Kind kind) {
    switch (kind) {
      case syntax::Kind::kNot:
        return NodeKind::kNot;
      case syntax::Kind::kAnd:
        return NodeKind::kAnd;
      case syntax::Kind::kOr:
        return NodeKind::kOr;
      case syntax::Kind::kImplies:
        return NodeKind::kImplies;
      case syntax::Kind::kIff:
        return NodeKind::kIff;
      case syntax::Kind::kForall:
        return NodeKind::kForall;
      default:
        return NodeKind::kExists;
    }
  }

  FormulaNode build(const syntax::Formula& node) {
    if (node.kind == syntax::Kind::kAtom || node.kind == syntax::Kind::kStarAtom) return build_atom(node);
    if (is_comparison(node.kind)) return build_comparison(node);
    FormulaNode result;
    result.kind = connective(node.kind);
    result.place = node.place;
    if (result.kind == NodeKind::kExists || result.kind == NodeKind::kForall) {
      result.bound = quantifiers_[next_quantifier_++];
    }
    const bool flat = result.kind == NodeKind::kAnd || result.kind == NodeKind::kOr;
    for (const syntax::Formula& child : node.children) {
      FormulaNode built = build(child);
      if (flat && built.kind == result.kind) {
        for (FormulaNode& grandchild : built.children) result.children.push_back(std::move(grandchild));
      } else {
        result.children.push_back(std::move(built));
      }
    }
    return result;
  }

  Vocabulary& vocabulary_;
  Diagnostics& diagnostics_;
  bool question_style_ = false;  // plain names are constants, because variables are written ?x
  bool failed_ = false;
  bool atom_failed_ = false;  // domains are missing for that reason alone: no message about them
  std::vector<Variable> variables_;
  std::vector<Slot> slots_;
  std::vector<Comparison> comparisons_;
  std::vector<std::vector<std::uint32_t>> quantifiers_;  // bound variables of each quantifier in text order
  std::unordered_map<std::string, std::vector<Binding>> scopes_;
  std::unordered_map<std::string, std::uint32_t> free_;
  std::map<std::string, std::pair<Place, DomainId>> member_places_;  // plain names decided to be constants
  std::map<std::string, std::pair<Place, DomainId>> bound_members_;  // bound names that are constants too
  std::map<std::string, bool> reported_;
  std::vector<std::size_t> star_atoms_;
  std::size_t atom_count_ = 0;
  std::size_t next_slot_ = 0;
  std::size_t next_quantifier_ = 0;
};

}  // namespace

std::optional<TypedFormula> type_formula(const syntax::Formula& formula, Vocabulary& vocabulary,
                                         Diagnostics& diagnostics) {
  return Typer(vocabulary, diagnostics).run(formula);
}

std::optional<double> numeric_value(std::string_view constant) {
  if (!constant.empty() && constant.front() == '+') constant.remove_prefix(1);
  double value = 0.0;
  const auto [end, failure] = std::from_chars(constant.data(), constant.data() + constant.size(), value);
  if (failure != std::errc() || end != constant.data() + constant.size() || !std::isfinite(value)) return std::nullopt;
  return value;
}

std::string suggestion(std::string_view name, const std::vector<std::string>& candidates) {
  const std::string near = did_you_mean(name, candidates);
  return near.empty() ? "" : fmt::format("; did you mean '{}'?", near);
}

std::vector<Note> declaration_note(const Model& model, const Diagnostics& diagnostics, const Place& place,
                                   std::string_view name) {
  if (&model.sources() != &diagnostics.sources()) return {};
  return {{place, fmt::format("'{}' is declared here", name)}};
}

std::string counted(std::size_t count, std::string_view noun) {
  return fmt::format("{} {}{}", count, noun, count == 1 ? "" : "s");
}

}  // namespace sherlog
