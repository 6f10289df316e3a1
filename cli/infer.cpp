// sherlog infer: marginals, or the most probable world, for each database.
#include <fmt/format.h>

#include <memory>
#include <new>
#include <vector>

#include "cli/commands.h"
#include "cli/report.h"
#include "cli/session.h"

namespace sherlog::cli {
namespace {

// What was said to standard error about one answer: warnings, and why it is not complete.
void print_remarks(Session& session, const InferenceReport& report, const std::string& prefix) {
  const InferenceResult& result = report.result;
  for (const std::string& warning : result.warnings) session.warning(prefix + warning);
  switch (result.termination) {
    case Termination::kCompleted:
      break;
    case Termination::kNoPossibleWorld:
      session.print_message(conflict_text(report.conflict, prefix + result.message));
      break;
    default: {
      const std::string message = result.message.empty() ? std::string(to_string(result.termination)) : result.message;
      const bool answered = result.map.has_value() || !result.marginals.empty();
      session.error(prefix + message + (answered ? "; the answer is what was found so far" : ""));
    }
  }
}

// The database's network is kept in `network`, the report points to it.
void answer(Session& session, const Model& model, const Evidence& evidence, const Query& query,
            const GroundingOptions& options, std::optional<GroundNetwork>& network, InferenceReport& report) {
  session.restrict_memory();
  try {
    GroundingResult grounded = ground(model, evidence, query, options, session.monitor());
    report.seconds.ground = grounded.seconds;
    if (!grounded.network) {
      report.result.termination = grounded.termination;
      report.result.message = grounded.message;
      if (grounded.conflict) {
        report.conflict = conflict_items(*grounded.conflict);
        if (report.result.message.empty()) report.result.message = grounded.conflict->sentence;
      }
      return;
    }
    network = std::move(grounded.network);
    report.network = &*network;
    report.result = infer(*network, session.inference_options(), session.monitor());
    report.seconds.infer = report.result.seconds;
    session.release_memory();
    if (report.result.termination == Termination::kNoPossibleWorld) {
      report.conflict = conflict_items(model, evidence, *network, report.result.conflict);
    }
  } catch (const std::bad_alloc&) {
    session.release_memory();
    report.result.termination = Termination::kMemoryLimit;
    report.result.message = kMemoryMessage;
  }
}

// Says already what is known of the answer before it is sought.
InferenceReport blank_report(Session& session, const Model& model, const Evidence& evidence) {
  InferenceReport report;
  report.model = &model;
  report.evidence = &evidence;
  report.result.options = session.inference_options();
  report.result.method = report.result.options.method;
  report.result.seed = report.result.options.seed;
  return report;
}

int answer_all(Session& session) {
  if (session.options().queries.empty()) {
    session.error("nothing is asked: name predicates, ground atoms, patterns or formulas with -q");
    return kBadInput;
  }
  const auto model = session.read_model();
  if (!model) return kBadInput;
  const auto databases = session.read_evidence(*model);
  if (!databases) return kBadInput;
  auto grounding = session.grounding_options(*model);
  if (!grounding) return kBadInput;
  const auto queries = session.read_queries(*model, *databases);
  if (!queries) return kBadInput;
  const double parse_seconds = session.seconds();

  int code = kDone;
  std::string text;
  Json documents = Json::array();
  for (std::size_t d = 0; d < databases->size(); ++d) {
    const double start = session.seconds();
    grounding->max_seconds = session.seconds_left();
    std::optional<GroundNetwork> network;
    InferenceReport report = blank_report(session, *model, (*databases)[d]);
    answer(session, *model, (*databases)[d], (*queries)[d], *grounding, network, report);
    report.seconds.parse = parse_seconds;
    report.seconds.total = session.seconds() - start + parse_seconds;
    const std::string prefix = databases->size() > 1 ? fmt::format("database {}: ", d + 1) : "";
    print_remarks(session, report, prefix);
    if (databases->size() > 1) text += fmt::format("{}--- database {}\n", d == 0 ? "" : "\n", d + 1);
    text += infer_text(report);
    documents.push_back(infer_json(report));
    if (code == kDone) code = exit_code(report.result.termination);
    if (report.result.termination == Termination::kInterrupted) {
      code = kInterruptedExit;
      break;
    }
  }
  return session.finish(code, text, [&] {
    if (databases->size() == 1) return to_text(documents[0]);
    Json document;
    document["schema"] = "sherlog.infer/1";
    document["databases"] = std::move(documents);
    return to_text(document);
  });
}

int run_infer(Options options) {
  Session session(std::move(options));
  if (!session.check_options()) return kBadInput;
  return session.run(
      "sherlog.infer/1", [&] { return answer_all(session); }, true);
}

}  // namespace

void add_infer(CLI::App& app, Action& action) {
  auto options = std::make_shared<Options>();
  CLI::App* command =
      app.add_subcommand("infer", "Marginal probabilities, or with --method map the most probable world");
  add_model_options(*command, *options);
  add_evidence_options(*command, *options);
  add_query_options(*command, *options);
  add_world_options(*command, *options);
  add_inference_options(*command, *options);
  add_common_options(*command, *options);
  command->callback([options, &action] { action = [options] { return run_infer(*options); }; });
}

}  // namespace sherlog::cli
