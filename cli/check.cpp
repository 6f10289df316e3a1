// sherlog check: parses, types and cross-checks a model, and evidence against it.
#include <fmt/format.h>

#include <memory>

#include "cli/commands.h"
#include "cli/report.h"
#include "cli/session.h"

namespace sherlog::cli {
namespace {

std::string count_text(std::size_t n, const char* noun) { return fmt::format("{} {}{}", n, noun, n == 1 ? "" : "s"); }

std::size_t stated_atoms(const Model& model, const Evidence& evidence) {
  std::size_t atoms = 0;
  for (std::size_t p = 0; p < model.predicates().size(); ++p) atoms += evidence.of(PredicateId(p)).size();
  return atoms;
}

std::size_t hard_formulas(const Model& model) {
  std::size_t hard = 0;
  for (const Formula& formula : model.formulas()) hard += formula.hard ? 1u : 0u;
  return hard;
}

std::string check_text(const std::optional<Model>& model, const std::optional<std::vector<Evidence>>& databases,
                       const Diagnostics& diagnostics) {
  std::string text;
  if (model) {
    text += fmt::format("model: {}, {}, {} ({} hard)\n", count_text(model->domains().size(), "domain"),
                        count_text(model->predicates().size(), "predicate"),
                        count_text(model->formulas().size(), "formula"), hard_formulas(*model));
  }
  if (model && databases) {
    for (std::size_t d = 0; d < databases->size(); ++d) {
      std::size_t added = 0;
      for (std::size_t i = 0; i < model->domains().size(); ++i)
        added += (*databases)[d].added_constants(DomainId(i)).size();
      text +=
          fmt::format("database {}: {}, {}\n", d + 1, count_text(stated_atoms(*model, (*databases)[d]), "stated atom"),
                      count_text(added, "added constant"));
    }
  }
  return text + fmt::format("{}, {}\n", count_text(diagnostics.error_count(), "error"),
                            count_text(diagnostics.warning_count(), "warning"));
}

Json check_json(const std::optional<Model>& model, const std::optional<std::vector<Evidence>>& databases,
                const Diagnostics& diagnostics, double seconds) {
  Json json;
  json["schema"] = "sherlog.check/1";
  json["ok"] = !diagnostics.has_errors();
  json["errors"] = diagnostics.error_count();
  json["warnings"] = diagnostics.warning_count();
  json["diagnostics"] = diagnostics_json(diagnostics);
  if (model) {
    Json& entry = json["model"];
    entry["domains"] = Json::array();
    for (const Domain& domain : model->domains()) {
      entry["domains"].push_back(
          {{"name", domain.name}, {"constants", domain.constants.size()}, {"declared", domain.declared}});
    }
    entry["predicates"] = Json::array();
    for (const Predicate& predicate : model->predicates()) {
      Json arguments = Json::array();
      for (std::size_t i = 0; i < predicate.arity(); ++i) {
        std::string argument = model->domain(predicate.domains[i]).name;
        if (predicate.marked[i]) argument += predicate.block == BlockKind::kExactlyOne ? "!" : "?";
        arguments.push_back(std::move(argument));
      }
      entry["predicates"].push_back(
          {{"name", predicate.name}, {"arguments", std::move(arguments)}, {"closed", predicate.closed}});
    }
    entry["formulas"] = model->formulas().size();
    entry["hard_formulas"] = hard_formulas(*model);
  }
  if (model && databases) {
    json["databases"] = Json::array();
    for (const Evidence& evidence : *databases)
      json["databases"].push_back({{"stated_atoms", stated_atoms(*model, evidence)}});
  }
  json["seconds"] = {{"total", seconds}};
  return json;
}

int check_inputs(Session& session) {
  const auto model = session.read_model();
  std::optional<std::vector<Evidence>> databases;
  if (model && !session.options().evidence.empty()) databases = session.read_evidence(*model);
  const Diagnostics& diagnostics = session.diagnostics();
  const int code = diagnostics.has_errors() ? kBadInput : kDone;
  return session.finish(code, check_text(model, databases, diagnostics),
                        [&] { return to_text(check_json(model, databases, diagnostics, session.seconds())); });
}

int run_check(Options options) {
  Session session(std::move(options));
  if (!session.check_options()) return kBadInput;
  return session.run("sherlog.check/1", [&] { return check_inputs(session); });
}

}  // namespace

void add_check(CLI::App& app, Action& action) {
  auto options = std::make_shared<Options>();
  CLI::App* command = app.add_subcommand("check", "Parse, type and cross-check a model and evidence");
  add_model_options(*command, *options);
  add_evidence_options(*command, *options);
  add_common_options(*command, *options);
  command->callback([options, &action] { action = [options] { return run_check(*options); }; });
}

}  // namespace sherlog::cli
