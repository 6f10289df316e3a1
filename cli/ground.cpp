// sherlog ground: how large the ground network is and what made it so; its export to other programs.
#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <memory>
#include <new>
#include <sstream>

#include "cli/commands.h"
#include "cli/report.h"
#include "cli/session.h"
#include "cli/table.h"
#include "grounding/export.h"

namespace sherlog::cli {
namespace {

struct Export {
  std::string format;
  std::string output = "-";
};

constexpr std::size_t kLargestShown = 10;

// Variables of each component, largest first.
std::vector<std::size_t> component_sizes(const GroundNetwork& network) {
  std::vector<std::size_t> sizes;
  for (std::size_t c = 0; c < network.component_count(); ++c) {
    sizes.push_back(network.component_variables(ComponentId(c)).size());
  }
  std::sort(sizes.rbegin(), sizes.rend());
  return sizes;
}

std::string formula_name(const Model& model, FormulaId id) {
  const Formula& formula = model.formula(id);
  return formula.hard ? formula.text + "." : formula.text;
}

std::string ground_text(const Model& model, const GroundingResult& result) {
  Table table({{"formula", Align::kLeft},
               {"line", Align::kRight},
               {"groundings", Align::kRight},
               {"joined", Align::kRight},
               {"features", Align::kRight},
               {"seconds", Align::kRight}});
  for (const FormulaGrounding& formula : result.formulas) {
    std::string name = formula_name(model, formula.formula);
    if (name.size() > 80) name = name.substr(0, 77) + "...";
    table.add_row({std::move(name), fmt::format("{}", model.formula(formula.formula).place.line),
                   fmt::format("{:.0f}", formula.groundings), fmt::format("{}", formula.joined),
                   fmt::format("{}", formula.features), fmt::format("{:.3f}", formula.seconds)});
  }
  std::string text = result.formulas.empty() ? "" : table.text() + "\n";
  if (!result.network) return text;
  const GroundNetwork& network = *result.network;
  text += fmt::format("groundings      {:.0f}\n", network.grounding_count());
  text += fmt::format("variables       {}\n", network.variable_count());
  text += fmt::format("atoms           {} open, {} evidence\n", network.atom_count(), network.evidence_atom_count());
  text += fmt::format("gates           {}\n", network.gate_count());
  text += fmt::format("features        {}\n", network.features().size());
  text += fmt::format("constraints     {}\n", network.constraints().size());
  text += fmt::format("constant score  {:.9g}\n", network.constant_score());
  text += fmt::format("memory          {:.3f} MB\n", static_cast<double>(network.memory_bytes()) / 1e6);
  text += fmt::format("seconds         {:.3f}\n", result.seconds);

  const std::vector<std::size_t> sizes = component_sizes(network);
  std::map<std::size_t, std::size_t, std::greater<>> histogram;
  for (std::size_t size : sizes) ++histogram[size];
  text += fmt::format("components      {}\n", sizes.size());
  std::size_t shown = 0;
  for (const auto& [size, count] : histogram) {
    if (++shown > kLargestShown) {
      text += fmt::format("                {} smaller sizes\n", histogram.size() - kLargestShown);
      break;
    }
    text += fmt::format("                {} of {} variable{}\n", count, size, size == 1 ? "" : "s");
  }
  return text;
}

Json ground_json(const Model& model, const GroundingResult& result, const std::vector<ConflictItem>& conflict) {
  Json json;
  json["schema"] = "sherlog.ground/1";
  json["termination"] = to_string(result.termination);
  if (!result.message.empty()) json["message"] = result.message;
  json["seconds"] = {{"ground", result.seconds}};
  if (result.network) {
    const GroundNetwork& network = *result.network;
    const std::vector<std::size_t> sizes = component_sizes(network);
    json["network"] = {{"groundings", network.grounding_count()},
                       {"variables", network.variable_count()},
                       {"atoms", network.atom_count()},
                       {"evidence_atoms", network.evidence_atom_count()},
                       {"gates", network.gate_count()},
                       {"features", network.features().size()},
                       {"constraints", network.constraints().size()},
                       {"components", network.component_count()},
                       {"largest_component", sizes.empty() ? 0 : sizes.front()},
                       {"queries", network.queries().size()},
                       {"constant_score", network.constant_score()},
                       {"free_log_count", network.free_log_count()},
                       {"memory_bytes", network.memory_bytes()}};
    std::map<std::size_t, std::size_t, std::greater<>> histogram;
    for (std::size_t size : sizes) ++histogram[size];
    json["component_sizes"] = Json::array();
    for (const auto& [size, count] : histogram)
      json["component_sizes"].push_back({{"variables", size}, {"count", count}});
  }
  if (!conflict.empty()) json["conflict"] = conflict_json(conflict);
  json["formulas"] = Json::array();
  for (const FormulaGrounding& formula : result.formulas) {
    const Place& place = model.formula(formula.formula).place;
    json["formulas"].push_back({{"formula", formula_name(model, formula.formula)},
                                {"file", model.sources().name(place.file)},
                                {"line", place.line},
                                {"groundings", formula.groundings},
                                {"joined", formula.joined},
                                {"features", formula.features},
                                {"seconds", formula.seconds}});
  }
  return json;
}

// The text; or nothing, and `problem` says why.
std::string exported(const GroundNetwork& network, const std::string& format, std::optional<std::string>& problem) {
  std::ostringstream out;
  out.imbue(std::locale::classic());
  if (format == "wcnf") problem = export_wcnf(network, out);
  if (format == "uai") problem = export_uai(network, out);
  if (format == "graphml") export_graphml(network, out);
  if (format == "dot") export_dot(network, out);
  return std::move(out).str();
}

// As ground(), where memory may run out.
GroundingResult ground_within_limits(Session& session, const Model& model, const Evidence& evidence, const Query& query,
                                     const GroundingOptions& options) {
  session.restrict_memory();
  GroundingResult result;
  try {
    result = ground(model, evidence, query, options, session.monitor());
  } catch (const std::bad_alloc&) {
    result.termination = Termination::kMemoryLimit;
    result.message = kMemoryMessage;
  }
  session.release_memory();
  return result;
}

int ground_all(Session& session, const Export& wanted) {
  const auto model = session.read_model();
  if (!model) return kBadInput;
  const auto databases = session.read_evidence(*model);
  if (!databases) return kBadInput;
  const auto queries = session.read_queries(*model, *databases);
  if (!queries) return kBadInput;
  const auto grounding = session.grounding_options(*model);
  if (!grounding) return kBadInput;
  if (!wanted.format.empty() && databases->size() > 1) {
    session.error(fmt::format("--export writes one network, and the evidence has {} databases", databases->size()));
    return kBadInput;
  }

  int code = kDone;
  std::string text;
  Json documents = Json::array();
  for (std::size_t d = 0; d < databases->size(); ++d) {
    const GroundingResult result = ground_within_limits(session, *model, (*databases)[d], (*queries)[d], *grounding);
    std::vector<ConflictItem> conflict;
    if (result.conflict) {
      conflict = conflict_items(*result.conflict);
      session.print_message(
          conflict_text(conflict, result.message.empty() ? result.conflict->sentence : result.message));
    } else if (result.termination != Termination::kCompleted) {
      session.error(result.message.empty() ? to_string(result.termination) : result.message);
    }
    if (databases->size() > 1) text += fmt::format("{}--- database {}\n", d == 0 ? "" : "\n", d + 1);
    text += ground_text(*model, result);
    documents.push_back(ground_json(*model, result, conflict));
    if (code == kDone) code = exit_code(result.termination);
    if (!wanted.format.empty() && result.network) {
      std::optional<std::string> unfit;
      const std::string network_text = exported(*result.network, wanted.format, unfit);
      if (unfit) {
        session.error(*unfit);
        return kBadInput;
      }
      if (!session.write(wanted.output, network_text)) return kInternalError;
      if (wanted.output == "-") text.clear();  // the export alone
    }
    if (result.termination == Termination::kInterrupted) break;
  }
  return session.finish(code, text, [&] {
    if (databases->size() == 1) return to_text(documents[0]);
    Json document;
    document["schema"] = "sherlog.ground/1";
    document["databases"] = std::move(documents);
    return to_text(document);
  });
}

int run_ground(Options options, const Export& wanted) {
  Session session(std::move(options));
  std::vector<std::string> outputs;
  if (!wanted.format.empty()) outputs.push_back(wanted.output);
  if (!session.check_options(outputs)) return kBadInput;
  return session.run("sherlog.ground/1", [&] { return ground_all(session, wanted); });
}

}  // namespace

void add_ground(CLI::App& app, Action& action) {
  auto options = std::make_shared<Options>();
  auto wanted = std::make_shared<Export>();
  CLI::App* command = app.add_subcommand("ground", "Sizes, times and memory of the ground network; its export");
  add_model_options(*command, *options);
  add_evidence_options(*command, *options);
  add_query_options(*command, *options);
  add_world_options(*command, *options);
  CLI::Option* format = command->add_option("--export", wanted->format, "Write the ground network in this format")
                            ->type_name("wcnf|uai|graphml|dot")
                            ->check(one_of({"wcnf", "uai", "graphml", "dot"}));
  command->add_option("-o,--output", wanted->output, "Where --export writes (default '-': standard output)")
      ->type_name("FILE|-")
      ->needs(format);
  add_common_options(*command, *options);
  command->callback(
      [options, wanted, &action] { action = [options, wanted] { return run_ground(*options, *wanted); }; });
}

}  // namespace sherlog::cli
