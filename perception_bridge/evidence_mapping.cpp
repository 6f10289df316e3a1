#include "perception_bridge/evidence_mapping.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>

#include "mln/diagnostics.h"

namespace sherlog {
namespace {

constexpr std::array<std::string_view, 3> kSpellings = {"as_is", "lower", "capital"};

// As the language has it: letters, digits and '_', and a few signs between such characters.
bool is_name(std::string_view text) {
  const auto is_letter = [](char c) {
    const auto byte = static_cast<unsigned char>(c);
    return byte >= 0x80 || std::isalpha(byte) != 0 || c == '_';
  };
  const auto is_inner = [&](char c) { return is_letter(c) || std::isdigit(static_cast<unsigned char>(c)) != 0; };
  if (text.empty() || !is_letter(text.front()) || !is_inner(text.back())) return false;
  return std::all_of(text.begin(), text.end(),
                     [&](char c) { return is_inner(c) || std::string_view("'-.!").find(c) != std::string_view::npos; });
}

// Takes the keys of one object apart; the first mistake stays.
class ObjectReader {
 public:
  ObjectReader(const Value& document, std::string where, std::string& problem)
      : document_(document), where_(std::move(where)), problem_(problem) {
    if (document.object() == nullptr) fail(fmt::format("is {}, not an object", document.kind()));
  }

  void text(const char* key, std::string& target) {
    if (const Value* value = take(key)) {
      if (value->text() != nullptr) {
        target = *value->text();
      } else {
        fail(fmt::format("'{}' is {}, not a text", key, value->kind()));
      }
    }
  }
  void degree(const char* key, double& target) {
    if (const Value* value = take(key)) {
      target = value->number().value_or(std::nan(""));
      if (!(target >= 0 && target <= 1)) fail(fmt::format("'{}' is not a number in [0, 1]", key));
    }
  }
  void flag(const char* key, bool& target) {
    if (const Value* value = take(key)) {
      if (value->flag() != nullptr) {
        target = *value->flag();
      } else {
        fail(fmt::format("'{}' is {}, not true or false", key, value->kind()));
      }
    }
  }
  void texts(const char* key, std::vector<std::string>& target) {
    if (const Value* value = take(key)) {
      if (value->list() == nullptr) return fail(fmt::format("'{}' is {}, not a list", key, value->kind()));
      for (const Value& item : *value->list()) {
        if (item.text() == nullptr) return fail(fmt::format("'{}' has {} in it, not only texts", key, item.kind()));
        target.push_back(*item.text());
      }
    }
  }
  void text_map(const char* key, std::map<std::string, std::string>& target) {
    if (const Value* value = take(key)) {
      if (value->object() == nullptr) return fail(fmt::format("'{}' is {}, not an object", key, value->kind()));
      for (const auto& [name, item] : *value->object()) {
        if (item.text() == nullptr) return fail(fmt::format("'{}': '{}' is {}, not a text", key, name, item.kind()));
        target[name] = *item.text();
      }
    }
  }
  const Value* take(const char* key) {
    known_.emplace_back(key);
    return document_.find(key);
  }
  void require(const char* key, const std::string& value) {
    if (value.empty()) fail(fmt::format("has no '{}'", key));
  }
  void finish() {
    if (document_.object() == nullptr) return;
    for (const auto& [key, value] : *document_.object()) {
      if (std::find(known_.begin(), known_.end(), key) != known_.end()) continue;
      const std::string nearest = did_you_mean(key, known_);
      fail(fmt::format("does not know the key '{}'{}", key,
                       nearest.empty() ? "" : fmt::format("; did you mean '{}'?", nearest)));
    }
  }
  void check_name(const char* key, std::string_view name, std::string_view written) {
    if (!is_name(name)) fail(fmt::format("has '{}' for its '{}', which is no name", written, key));
  }
  void check_type(std::string_view type) {
    if (const std::string mistake = mistyped_annotation_type(type); !mistake.empty())
      fail("is for nothing: " + mistake);
  }
  void fail(const std::string& text) {
    if (problem_.empty()) problem_ = fmt::format("{} {}", where_, text);
  }

