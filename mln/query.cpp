// Query texts to items. Everything but a bare predicate name goes through the parser of formulas: a single positive atom is
// a pattern, anything else a formula that is typed as in models (typing.h), with the evidence's constants known. An item is
// understood once, and then put into the numbers of each database.
#include "mln/query.h"

#include <fmt/format.h>

#include <algorithm>
#include <set>
#include <utility>

#include "mln/checks.h"
#include "mln/lexer.h"
#include "mln/parser.h"
#include "mln/printer.h"
#include "mln/typing.h"

namespace sherlog {

namespace {

const char* const kSourceName = "query";

// A constant in a query: which number it has differs from database to database.
struct NamedConstant {
  DomainId domain;
  std::string name;
  Place place;
};

// Constants are numbered as they are met; QueryParser::place_in gives them a database's numbers afterwards. A plain name that
// one database knows is a constant in all of them: a query means the same everywhere.
class QueryVocabulary : public Vocabulary {
 public:
  QueryVocabulary(const Model& model, std::span<const Evidence> databases, Diagnostics& diagnostics)
      : model_(model), databases_(databases), diagnostics_(diagnostics) {}

  std::optional<PredicateId> find_predicate(std::string_view name) const override {
    return model_.find_predicate(name);
  }
  const Predicate& predicate(PredicateId id) const override { return model_.predicate(id); }
  const std::string& domain_name(DomainId id) const override { return model_.domain(id).name; }
  bool is_member(DomainId domain, const std::string& name) const override {
    return std::any_of(databases_.begin(), databases_.end(), [&](const Evidence& evidence) {
      return evidence.find_constant(model_, domain, name).has_value();
    });
  }

  std::optional<ConstantIndex> constant(DomainId domain, const syntax::Term& term) override {
    if (!is_member(domain, term.name)) {
      std::vector<std::string> names = model_.domain(domain).constants;
      for (const Evidence& evidence : databases_) {
        const std::vector<std::string>& added = evidence.added_constants(domain);
        names.insert(names.end(), added.begin(), added.end());
      }
      diagnostics_.error("unknown-constant", term.place,
                         fmt::format("'{}' is no constant of domain '{}'{}", term.name, domain_name(domain),
                                     suggestion(term.name, names)));
      return std::nullopt;
    }
    constants_.push_back({domain, term.name, term.place});
    return static_cast<ConstantIndex>(constants_.size() - 1);
  }
  std::vector<NamedConstant> take_constants() { return std::exchange(constants_, {}); }

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
  std::span<const Evidence> databases_;
  Diagnostics& diagnostics_;
  std::vector<NamedConstant> constants_;
};

void replace_constants(FormulaNode& node, std::span<const ConstantIndex> constants) {
  for (Term& term : node.terms) {
    if (!term.is_variable) term.index = constants[term.index];
  }
  for (FormulaNode& child : node.children) replace_constants(child, constants);
}

// "database 2", "databases 1 and 3", "37 of 50 databases": `missing` counts from 0.
std::string databases_text(const std::vector<std::size_t>& missing, std::size_t count) {
  constexpr std::size_t kMostNamed = 5;
  if (missing.size() > kMostNamed) return fmt::format("{} of {} databases", missing.size(), count);
  std::string text = missing.size() == 1 ? "database " : "databases ";
  for (std::size_t i = 0; i < missing.size(); ++i) {
    if (i > 0) text += i + 1 == missing.size() ? " and " : ", ";
    text += std::to_string(missing[i] + 1);
  }
  return text;
}

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
  QueryParser(const Model& model, std::span<const Evidence> databases, Diagnostics& diagnostics)
      : model_(model), databases_(databases), diagnostics_(diagnostics), vocabulary_(model, databases, diagnostics) {}

  // Appends the item to each database's query. After an error nothing is appended.
  void parse(std::string_view text, std::vector<Query>& queries) {
    if (text.empty()) {
      diagnostics_.error("syntax", place_of(text), "a query item is empty");
      return;
    }
    std::optional<QueryItem> item = is_name(text) ? parse_predicate(text) : parse_rest(text);
    const std::vector<NamedConstant> constants = vocabulary_.take_constants();
    if (!item) return;
    item->text = std::string(text);
    if (!compares_numbers(*item)) return;
    for (std::size_t d = 0; d < databases_.size(); ++d)
      queries[d].items.push_back(place_in(databases_[d], *item, constants));
    warn_of_absent(*item, constants);
  }

