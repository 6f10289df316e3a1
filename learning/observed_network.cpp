#include "learning/observed_network.h"

#include <fmt/format.h>

#include <algorithm>

#include "grounding/conflict.h"
#include "inference/world.h"
#include "mln/shared_domains.h"

namespace sherlog {
namespace {

void mark(const FormulaNode& node, std::vector<bool>& mentioned) {
  if (node.kind == NodeKind::kAtom) mentioned[node.predicate.index()] = true;
  for (const FormulaNode& child : node.children) mark(child, mentioned);
}

std::string place_text(const Sources& sources, const Place& place) {
  return sources.describe({place.file, place.line, 0, 0});
}

// "object(C3,?)": the first block of the predicate without a true atom; empty where there is none.
std::string block_without_value(const Model& model, const Evidence& evidence, PredicateId id) {
  const Predicate& predicate = model.predicate(id);
  const PredicateEvidence& stated = evidence.of(id);
  std::vector<std::size_t> unmarked;
  double blocks = 1.0;
  for (std::size_t i = 0; i < predicate.arity(); ++i) {
    if (predicate.marked[i]) continue;
    unmarked.push_back(i);
    blocks *= static_cast<double>(evidence.domain_size(model, predicate.domains[i]));
  }
  TupleTable valued(unmarked.size());
  std::vector<ConstantIndex> key(unmarked.size());
  for (std::size_t a = 0; a < stated.size(); ++a) {
    if (stated.kinds[a] != EvidenceKind::kTrue) continue;
    for (std::size_t i = 0; i < key.size(); ++i) key[i] = stated.arguments[a * predicate.arity() + unmarked[i]];
    valued.insert(key);
  }
  if (static_cast<double>(valued.size()) == blocks) return "";
  std::ranges::fill(key, 0);
  while (valued.find(key) != TupleTable::kNone) {
    for (std::size_t digit = key.size(); digit > 0; --digit) {
      if (++key[digit - 1] < evidence.domain_size(model, predicate.domains[unmarked[digit - 1]])) break;
      key[digit - 1] = 0;
    }
  }
  std::string text = predicate.name + "(";
  for (std::size_t i = 0, u = 0; i < predicate.arity(); ++i) {
    if (i > 0) text += ',';
    text += predicate.marked[i] ? "?" : quoted_constant(evidence.constant_name(model, predicate.domains[i], key[u++]));
  }
  return text + ")";
}

std::string conflict_sentence(const Conflict& conflict) {
  std::string text = "the training data breaks a hard formula: " + conflict.sentence;
  for (const Conflict::Item& item : conflict.items) {
    const auto& sources = item.is_formula ? conflict.model_sources : conflict.evidence_sources;
    const bool known = sources && item.place.file < sources->size() && item.place.line != 0;
    text += fmt::format("\n  {}{}{}", known ? place_text(*sources, item.place) + ": " : "",
                        item.is_formula ? "hard formula: " : "evidence: ", item.text);
  }
  return text;
}

// What the database says of the atoms of a ground formula, a line each; those with a quantified variable are left out.
void list_atoms(const Model& model, const Evidence& evidence, const Formula& formula, const FormulaNode& node,
                std::span<const ConstantIndex> by_variable, std::vector<std::string>& lines) {
  for (const FormulaNode& child : node.children) list_atoms(model, evidence, formula, child, by_variable, lines);
  if (node.kind != NodeKind::kAtom) return;
  std::vector<ConstantIndex> arguments;
  for (const Term& term : node.terms) {
    if (term.is_variable && formula.variables[term.index].quantified) return;
    arguments.push_back(term.is_variable ? by_variable[term.index] : term.index);
  }
  const PredicateEvidence& stated = evidence.of(node.predicate);
  const std::size_t arity = arguments.size();
  std::size_t a = 0;
  while (a < stated.size() && !std::equal(arguments.begin(), arguments.end(), stated.arguments.data() + a * arity)) ++a;
  const bool known = a < stated.size() && stated.places[a].line != 0;
  const bool holds = a < stated.size() && stated.kinds[a] == EvidenceKind::kTrue;
  std::string line = fmt::format("\n  {}{} is {}", known ? place_text(evidence.sources(), stated.places[a]) + ": " : "",
                                 atom_text(model, evidence, node.predicate, arguments), holds ? "true" : "false");
  if (std::ranges::find(lines, line) == lines.end()) lines.push_back(std::move(line));
}

// A variable over all values of a block stands for the one that the database states.
void bind_by_evidence(const Evidence& evidence, const FormulaNode& node, std::vector<ConstantIndex>& by_variable) {
  for (const FormulaNode& child : node.children) bind_by_evidence(evidence, child, by_variable);
  if (node.kind != NodeKind::kAtom) return;
  const auto value = [&](const Term& term) { return term.is_variable ? by_variable[term.index] : term.index; };
  const auto every = std::ranges::find(node.terms, kEveryConstant, value);
  if (every == node.terms.end()) return;
  const auto position = static_cast<std::size_t>(every - node.terms.begin());
  const PredicateEvidence& stated = evidence.of(node.predicate);
  const std::size_t arity = node.terms.size();
  for (std::size_t a = 0; a < stated.size(); ++a) {
    if (stated.kinds[a] != EvidenceKind::kTrue) continue;
    const std::span<const ConstantIndex> arguments(stated.arguments.data() + a * arity, arity);
    bool fits = true;
    for (std::size_t i = 0; i < arity; ++i) fits = fits && (i == position || value(node.terms[i]) == arguments[i]);
    if (!fits) continue;
    by_variable[every->index] = arguments[position];
    return;
  }
}

// Names the first constraint that the observed world breaks.
std::string broken_constraint(const Model& model, const Evidence& evidence, const ObservedNetwork& observed) {
  if (observed.network.constraints().empty()) return "";
  const WorldIndex index(observed.network);
  World world(index);
  world.assign(observed.values);
  for (const Constraint& constraint : observed.network.constraints()) {
    if (world.is_true(constraint.literal)) continue;
    const Formula& formula = model.formula(constraint.formula);
    std::vector<ConstantIndex> by_variable(formula.variables.size(), 0);
    const auto binding = observed.network.binding(constraint.binding);
    std::size_t next = 0;
    for (std::size_t v = 0; v < by_variable.size(); ++v) {
      if (!formula.variables[v].quantified) by_variable[v] = binding[next++];
    }
    bind_by_evidence(evidence, formula.root, by_variable);
    std::vector<std::string> atoms;
    list_atoms(model, evidence, formula, formula.root, by_variable, atoms);
    return fmt::format("the training data breaks a hard formula: {}: {}{}", place_text(model.sources(), formula.place),
                       ground_formula_text(model, evidence, formula, by_variable), fmt::join(atoms, ""));
  }
  return "";
}

}  // namespace

TrueAtoms::TrueAtoms(const Model& model, const Evidence& evidence) {
  for (std::size_t p = 0; p < model.predicates().size(); ++p) {
    const std::size_t arity = model.predicates()[p].arity();
    const PredicateEvidence& stated = evidence.of(PredicateId(p));
    TupleTable table(arity);
    for (std::size_t a = 0; a < stated.size(); ++a) {
      if (stated.kinds[a] == EvidenceKind::kTrue) table.insert({stated.arguments.data() + a * arity, arity});
    }
    tables_.push_back(std::move(table));
  }
}

std::vector<bool> mentioned_predicates(const Model& model) {
  std::vector<bool> mentioned(model.predicates().size(), false);
  for (const Formula& formula : model.formulas()) mark(formula.root, mentioned);
  return mentioned;
}

namespace {

// Where a database begins, as far as the text tells: "t.db:6: "; else nothing.
std::string first_place(const Evidence& evidence, std::size_t predicates) {
  const Place* first = nullptr;
  for (std::size_t p = 0; p < predicates; ++p) {
    for (const Place& place : evidence.of(PredicateId(p)).places) {
      if (place.line == 0 || place.file >= evidence.sources().size()) continue;
      if (first == nullptr || std::pair(place.file, place.line) < std::pair(first->file, first->line)) first = &place;
    }
  }
  return first == nullptr ? "" : place_text(evidence.sources(), *first) + ": ";
}

std::string database_problem(const Model& model, const Evidence& evidence, const std::vector<bool>& mentioned) {
  for (std::size_t p = 0; p < mentioned.size(); ++p) {
    if (!mentioned[p]) continue;
    const PredicateId id(p);
    const PredicateEvidence& stated = evidence.of(id);
    const std::size_t arity = model.predicate(id).arity();
    for (std::size_t a = 0; a < stated.size(); ++a) {
      if (stated.kinds[a] != EvidenceKind::kSoft && stated.kinds[a] != EvidenceKind::kUnknown) continue;
      return fmt::format("{}: training data must say whether {} is true or false; it is {}",
                         place_text(evidence.sources(), stated.places[a]),
                         atom_text(model, evidence, id, {stated.arguments.data() + a * arity, arity}),
                         stated.kinds[a] == EvidenceKind::kSoft ? "a degree" : "unknown");
    }
    if (model.predicate(id).block != BlockKind::kExactlyOne) continue;
    const std::string block = block_without_value(model, evidence, id);
    if (block.empty()) continue;
    const bool none = std::ranges::find(stated.kinds, EvidenceKind::kTrue) == stated.kinds.end();
    return fmt::format("{}exactly one value of {} must be true, and none is stated{}",
                       first_place(evidence, mentioned.size()), block,
                       none ? fmt::format("; the database has no true atom of '{}'", model.predicate(id).name) : "");
  }
  return "";
}

}  // namespace

std::string training_problem(const Model& model, std::span<const Evidence> databases,
                             const std::vector<bool>& mentioned) {
  for (std::size_t d = 0; d < databases.size(); ++d) {
    const std::string problem = database_problem(model, databases[d], mentioned);
    if (!problem.empty()) return which_database(d, databases.size()) + problem;
  }
  return "";
}

std::string which_database(std::size_t number, std::size_t count) {
  return count == 1 ? "" : fmt::format("database {} of {}: ", number + 1, count);
}

Observation observe(const Model& model, const Evidence& evidence, const TrueAtoms& truth, const std::vector<bool>& open,
                    const Query& query, const WeightTable& weights, const GroundingOptions& limits, Monitor& monitor) {
  Observation out;
  GroundingOptions options = limits;
  options.keep_zero_weights = true;
  options.open_world.clear();
  for (std::size_t p = 0; p < open.size(); ++p) {
    if (open[p]) options.open_world.push_back(PredicateId(p));
  }
  GroundingResult grounded = ground(model, without(evidence, open), query, options, monitor);
  out.termination = grounded.termination;
  out.message = grounded.message;
  if (grounded.conflict) out.message = conflict_sentence(*grounded.conflict);
  if (!grounded.network) return out;

  ObservedNetwork observed;
  observed.network = std::move(*grounded.network);
  const GroundNetwork& network = observed.network;
  for (std::size_t v = 0; v < network.variable_count(); ++v) {
    const std::uint32_t first = network.first_atom(VariableId(v)).value;
    const std::uint32_t candidates = network.candidate_count(VariableId(v));
    std::uint32_t value = 0;
    while (value < candidates &&
           !truth.contains(network.predicate_of(AtomId(first + value)), network.arguments_of(AtomId(first + value)))) {
      ++value;
    }
    observed.values.push_back(value);
  }
  for (const WeightedInstance& instance : network.weights()) {
    observed.weight_of.push_back(static_cast<std::uint32_t>(weights.find(instance)));
  }
  const std::string broken = broken_constraint(model, evidence, observed);
  if (!broken.empty()) {
    out.termination = Termination::kNoPossibleWorld;
    out.message = broken;
    return out;
  }
  out.result = std::move(observed);
  return out;
}

}  // namespace sherlog
