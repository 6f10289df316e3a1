#include "cli/report.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "cli/conflict_evidence.h"
#include "cli/table.h"
#include "grounding/conflict.h"

namespace sherlog::cli {
namespace {

void put(Json& json, const char* key, double value) {
  if (std::isfinite(value)) json[key] = value;
}
void put(Json& json, const char* key, const std::optional<double>& value) {
  if (value) put(json, key, *value);
}

std::string query_text(const GroundNetwork& network, const QueryTarget& query) {
  if (query.is_formula) return query.formula_text;
  return network.literal_text(query.literal, std::string::npos);  // a name is never cut
}

// Truth of a literal in a world given by the variables' values. Gates below it, inputs first; each is visited once.
bool holds(const GroundNetwork& network, const std::vector<std::uint32_t>& values, Literal literal) {
  std::map<std::uint32_t, bool> known;  // by gate
  const auto truth_of = [&](Literal l) {
    if (l.is_constant()) return l == Literal::constant(true);
    const bool truth = l.is_gate() ? known.at(l.gate().value)
                                   : values[network.variable_of(l.atom()).index()] == network.value_of(l.atom());
    return truth != l.negated();
  };
  std::vector<Literal> open;
  if (literal.is_gate()) open.push_back(literal);
  while (!open.empty()) {
    const GateId gate = open.back().gate();
    const auto inputs = network.gate_inputs(gate);
    bool ready = true;
    for (Literal input : inputs) {
      if (input.is_gate() && !known.contains(input.gate().value)) open.push_back(input), ready = false;
    }
    if (!ready) continue;
    open.pop_back();
    known[gate.value] = network.gate_kind(gate) == GateKind::kIff ? truth_of(inputs[0]) == truth_of(inputs[1])
                                                                  : std::any_of(inputs.begin(), inputs.end(), truth_of);
  }
  return truth_of(literal);
}

// Queries in the order asked, but the atoms of one block stand together where the first of them stands.
std::vector<std::vector<std::size_t>> rows_by_block(const GroundNetwork& network) {
  std::vector<std::vector<std::size_t>> groups;
  std::map<std::uint32_t, std::size_t> group_of_variable;
  for (std::size_t q = 0; q < network.queries().size(); ++q) {
    const QueryTarget& query = network.queries()[q];
    if (!query.is_formula && query.literal.is_atom()) {
      const VariableId variable = network.variable_of(query.literal.atom());
      if (network.candidate_count(variable) > 1) {
        const auto [entry, added] = group_of_variable.try_emplace(variable.value, groups.size());
        if (!added) {
          groups[entry->second].push_back(q);
          continue;
        }
      }
    }
    groups.push_back({q});
  }
  return groups;
}

std::string marginal_table(const GroundNetwork& network, const InferenceResult& result) {
  const auto any = [&](auto member) {
    return std::any_of(result.marginals.begin(), result.marginals.end(),
                       [&](const Marginal& m) { return (m.*member).has_value(); });
  };
  const bool mcse = any(&Marginal::mcse), ess = any(&Marginal::ess), rhat = any(&Marginal::rhat);
  Table table({{"atom", Align::kLeft}, {"probability", Align::kRight}});
  if (mcse) table.add_column("mcse", Align::kRight);
  if (ess) table.add_column("ess", Align::kRight);
  if (rhat) table.add_column("rhat", Align::kRight);
  bool last_was_block = false;
  for (const auto& group : rows_by_block(network)) {
    const bool block = group.size() > 1;
    if (table.row_count() > 0 && (block || last_was_block)) table.add_gap();
    last_was_block = block;
    for (std::size_t q : group) {
      const Marginal& marginal = result.marginals[q];
      std::vector<std::string> row{
          query_text(network, network.queries()[q]),
          std::isnan(marginal.probability) ? "-" : fmt::format("{:.6f}", marginal.probability)};
      const auto cell = [&](bool column, const std::optional<double>& value, const char* format) {
        if (column) row.push_back(value ? fmt::format(fmt::runtime(format), *value) : "");
      };
      cell(mcse, marginal.mcse, "{:.6f}");
      cell(ess, marginal.ess, "{:.0f}");
      cell(rhat, marginal.rhat, "{:.3f}");
      table.add_row(std::move(row));
    }
  }
  return table.text();
}

// With so many decimals, as long as that is readable.
std::string score_text(double score, int decimals) {
  return std::abs(score) < 1e15 ? fmt::format("{:.{}f}", score, decimals) : fmt::format("{:.15g}", score);
}

std::string map_text(const GroundNetwork& network, const MapSolution& map) {
  std::string text;
  for (const auto& group : rows_by_block(network)) {
    for (std::size_t q : group) {
      if (holds(network, map.values, network.queries()[q].literal))
        text += query_text(network, network.queries()[q]) + "\n";
    }
  }
  if (text.empty()) text = "(no queried atom is true)\n";
  const std::string proof = map.optimal              ? "proved optimal"
                            : std::isfinite(map.gap) ? fmt::format("not proved optimal, gap at most {:.6g}", map.gap)
                                                     : "not proved optimal";
  return fmt::format("most probable world, log score {} ({})\n\n{}", score_text(map.log_score, 6), proof, text);
}

Json map_json(const GroundNetwork& network, const MapSolution& map) {
  Json json;
  put(json, "log_score", map.log_score);
  json["optimal"] = map.optimal;
  put(json, "gap", map.gap);
  json["true_atoms"] = Json::array();
  Json formulas = Json::array();
  for (const QueryTarget& query : network.queries()) {
    if (!holds(network, map.values, query.literal)) continue;
    (query.is_formula ? formulas : json["true_atoms"]).push_back(query_text(network, query));
  }
  if (!formulas.empty()) json["true_formulas"] = std::move(formulas);
  return json;
}

Json marginals_json(const GroundNetwork& network, const InferenceResult& result) {
  Json json = Json::array();
  for (std::size_t q = 0; q < result.marginals.size(); ++q) {
    const QueryTarget& query = network.queries()[q];
    const Marginal& marginal = result.marginals[q];
    if (std::isnan(marginal.probability)) continue;  // not answered
    Json entry;
    entry[query.is_formula ? "formula" : "atom"] = query_text(network, query);
    put(entry, "probability", marginal.probability);
    put(entry, "mcse", marginal.mcse);
    put(entry, "ess", marginal.ess);
    put(entry, "rhat", marginal.rhat);
    json.push_back(std::move(entry));
  }
  return json;
}

// A binding holds the outer variables only; quantified ones stay as they are, whatever stands at their place.
std::vector<ConstantIndex> constants_by_variable(const Formula& formula, std::span<const ConstantIndex> bound) {
  std::vector<ConstantIndex> by_variable(formula.variables.size(), 0);
  std::size_t next = 0;
  for (std::size_t v = 0; v < formula.variables.size(); ++v) {
    if (!formula.variables[v].quantified && next < bound.size()) by_variable[v] = bound[next++];
  }
  return by_variable;
}

ConflictItem evidence_item(const Model& model, const Evidence& evidence, const StatedAtom& atom) {
  const PredicateEvidence& stated = evidence.of(atom.predicate);
  const std::size_t arity = model.predicate(atom.predicate).arity();
  const std::span<const ConstantIndex> arguments(stated.arguments.data() + atom.index * arity, arity);
  const Place& place = stated.places[atom.index];
  ConflictItem item;
  item.text = (stated.kinds[atom.index] == EvidenceKind::kFalse ? "!" : "") +
              sherlog::atom_text(model, evidence, atom.predicate, arguments);
  if (place.file < evidence.sources().size()) item.file = evidence.sources().name(place.file);
  item.line = place.line;
  item.column = place.column;
  item.is_formula = false;
  return item;
}

// No chain is run for less than a draw.
std::uint32_t chains_of(const InferenceOptions& options) { return std::min(options.chains, options.samples); }

std::string place_text(const ConflictItem& item) {
  if (item.file.empty()) return "sherlog";
  if (item.line == 0) return item.file;
  if (item.column == 0) return fmt::format("{}:{}", item.file, item.line);
  return fmt::format("{}:{}:{}", item.file, item.line, item.column);
}

}  // namespace

Json finite_or_inf(double number) {
  if (std::isfinite(number)) return number;
  return number < 0 ? "-inf" : "inf";
}

std::string to_text(const Json& document) {
  return document.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

std::string bound_formula_text(const Model& model, const Evidence& evidence, const GroundNetwork& network,
                               FormulaId formula, std::uint32_t binding) {
  if (formula.index() >= model.formulas().size()) return "";
  const Formula& source = model.formula(formula);
  if (binding == kNoBinding) return source.text;
  return ground_formula_text(model, evidence, source, constants_by_variable(source, network.binding(binding)));
}

std::vector<ConflictItem> conflict_items(const Conflict& conflict) {
  std::vector<ConflictItem> items;
  for (const Conflict::Item& item : conflict.items) {
    const auto& sources = item.is_formula ? conflict.model_sources : conflict.evidence_sources;
    ConflictItem result{item.text, "", item.place.line, item.place.column, item.is_formula};
    if (sources && item.place.file < sources->size()) {
      result.file = sources->name(item.place.file);
    }
    items.push_back(std::move(result));
  }
  return items;
}

std::vector<ConflictItem> conflict_items(const Model& model, const Evidence& evidence, const GroundNetwork& network,
                                         std::span<const std::uint32_t> constraints) {
  std::vector<ConflictItem> items;
  std::vector<StatedAtom> stated;  // what those ground formulas speak of
  for (std::uint32_t c : constraints) {
    const Constraint& constraint = network.constraints()[c];
    ConflictItem item;
    item.text = network.literal_text(constraint.literal);  // a block's rule or a demand without a formula
    if (constraint.formula.index() < model.formulas().size()) {
      const Place& place = model.formula(constraint.formula).place;
      item.text = bound_formula_text(model, evidence, network, constraint.formula, constraint.binding);
      item.file = model.sources().name(place.file);
      item.line = place.line;
      item.column = place.column;
      if (constraint.binding != kNoBinding) {
        const Formula& formula = model.formula(constraint.formula);
        for (const StatedAtom& atom : stated_atoms_of(
                 model, evidence, formula, constants_by_variable(formula, network.binding(constraint.binding)))) {
          if (std::find(stated.begin(), stated.end(), atom) == stated.end()) stated.push_back(atom);
        }
      }
    }
    items.push_back(std::move(item));
  }
  for (const StatedAtom& atom : stated) items.push_back(evidence_item(model, evidence, atom));
  return items;
}

std::vector<ConflictItem> conflict_items(const Contradiction& contradiction) {
  if (contradiction.grounding) return conflict_items(*contradiction.grounding);
  if (!contradiction.network) return {};
  return conflict_items(*contradiction.model, contradiction.evidence, *contradiction.network,
                        contradiction.constraints);
}

std::string conflict_text(const std::vector<ConflictItem>& conflict, const std::string& sentence) {
  std::string text = fmt::format("{}: error: {}\n", conflict.empty() ? "sherlog" : place_text(conflict.front()),
                                 sentence.empty() ? "no possible world" : sentence);
  for (const ConflictItem& item : conflict) {
    text +=
        fmt::format("{}: note: {}{}\n", place_text(item), item.is_formula ? "hard formula: " : "evidence: ", item.text);
  }
  return text;
}

Json conflict_json(const std::vector<ConflictItem>& conflict) {
  Json json = Json::array();
  for (const ConflictItem& item : conflict) {
    Json entry;
    entry["text"] = item.text;
    if (!item.file.empty()) entry["file"] = item.file;
    if (item.line != 0) entry["line"] = item.line;
    json.push_back(std::move(entry));
  }
  return json;
}

std::string infer_text(const InferenceReport& report) {
  const InferenceResult& result = report.result;
  if (report.network == nullptr || result.termination == Termination::kNoPossibleWorld) return "";
  const GroundNetwork& network = *report.network;
  std::string text = fmt::format("method {}", result.method);
  if (result.samples > 0) {
    text += fmt::format(", {} samples, {} chains, burn-in {}, seed {}", result.samples, chains_of(result.options),
                        result.options.burn_in, result.seed);
  }
  text += fmt::format("; {} ({:.3f} s)\n", to_string(result.termination), report.seconds.total);
  text += fmt::format("ground network: {} atoms, {} features, {} constraints, {} components\n", network.atom_count(),
                      network.features().size(), network.constraints().size(), network.component_count());
  if (result.log_partition) text += fmt::format("log partition function {}\n", score_text(*result.log_partition, 9));
  text += '\n';
  if (result.map) return text + map_text(network, *result.map);
  if (network.queries().empty()) return text + "every queried atom is decided by the evidence\n";
  if (result.marginals.size() != network.queries().size()) return text + "no marginals\n";
  text += marginal_table(network, result);
  return text;
}

Json infer_json(const InferenceReport& report) {
  const InferenceResult& result = report.result;
  Json json;
  json["schema"] = "sherlog.infer/1";
  if (!result.method.empty()) json["method"] = result.method;
  json["termination"] = to_string(result.termination);
  if (!result.message.empty()) json["message"] = result.message;
  json["seconds"] = {{"parse", report.seconds.parse},
                     {"ground", report.seconds.ground},
                     {"infer", report.seconds.infer},
                     {"total", report.seconds.total}};
  json["seed"] = result.options.seed;
  if (result.samples > 0) {
    json["samples"] = result.samples;
    json["chains"] = chains_of(result.options);
    json["burn_in"] = result.options.burn_in;
  }
  if (report.network != nullptr) {
    const GroundNetwork& network = *report.network;
    json["network"] = {{"atoms", network.atom_count()},
                       {"evidence_atoms", network.evidence_atom_count()},
                       {"features", network.features().size()},
                       {"constraints", network.constraints().size()},
                       {"components", network.component_count()}};
  }
  if (!result.warnings.empty()) json["warnings"] = result.warnings;
  if (!report.conflict.empty()) json["conflict"] = conflict_json(report.conflict);
  if (report.network == nullptr || result.termination == Termination::kNoPossibleWorld) return json;
  put(json, "log_partition", result.log_partition);
  if (result.diagnostics) {
    Json diagnostics;
    diagnostics["converged"] = result.diagnostics->converged;
    put(diagnostics, "rhat_max", result.diagnostics->rhat_max);
    put(diagnostics, "ess_min", result.diagnostics->ess_min);
    json["diagnostics"] = std::move(diagnostics);
  }
  if (result.map) {
    json["map"] = map_json(*report.network, *result.map);
  } else if (result.marginals.size() == report.network->queries().size()) {
    json["marginals"] = marginals_json(*report.network, result);
  }
  return json;
}

Json diagnostics_json(const Diagnostics& diagnostics) {
  const Sources& sources = diagnostics.sources();
  const auto place = [&](Json& entry, const Place& at) {
    if (at.line == 0 && at.file >= sources.size()) return;
    entry["file"] = sources.name(at.file);
    if (at.line != 0) entry["line"] = at.line;
    if (at.column != 0) entry["column"] = at.column;
  };
  Json json = Json::array();
  for (const Diagnostic& diagnostic : diagnostics.all()) {
    Json entry;
    entry["severity"] = diagnostic.severity == Severity::kError ? "error" : "warning";
    entry["code"] = diagnostic.code;
    place(entry, diagnostic.place);
    if (diagnostic.place.line != 0) entry["length"] = diagnostic.place.length;
    entry["text"] = diagnostic.text;
    if (!diagnostic.notes.empty()) {
      entry["notes"] = Json::array();
      for (const Note& note : diagnostic.notes) {
        Json note_entry;
        place(note_entry, note.place);
        note_entry["text"] = note.text;
        entry["notes"].push_back(std::move(note_entry));
      }
    }
    json.push_back(std::move(entry));
  }
  return json;
}

}  // namespace sherlog::cli