 private:
  Place place_of(std::string_view text) {
    Place place;
    place.file = diagnostics_.sources().add(kSourceName, std::string(text));
    place.line = place.column = 1;
    place.length = static_cast<std::uint32_t>(std::max<std::size_t>(1, code_point_count(text)));
    return place;
  }

  // The item with the database's numbers of its constants.
  QueryItem place_in(const Evidence& evidence, QueryItem item, const std::vector<NamedConstant>& constants) const {
    std::vector<ConstantIndex> numbers;
    for (const NamedConstant& constant : constants) {
      const std::optional<ConstantIndex> known = evidence.find_constant(model_, constant.domain, constant.name);
      item.absent = item.absent || !known;
      numbers.push_back(known.value_or(0));
    }
    for (Term& term : item.pattern) {
      if (!term.is_variable) term.index = numbers[term.index];
    }
    replace_constants(item.formula.root, numbers);
    return item;
  }

  void warn_of_absent(const QueryItem& item, const std::vector<NamedConstant>& constants) {
    std::set<std::pair<std::uint32_t, std::string>> seen;
    for (const NamedConstant& constant : constants) {
      if (!seen.emplace(constant.domain.value, constant.name).second) continue;
      std::vector<std::size_t> missing;
      for (std::size_t d = 0; d < databases_.size(); ++d) {
        if (!databases_[d].find_constant(model_, constant.domain, constant.name)) missing.push_back(d);
      }
      if (missing.empty()) continue;
      diagnostics_.warning(
          "unknown-constant", constant.place,
          fmt::format("'{}' is no constant of domain '{}' in {}: there '{}' has no answer", constant.name,
                      vocabulary_.domain_name(constant.domain), databases_text(missing, databases_.size()), item.text));
    }
  }

  // '<' and its like need numbers, those that the databases add included.
  bool compares_numbers(const QueryItem& item) {
    std::vector<std::optional<Place>> places(model_.domains().size());
    add_compared_domains(item.formula.root, places);
    for (std::uint32_t d = 0; d < places.size(); ++d) {
      if (!places[d]) continue;
      const DomainId domain(d);
      std::vector<const std::vector<std::string>*> lists{&model_.domain(domain).constants};
      for (const Evidence& evidence : databases_) lists.push_back(&evidence.added_constants(domain));
      for (const std::vector<std::string>* list : lists) {
        for (const std::string& constant : *list) {
          if (numeric_value(constant)) continue;
          diagnostics_.error("not-numeric", *places[d],
                             fmt::format("numbers alone can be compared, and constant '{}' of domain '{}' is none",
                                         constant, vocabulary_.domain_name(domain)));
          return false;
        }
      }
    }
    return true;
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
      diagnostics_.error(
          "free-variable", parsed.place,
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
  std::span<const Evidence> databases_;
  Diagnostics& diagnostics_;
  QueryVocabulary vocabulary_;
};

}  // namespace

std::optional<std::vector<Query>> parse_queries(const Model& model, std::span<const Evidence> databases,
                                                const std::vector<std::string>& texts, Diagnostics& diagnostics) {
  const std::size_t errors_before = diagnostics.error_count();
  QueryParser parser(model, databases, diagnostics);
  std::vector<Query> queries(databases.size());
  for (const std::string& text : texts) {
    for (const std::string_view item : split_items(text)) parser.parse(item, queries);
  }
  if (diagnostics.error_count() > errors_before) return std::nullopt;
  return queries;
}

std::optional<Query> parse_query(const Model& model, const Evidence& evidence, const std::vector<std::string>& texts,
                                 Diagnostics& diagnostics) {
  std::optional<std::vector<Query>> queries = parse_queries(model, {&evidence, 1}, texts, diagnostics);
  if (!queries) return std::nullopt;
  return std::move(queries->front());
}

}  // namespace sherlog
