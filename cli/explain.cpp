// sherlog explain: the ground formulas that moved an atom, with their contribution in log-odds.
#include "inference/explain.h"

#include <fmt/format.h>

#include <cmath>
#include <memory>
#include <new>

#include "cli/commands.h"
#include "cli/report.h"
#include "cli/session.h"
#include "cli/table.h"

namespace sherlog::cli {
namespace {

struct Item {
  std::string ground;   // over the atoms that the evidence leaves open
  std::string formula;  // of the model, with the constants of the grounding
  std::string place;
  std::optional<double> weight;
};

Item describe(const Model& model, const Evidence& evidence, const GroundNetwork& network,
              const Contribution& contribution) {
  Item item;
  const auto of_model = [&](FormulaId formula, std::uint32_t binding) {
    item.formula = bound_formula_text(model, evidence, network, formula, binding);
    item.place = model.sources().describe(model.formula(formula).place);
  };
  if (contribution.is_constraint) {
    const Constraint& constraint = network.constraints()[contribution.index];
    item.ground = network.literal_text(constraint.literal) + ".";
    if (constraint.formula.index() < model.formulas().size()) of_model(constraint.formula, constraint.binding);
    return item;
  }
  const Feature& feature = network.features()[contribution.index];
  item.ground = network.literal_text(feature.turned ? ~feature.literal : feature.literal);
  item.weight = feature.turned ? -feature.weight : feature.weight;
  if (feature.weight_id == kVirtualEvidence) {
    item.formula = "soft evidence";
  } else {
    of_model(network.weights()[feature.weight_id.index()].formula, feature.binding);
  }
  return item;
}

std::string number(double value) {
  if (std::isinf(value)) return value > 0 ? "+inf" : "-inf";
  return std::abs(value) < 1e15 ? fmt::format("{:+.6f}", value) : fmt::format("{:+.15g}", value);
}

std::string explain_text(const Model& model, const Evidence& evidence, const GroundNetwork& network,
                         const std::string& atom, const Explanation& explanation, std::size_t limit) {
  std::string text = fmt::format("P({}) = {:.6f}, log-odds {} (method {})\n", atom, explanation.probability,
                                 number(explanation.log_odds), explanation.method);
  if (!explanation.message.empty()) text += explanation.message + "\n";
  text += "\n";
  if (explanation.contributions.empty()) return text + "no ground formula moves it\n";
  Table table({{"log-odds", Align::kRight},
               {"weight", Align::kRight},
               {"ground formula", Align::kLeft},
               {"from", Align::kLeft}});
  const bool sampled = explanation.contributions.front().mcse.has_value();
  if (sampled) {
    table = Table({{"log-odds", Align::kRight},
                   {"mcse", Align::kRight},
                   {"weight", Align::kRight},
                   {"ground formula", Align::kLeft},
                   {"from", Align::kLeft}});
  }
  std::size_t shown = 0;
  for (const Contribution& contribution : explanation.contributions) {
    if (shown++ == limit) break;
    const Item item = describe(model, evidence, network, contribution);
    std::vector<std::string> row{number(contribution.log_odds)};
    if (sampled) row.push_back(contribution.mcse ? fmt::format("{:.6f}", *contribution.mcse) : "");
    row.push_back(item.weight ? fmt::format("{:.6g}", *item.weight) : "hard");
    row.push_back(item.ground);
    row.push_back(item.place.empty() ? item.formula : fmt::format("{}: {}", item.place, item.formula));
    table.add_row(std::move(row));
  }
  text += table.text();
  if (explanation.contributions.size() > limit) {
    text += fmt::format("  and {} more (--top N shows more)\n", explanation.contributions.size() - limit);
  }
  if (explanation.constraints_left_out < explanation.constraints_in_component && std::isfinite(explanation.log_odds)) {
    text += fmt::format("\n{} of {} hard ground formulas in the atom's component were left out in turn\n",
                        explanation.constraints_left_out, explanation.constraints_in_component);
  }
  return text;
}

Json explain_json(const Model& model, const Evidence& evidence, const GroundNetwork* network, const std::string& atom,
                  const Explanation& explanation, const std::vector<ConflictItem>& conflict) {
  Json json;
  json["schema"] = "sherlog.explain/1";
  json["atom"] = atom;
  if (!explanation.method.empty()) json["method"] = explanation.method;
  json["termination"] = to_string(explanation.termination);
  if (!explanation.message.empty()) json["message"] = explanation.message;
  json["seconds"] = {{"explain", explanation.seconds}};
  if (!conflict.empty()) json["conflict"] = conflict_json(conflict);
  if (network == nullptr || explanation.termination == Termination::kNoPossibleWorld) return json;
  json["probability"] = explanation.probability;
  if (std::isfinite(explanation.log_odds)) json["log_odds"] = explanation.log_odds;
  json["contributions"] = Json::array();
  for (const Contribution& contribution : explanation.contributions) {
    const Item item = describe(model, evidence, *network, contribution);
    Json entry;
    entry["ground_formula"] = item.ground;
    if (!item.formula.empty()) entry["formula"] = item.formula;
    if (!item.place.empty()) entry["place"] = item.place;
    entry["hard"] = contribution.is_constraint;
    if (item.weight) entry["weight"] = *item.weight;
    if (std::isfinite(contribution.log_odds)) {
      entry["log_odds"] = contribution.log_odds;
    } else {
      entry["decides"] = contribution.log_odds > 0;
    }
    if (contribution.mcse) entry["mcse"] = *contribution.mcse;
    json["contributions"].push_back(std::move(entry));
  }
  return json;
}

// The one atom or formula that was asked for, or what stands in the way.
std::optional<Literal> target_of(Session& session, const GroundNetwork& network, const std::string& atom, int& code) {
  code = kDone;
  if (network.queries().size() > 1) {
    session.error(fmt::format("'{}' matches {} atoms: name one", atom, network.queries().size()));
    code = kBadInput;
    return std::nullopt;
  }
  if (network.queries().empty() || network.queries().front().literal.is_constant()) return std::nullopt;
  return network.queries().front().literal;
}

int explain_atom(Session& session, const std::string& asked, std::size_t limit) {
  const auto model = session.read_model();
  if (!model) return kBadInput;
  const auto databases = session.read_evidence(*model);
  if (!databases) return kBadInput;
  if (databases->size() != 1) {
    session.error(fmt::format("'explain' answers for one database, and the evidence has {}", databases->size()));
    return kBadInput;
  }
  const Evidence& evidence = databases->front();
  const auto queries = session.read_queries(*model, *databases);
  if (!queries) return kBadInput;
  const Query& query = queries->front();
  if (query.items.size() != 1) {
    session.error("'explain' takes one ground atom");
    return kBadInput;
  }
  auto grounding = session.grounding_options(*model);
  if (!grounding) return kBadInput;

  GroundingResult grounded;
  Explanation explanation;
  explanation.method = session.options().method;
  std::vector<ConflictItem> conflict;
  const GroundNetwork* network = nullptr;
  std::string atom = asked, text;
  int code = kDone;
  try {
    grounded = ground(*model, evidence, query, *grounding, session.monitor());
    if (!grounded.network) {
      explanation.termination = grounded.termination;
      explanation.message = grounded.message;
      if (grounded.conflict) conflict = conflict_items(*grounded.conflict);
    } else if (const auto target = target_of(session, *grounded.network, atom, code)) {
      network = &*grounded.network;
      if (target->is_atom()) atom = network->literal_text(*target);  // a pattern may stand for one atom
      explanation = explain(*network, *target, session.inference_options(), session.monitor());
    } else {
      if (code != kDone) return code;
      explanation.method.clear();  // nobody asked one
      explanation.message = "the evidence decides it: no formula has a say";
      text = fmt::format("{}: {}\n", atom, explanation.message);
    }
  } catch (const std::bad_alloc&) {
    explanation.termination = Termination::kMemoryLimit;
    explanation.message = kMemoryMessage;
  }
  session.release_memory();
  if (network != nullptr && explanation.termination == Termination::kNoPossibleWorld) {
    conflict = conflict_items(*model, evidence, *network, explanation.conflict);
  }
  if (explanation.termination == Termination::kNoPossibleWorld) {
    session.print_message(conflict_text(conflict, explanation.message));
  } else if (explanation.termination != Termination::kCompleted) {
    session.error(explanation.message.empty() ? to_string(explanation.termination) : explanation.message);
  }
  if (network != nullptr && explanation.termination != Termination::kNoPossibleWorld && !explanation.method.empty() &&
      explanation.termination != Termination::kRefused && explanation.termination != Termination::kTooWide) {
    text = explain_text(*model, evidence, *network, atom, explanation, limit);
  }
  return session.finish(exit_code(explanation.termination), text,
                        [&] { return to_text(explain_json(*model, evidence, network, atom, explanation, conflict)); });
}

int run_explain(Options options, const std::string& atom, std::size_t limit) {
  options.queries = {atom};
  Session session(std::move(options));
  if (!session.check_options()) return kBadInput;
  return session.run(
      "sherlog.explain/1", [&] { return explain_atom(session, atom, limit); }, true);
}

}  // namespace

void add_explain(CLI::App& app, Action& action) {
  auto options = std::make_shared<Options>();
  auto atom = std::make_shared<std::string>();
  auto limit = std::make_shared<std::size_t>(20);
  CLI::App* command = app.add_subcommand("explain", "The ground formulas that moved an atom, in log-odds");
  add_model_options(*command, *options);
  add_evidence_options(*command, *options);
  command->add_option("atom", *atom, "A ground atom, or a ground formula")->type_name("ATOM")->required();
  command->add_option("--top", *limit, "How many ground formulas the text shows (default 20)")
      ->type_name("N")
      ->check(whole_number(4000000000));
  add_world_options(*command, *options);
  add_inference_options(*command, *options);
  add_common_options(*command, *options);
  command->callback([options, atom, limit, &action] {
    action = [options, atom, limit] { return run_explain(*options, *atom, *limit); };
  });
}

}  // namespace sherlog::cli
