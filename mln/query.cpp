// Query texts to items. Everything but a bare predicate name goes through the parser of formulas: a single positive atom is
// a pattern, anything else a formula that is typed as in models (typing.h), with the evidence's constants known.
#include "mln/query.h"

#include <algorithm>
#include <unordered_map>
#include <utility>

#include <fmt/format.h>

#include "mln/lexer.h"
#include "mln/parser.h"
#include "mln/printer.h"
#include "mln/typing.h"

namespace sherlog {

namespace {

const char* const kSourceName = "query";

class QueryVocabulary : public Vocabulary {
 public:
  QueryVocabulary(const Model& model, const Evidence& evidence, Diagnostics& diagnostics)
      : model_(model), evidence_(evidence), diagnostics_(diagnostics) {}

  std::optional<PredicateId> find_predicate(std::string_view name) const override {
    return model_.find_predicate(name);
  }
  const Predicate& predicate(PredicateId id) const override { return model_.predicate(id); }
  const std::string& domain_name(DomainId id) const override { return model_.domain(id).name; }
  bool is_member(DomainId domain, const std::string& name) const override {
    return evidence_.find_constant(model_, domain, name).has_value();
  }

  std::optional<ConstantIndex> constant(DomainId domain, const syntax::Term& term) override {
    const std::optional<ConstantIndex> known = evidence_.find_constant(model_, domain, term.name);
    if (!known) {
      std::vector<std::string> names = model_.domain(domain).constants;
      const std::vector<std::string>& added = evidence_.added_constants(domain);
      names.insert(names.end(), added.begin(), added.end());
      diagnostics_.error("unknown-constant", term.place,
                         fmt::format("'{}' is no constant of domain '{}'{}", term.name, domain_name(domain),
                                     suggestion(term.name, names)));
    }
    return known;
  }

  std::vector<Note> declaration_note(const Predicate& predicate) const override {
    return sherlog::declaration_note(model_, diagnostics_, predicate.place, predicate.name);
  }

  void unknown_predicate(const syntax::Formula& atom) override { report_unknown(atom.name, atom.place); }

  void report_unknown(const std::string& name, const Place& place) {
    std::vector<std::string> names;
    for (const Predicate& predicate : model_.predicates()) names.push_back(predicate.name);
    diagnostics_.error("unknown-predicate", place,
                       fmt::format("predicate '{}' is not declared{}", name, suggestion(name, names)));
  }

 private:
  const Model& model_;
  const Evidence& evidence_;
  Diagnostics& diagnostics_;
};

std::string_view trimmed(std::string_view text) {
  constexpr std::string_view kBlank = " \t\r\n\f\v";
  const std::size_t begin = text.find_first_not_of(kBlank);
  if (begin == std::string_view::npos) return {};
  return text.substr(begin, text.find_last_not_of(kBlank) - begin + 1);
}

bool is_quantifier(const Token& token) {
  if (token.kind == TokenKind::kExists || token.kind == TokenKind::kForall) return true;
  if (token.kind != TokenKind::kName || token.text.size() > 6) return false;
  std::string word(token.text);
  std::transform(word.begin(), word.end(), word.begin(),
                 [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c; });
  return word == "exist" || word == "exists" || word == "forall";
}

// The items of one text: commas separate them outside brackets, quotes and the variables of a quantifier.
std::vector<std::string_view> split_items(std::string_view text) {
  enum class Inside { kFormula, kQuantifier, kQuantifiedVariable };
  std::vector<std::string_view> items;
  std::size_t begin = 0;
  int depth = 0;
  Inside inside = Inside::kFormula;
  Lexer lexer(text);
  for (Token token = lexer.next(); token.kind != TokenKind::kEnd; token = lexer.next()) {
    const bool name = token.kind == TokenKind::kName || token.kind == TokenKind::kVariable;
    if (token.kind == TokenKind::kOpen) ++depth;
    if (token.kind == TokenKind::kClose) --depth;
    if (token.kind == TokenKind::kComma && depth <= 0 && inside != Inside::kQuantifiedVariable) {
      items.push_back(trimmed(text.substr(begin, token.begin - begin)));
      begin = token.end;
    }
    if (inside == Inside::kQuantifiedVariable && token.kind == TokenKind::kComma) {
      inside = Inside::kQuantifier;
    } else if (inside == Inside::kQuantifier && name) {
      inside = Inside::kQuantifiedVariable;
    } else {
      inside = is_quantifier(token) ? Inside::kQuantifier : Inside::kFormula;
    }
  }
  items.push_back(trimmed(text.substr(begin)));
  return items;
}

class QueryParser {
 public:
  QueryParser(const Model& model, const Evidence& evidence, Diagnostics& diagnostics)
      : model_(model), diagnostics_(diagnostics), vocabulary_(model, evidence, diagnostics) {}