 private:
  const Value& document_;
  std::string where_;
  std::string& problem_;
  std::vector<std::string> known_;
};

// A predicate of a rule may have texts of fields in it: goggles_{category}.
std::string without_fields(std::string_view predicate) {
  std::string name;
  while (!predicate.empty()) {
    const std::size_t open = std::min(predicate.find('{'), predicate.size());
    name += predicate.substr(0, open);
    const std::size_t close = predicate.find('}', open);
    if (open == predicate.size() || close == std::string_view::npos || close == open + 1) {
      return name.append(predicate.substr(open));
    }
    name += 'x';
    predicate.remove_prefix(close + 1);
  }
  return name;
}

AtomRule read_rule(const Value& document, std::size_t index, std::string& problem) {
  AtomRule rule;
  ObjectReader reader(document, fmt::format("rule {}", index + 1), problem);
  reader.text("annotation", rule.annotation);
  reader.text("predicate", rule.predicate);
  reader.text("value", rule.value);
  reader.text("degree", rule.degree);
  reader.degree("missing_degree", rule.missing_degree);
  reader.degree("threshold", rule.threshold);
  reader.flag("soft", rule.soft);
  reader.flag("of_scene", rule.of_scene);
  reader.flag("training", rule.training);
  reader.text_map("where", rule.where);
  std::map<std::string, std::string> values;
  reader.text_map("values", values);
  for (auto& [from, to] : values) {
    std::string lower = from;
    std::transform(lower.begin(), lower.end(), lower.begin(),
                   [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
    if (!rule.values.emplace(lower, to).second) {
      reader.fail(fmt::format("'values' has '{}' twice: upper and lower case are one", lower));
    }
  }
  reader.flag("only_listed", rule.only_listed);
  std::string spelling = "as_is";
  reader.text("spelling", spelling);
  const auto found = std::find(kSpellings.begin(), kSpellings.end(), spelling);
  if (found == kSpellings.end())
    reader.fail(fmt::format("'spelling' '{}' is none of {}", spelling, fmt::join(kSpellings, ", ")));
  if (found != kSpellings.end()) rule.spelling = static_cast<Spelling>(found - kSpellings.begin());
  reader.require("annotation", rule.annotation);
  reader.require("predicate", rule.predicate);
  reader.require("value", rule.value);
  reader.finish();
  reader.check_name("predicate", without_fields(rule.predicate), rule.predicate);
  reader.check_type(rule.annotation);
  return rule;
}

PairRule read_pair(const Value& document, std::size_t index, std::string& problem) {
  PairRule rule;
  ObjectReader reader(document, fmt::format("pair rule {}", index + 1), problem);
  reader.text("predicate", rule.predicate);
  reader.texts("types", rule.types);
  reader.degree("missing", rule.missing);
  reader.require("predicate", rule.predicate);
  reader.finish();
  reader.check_name("predicate", rule.predicate, rule.predicate);
  for (const std::string& type : rule.types) reader.check_type(type);
  return rule;
}

void read_domain(ObjectReader& owner, const char* key, NamedDomain& domain, std::string& problem) {
  const Value* document = owner.take(key);
  if (document == nullptr) return;
  ObjectReader reader(*document, fmt::format("'{}'", key), problem);
  reader.text("prefix", domain.prefix);
  reader.text("domain", domain.domain);
  reader.require("prefix", domain.prefix);
  reader.require("domain", domain.domain);
  reader.finish();
  reader.check_name("prefix", domain.prefix, domain.prefix);
  reader.check_name("domain", domain.domain, domain.domain);
}

template <class Rule, class Read>
void read_list(ObjectReader& owner, const char* key, std::vector<Rule>& rules, std::string& problem, Read read) {
  const Value* list = owner.take(key);
  if (list == nullptr) return;
  if (list->list() == nullptr) return owner.fail(fmt::format("'{}' is {}, not a list", key, list->kind()));
  for (std::size_t i = 0; i < list->list()->size(); ++i) rules.push_back(read((*list->list())[i], i, problem));
}

Value text_map_value(const std::map<std::string, std::string>& map) {
  Value::Object object;
  for (const auto& [key, value] : map) object.emplace_back(key, Value(value));
  return Value(std::move(object));
}

Value rule_value(const AtomRule& rule) {
  Value::Object object = {
      {"annotation", Value(rule.annotation)}, {"predicate", Value(rule.predicate)}, {"value", Value(rule.value)}};
  if (!rule.degree.empty()) object.emplace_back("degree", Value(rule.degree));
  if (rule.missing_degree != 1) object.emplace_back("missing_degree", Value(rule.missing_degree));
  if (rule.threshold > 0) object.emplace_back("threshold", Value(rule.threshold));
  for (const auto& [key, flag] : {std::pair{"soft", rule.soft}, std::pair{"of_scene", rule.of_scene},
                                  std::pair{"training", rule.training}, std::pair{"only_listed", rule.only_listed}}) {
    if (flag) object.emplace_back(key, Value(true));
  }
  if (rule.spelling != Spelling::kAsIs) {
    object.emplace_back("spelling", Value(std::string(kSpellings[static_cast<std::size_t>(rule.spelling)])));
  }
  if (!rule.where.empty()) object.emplace_back("where", text_map_value(rule.where));
  if (!rule.values.empty()) object.emplace_back("values", text_map_value(rule.values));
  return Value(std::move(object));
}

Value domain_value(const NamedDomain& domain) {
  return Value(Value::Object{{"prefix", Value(domain.prefix)}, {"domain", Value(domain.domain)}});
}

}  // namespace

std::optional<EvidenceMapping> mapping_from_json(const Value& document, std::string& problem) {
  problem.clear();
  EvidenceMapping mapping;
  ObjectReader reader(document, "the mapping", problem);
  if (!problem.empty()) return std::nullopt;
  std::string schema = "sherlog.mapping/1";
  reader.text("schema", schema);
  if (schema != "sherlog.mapping/1") reader.fail(fmt::format("has the schema '{}', not 'sherlog.mapping/1'", schema));
  reader.text("name", mapping.name);
  reader.require("name", mapping.name);
  read_domain(reader, "clusters", mapping.clusters, problem);
  read_domain(reader, "old_clusters", mapping.old_clusters, problem);
  read_domain(reader, "new_clusters", mapping.new_clusters, problem);
  read_list(reader, "rules", mapping.rules, problem, read_rule);
  read_list(reader, "pairs", mapping.pairs, problem, read_pair);
  reader.text("out_of_view", mapping.out_of_view);
  if (const Value* similarity = reader.take("similarity")) {
    std::string inner;
    auto config = similarity_from_json(*similarity, inner);
    if (config) {
      mapping.similarity = std::move(*config);
    } else {
      reader.fail("has a bad 'similarity': " + inner);
    }
  }
  reader.finish();
  if (!mapping.out_of_view.empty()) reader.check_name("out_of_view", mapping.out_of_view, mapping.out_of_view);
  return problem.empty() ? std::optional(std::move(mapping)) : std::nullopt;
}

Value mapping_to_json(const EvidenceMapping& mapping) {
  Value::Object object = {{"schema", Value("sherlog.mapping/1")}, {"name", Value(mapping.name)}};
  if (!mapping.rules.empty()) {
    object.emplace_back("clusters", domain_value(mapping.clusters));
    Value::List rules;
    for (const AtomRule& rule : mapping.rules) rules.push_back(rule_value(rule));
    object.emplace_back("rules", Value(std::move(rules)));
  }
  if (!mapping.pairs.empty() || !mapping.out_of_view.empty()) {
    object.emplace_back("old_clusters", domain_value(mapping.old_clusters));
    object.emplace_back("new_clusters", domain_value(mapping.new_clusters));
    Value::List pairs;
    for (const PairRule& rule : mapping.pairs) {
      Value::Object pair = {{"predicate", Value(rule.predicate)}};
      Value::List types;
      for (const std::string& type : rule.types) types.emplace_back(type);
      pair.emplace_back("types", Value(std::move(types)));
      pair.emplace_back("missing", Value(rule.missing));
      pairs.emplace_back(std::move(pair));
    }
    object.emplace_back("pairs", Value(std::move(pairs)));
    if (!mapping.out_of_view.empty()) object.emplace_back("out_of_view", Value(mapping.out_of_view));
    object.emplace_back("similarity", similarity_to_json(mapping.similarity));
  }
  return Value(std::move(object));
}

}  // namespace sherlog
