#include "perception_bridge/observe.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <map>

#include "perception_bridge/view.h"

namespace sherlog {
namespace {

constexpr double kLeastDegree = 1e-9;

std::string lower(std::string_view text) {
  std::string result(text);
  std::transform(result.begin(), result.end(), result.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return result;
}

std::string spelled(std::string text, Spelling spelling) {
  if (spelling == Spelling::kLower) return lower(text);
  if (spelling == Spelling::kCapital && !text.empty()) {
    text[0] = static_cast<char>(std::toupper(static_cast<unsigned char>(text[0])));
  }
  return text;
}

// Nothing where the mapping leaves the value out.
std::optional<std::string> mapped_value(const AtomRule& rule, const std::string& text) {
  const std::string value = on_one_line(text);
  const auto listed = rule.values.find(lower(value));
  if (listed != rule.values.end()) {
    const std::string name = on_one_line(listed->second);
    return name.empty() ? std::nullopt : std::optional(name);
  }
  if (rule.only_listed || value.empty()) return std::nullopt;
  return spelled(value, rule.spelling);
}

// "goggles_{category}" with the annotation's category; "goggles" where it has none.
std::string predicate_name(const AtomRule& rule, const Annotation& annotation) {
  const std::size_t open = rule.predicate.find('{'), close = rule.predicate.find('}');
  if (open == std::string::npos || close == std::string::npos || close < open) return rule.predicate;
  const std::string field = rule.predicate.substr(open + 1, close - open - 1);
  std::string text(text_field(annotation, field));
  std::replace_if(
      text.begin(), text.end(), [](unsigned char c) { return std::isalnum(c) == 0; }, '_');
  std::string before = rule.predicate.substr(0, open);
  if (text.empty() && before.ends_with('_')) before.pop_back();
  return before + text + rule.predicate.substr(close + 1);
}

double degree_of(const AtomRule& rule, const Annotation& annotation) {
  if (rule.degree.empty()) return 1;
  if (rule.degree == "confidence") return annotation.confidence.value_or(rule.missing_degree);
  for (const Value* value : select(annotation.fields, rule.degree)) {
    if (const auto number = value->number()) return *number;
  }
  return rule.missing_degree;
}

bool holds(const AtomRule& rule, const Annotation& annotation) {
  return std::all_of(rule.where.begin(), rule.where.end(), [&](const auto& condition) {
    return lower(text_field(annotation, condition.first)) == lower(condition.second);
  });
}

// Collects atoms without duplicates.
class AtomList {
 public:
  explicit AtomList(std::vector<ObservedAtom>& atoms) : atoms_(atoms) {}

  void add(ObservedAtom atom) {
    std::string key = atom.predicate;
    for (const std::string& argument : atom.arguments) key += '\n' + argument;
    const auto [entry, is_new] = index_.emplace(std::move(key), atoms_.size());
    if (is_new) {
      atoms_.push_back(std::move(atom));
      return;
    }
    ObservedAtom& known = atoms_[entry->second];
    known.soft = known.soft && atom.soft;  // a fact is more than any degree
    known.degree = std::max(known.degree, atom.degree);
  }

 private:
  std::vector<ObservedAtom>& atoms_;
  std::map<std::string, std::size_t> index_;
};

// The atoms of one list of annotations; `cluster` empty: about the scene.
void apply(const AtomRule& rule, const std::vector<Annotation>& annotations, const std::string& cluster,
           const ObserveOptions& options, AtomList& atoms, std::vector<std::string>& notes) {
  for (const Annotation* annotation : annotations_of(annotations, rule.annotation)) {
    if (!holds(rule, *annotation)) continue;
    const double degree = degree_of(rule, *annotation);
    if (!(degree >= rule.threshold) || !(degree > 0)) continue;
    for (const Value* value : select(annotation->fields, rule.value)) {
      const Value::List one = {*value};
      for (const Value& item : value->list() == nullptr ? one : *value->list()) {
        if (item.text() == nullptr) continue;
        const auto constant = mapped_value(rule, *item.text());
        if (!constant) {
          notes.push_back(fmt::format("{}'{}' of {} is no value of '{}'", cluster.empty() ? "" : cluster + ": ",
                                      *item.text(), annotation->type, rule.predicate));
          continue;
        }
        ObservedAtom atom{predicate_name(rule, *annotation), {}, degree, options.fuzzy.value_or(rule.soft)};
        if (!cluster.empty()) atom.arguments.push_back(cluster);
        atom.arguments.push_back(*constant);
        atoms.add(std::move(atom));
      }
    }
  }
}

std::vector<std::string> constants(const NamedDomain& domain, std::size_t count) {
  std::vector<std::string> names;
  names.reserve(count);
  for (std::size_t i = 0; i < count; ++i) names.push_back(fmt::format("{}{}", domain.prefix, i));
  return names;
}

std::string observed_text(const ObservedAtom& atom) {
  std::string text = atom.soft ? fmt::format("{:.9g} ", std::clamp(atom.degree, kLeastDegree, 1 - kLeastDegree)) : "";
  text += atom.predicate + "(";
  for (std::size_t i = 0; i < atom.arguments.size(); ++i) {
    text += (i > 0 ? "," : "") + quoted_constant(atom.arguments[i]);
  }
  return text + ")";
}

}  // namespace

SceneObservation observe(const EvidenceMapping& mapping, const Scene& scene, const ObserveOptions& options) {
  SceneObservation result;
  AtomList atoms(result.atoms);
  const auto names = constants(mapping.clusters, scene.clusters.size());
  if (!names.empty()) result.domains.emplace_back(mapping.clusters.domain, names);
  for (const AtomRule& rule : mapping.rules) {
    if (rule.training && !options.labels) continue;
    if (rule.of_scene) {
      apply(rule, scene.annotations, "", options, atoms, result.notes);
      continue;
    }
    for (std::size_t i = 0; i < scene.clusters.size(); ++i) {
      apply(rule, scene.clusters[i].annotations, names[i], options, atoms, result.notes);
    }
  }
  return result;
}

SceneObservation observe_change(const EvidenceMapping& mapping, std::span<const Cluster> old_clusters,
                                const Scene& now) {
  SceneObservation result;
  const auto olds = constants(mapping.old_clusters, old_clusters.size());
  const auto news = constants(mapping.new_clusters, now.clusters.size());
  if (!olds.empty()) result.domains.emplace_back(mapping.old_clusters.domain, olds);
  if (!news.empty()) result.domains.emplace_back(mapping.new_clusters.domain, news);
  for (const PairRule& rule : mapping.pairs) {
    for (std::size_t o = 0; o < old_clusters.size(); ++o) {
      for (std::size_t n = 0; n < now.clusters.size(); ++n) {
        const auto similarity = similarity_between(mapping.similarity, old_clusters[o], now.clusters[n], rule.types);
        if (!similarity.value)
          result.notes.push_back(
              fmt::format("{} and {}: nothing to compare for '{}'", olds[o], news[n], rule.predicate));
        result.atoms.push_back({rule.predicate, {olds[o], news[n]}, similarity.value.value_or(rule.missing), true});
      }
    }
  }
  if (mapping.out_of_view.empty()) return result;
  const SceneView view = view_of(now);
  for (std::size_t o = 0; o < old_clusters.size(); ++o) {
    if (!sees_thing(view, old_clusters[o])) result.atoms.push_back({mapping.out_of_view, {olds[o]}, 1, false});
  }
  return result;
}

std::string on_one_line(std::string_view text) {
  std::string line;
  bool is_gap = false;
  for (const char c : text) {
    const bool is_control = std::iscntrl(static_cast<unsigned char>(c)) != 0;
    if (!is_control && is_gap && !line.empty()) line += ' ';
    if (!is_control) line += c;
    is_gap = is_control;
  }
  return line;
}

std::string evidence_text(const SceneObservation& observation) {
  std::string text;
  for (const auto& [domain, names] : observation.domains)
    text += fmt::format("{} = {{{}}}\n", domain, fmt::join(names, ", "));
  for (const ObservedAtom& atom : observation.atoms) text += observed_text(atom) + "\n";
  return text;
}

std::optional<Evidence> to_evidence(const SceneObservation& observation, const Model& model, Diagnostics& diagnostics,
                                    const EvidenceOptions& options) {
  auto databases = parse_evidence(model, evidence_text(observation), "observed scene", diagnostics, options);
  return databases ? std::optional(std::move(databases->front())) : std::nullopt;
}

Annotation mln_atoms(const SceneObservation& observation, const std::string& cluster) {
  Value::List texts;
  for (const ObservedAtom& atom : observation.atoms) {
    if (!atom.arguments.empty() && atom.arguments.front() == cluster) texts.emplace_back(observed_text(atom));
  }
  Annotation annotation;
  annotation.type = "rs.annotation.MLNAtoms";
  annotation.fields = {{"atoms", Value(std::move(texts))}};
  return annotation;
}

}  // namespace sherlog