  std::optional<QueryItem> parse(std::string_view text) {
    if (text.empty()) {
      diagnostics_.error("syntax", place_of(text), "a query item is empty");
      return std::nullopt;
    }
    std::optional<QueryItem> item = is_name(text) ? parse_predicate(text) : parse_rest(text);
    if (item) item->text = std::string(text);
    return item;
  }

 private:
  Place place_of(std::string_view text) {
    Place place;
    place.file = diagnostics_.sources().add(kSourceName, std::string(text));
    place.line = place.column = 1;
    place.length = static_cast<std::uint32_t>(std::max<std::size_t>(1, code_point_count(text)));
    return place;
  }

  std::optional<QueryItem> parse_predicate(std::string_view name) {
    const std::optional<PredicateId> id = model_.find_predicate(name);
    if (!id) {
      vocabulary_.report_unknown(std::string(name), place_of(name));
      return std::nullopt;
    }
    QueryItem item;
    item.predicate = *id;
    item.pattern_variables = static_cast<std::uint32_t>(model_.predicate(*id).arity());
    for (std::uint32_t i = 0; i < item.pattern_variables; ++i) item.pattern.push_back(Term::variable(i));
    return item;
  }

  std::optional<QueryItem> parse_rest(std::string_view text) {
    const std::optional<syntax::Formula> parsed = parse_formula(text, kSourceName, diagnostics_);
    if (!parsed) return std::nullopt;
    if (parsed->kind == syntax::Kind::kStarAtom) return refuse_star(*parsed);
    std::optional<TypedFormula> typed = type_formula(*parsed, vocabulary_, diagnostics_);
    if (!typed) return std::nullopt;
    const auto plus = std::find_if(typed->formula.variables.begin(), typed->formula.variables.end(),
                                   [](const FormulaVariable& variable) { return variable.plus; });
    if (plus != typed->formula.variables.end()) {
      diagnostics_.error("template", parsed->place, fmt::format("'+{}' has no meaning in a query", plus->name));
      return std::nullopt;
    }
    if (parsed->kind == syntax::Kind::kAtom) return pattern_item(*typed);
    return formula_item(*parsed, *typed);
  }

  std::optional<QueryItem> refuse_star(const syntax::Formula& formula) {
    diagnostics_.error("template", formula.place, "'*' has no meaning in a query");
    return std::nullopt;
  }

  static std::optional<QueryItem> pattern_item(const TypedFormula& typed) {
    QueryItem item;
    item.predicate = typed.formula.root.predicate;
    item.pattern = typed.formula.root.terms;
    item.pattern_variables = static_cast<std::uint32_t>(typed.formula.variables.size());
    return item;
  }

  std::optional<QueryItem> formula_item(const syntax::Formula& parsed, TypedFormula& typed) {
    if (!typed.star_atoms.empty()) return refuse_star(parsed);
    for (const FormulaVariable& variable : typed.formula.variables) {
      if (variable.quantified) continue;
      diagnostics_.error("free-variable", parsed.place,
                         fmt::format("variable '{0}' is free in a queried formula; bind it: EXIST {0} (...) or FORALL {0} (...)",
                                     variable.name));
      return std::nullopt;
    }
    QueryItem item;
    item.kind = QueryItem::Kind::kFormula;
    item.formula = std::move(typed.formula);
    item.formula.text = print(parsed);
    return item;
  }

  const Model& model_;
  Diagnostics& diagnostics_;
  QueryVocabulary vocabulary_;
};

}  // namespace

std::optional<Query> parse_query(const Model& model, const Evidence& evidence, const std::vector<std::string>& texts,
                                 Diagnostics& diagnostics) {
  const std::size_t errors_before = diagnostics.error_count();
  QueryParser parser(model, evidence, diagnostics);
  Query query;
  for (const std::string& text : texts) {
    for (const std::string_view item : split_items(text)) {
      std::optional<QueryItem> parsed = parser.parse(item);
      if (parsed) query.items.push_back(std::move(*parsed));
    }
  }
  if (diagnostics.error_count() > errors_before) return std::nullopt;
  return query;
}

}  // namespace sherlog
