// sherlog advise: which annotator to run next, by expected drop of entropy for each second of its run time.
#include <fmt/format.h>

#include <limits>
#include <memory>

#include "cli/annotator_costs.h"
#include "cli/commands.h"
#include "cli/report.h"
#include "cli/session.h"
#include "cli/table.h"
#include "inference/advice.h"

namespace sherlog::cli {
namespace {

struct Advising {
  std::string costs;
  std::size_t top = 20;
  std::size_t max_outcomes = InformationOptions{}.max_outcomes;
};

bool has_figures(const Advice& advice) { return advice.termination == Termination::kCompleted || advice.mcse; }

std::string advice_text(const AdviceResult& result, const std::vector<AnnotatorCost>& annotators, std::size_t top) {
  if (result.entropy.termination != Termination::kCompleted || !result.grounding.network) return "";
  std::string text;
  if (result.entropy.joint) text += fmt::format("entropy of what is asked: {:.6f} nats", *result.entropy.joint);
  text += fmt::format("{}{:.6f} nats one by one (method {})\n\n", text.empty() ? "entropy of what is asked: " : ", ",
                      result.entropy.marginal, fmt::join(result.methods, ", "));
  if (result.advice.empty()) return text + "no annotator is left to run\n";
  bool drawn = false;
  for (const Advice& advice : result.advice) drawn = drawn || advice.mcse;
  std::vector<std::pair<std::string, Align>> columns{{"annotator", Align::kLeft},
                                                     {"cluster", Align::kLeft},
                                                     {"expected drop", Align::kRight},
                                                     {"seconds", Align::kRight},
                                                     {"drop a second", Align::kRight}};
  if (drawn) columns.insert(columns.begin() + 3, {"mcse", Align::kRight});
  Table table(std::move(columns));
  std::size_t shown = 0;
  for (const Advice& advice : result.advice) {
    if (shown++ == top) break;
    const AnnotatorCost& annotator = annotators[advice.annotator];
    std::vector<std::string> row{annotator.name,
                                 advice.cluster.empty() ? "-" : fmt::format("{}", fmt::join(advice.cluster, ","))};
    row.push_back(has_figures(advice) ? fmt::format("{:.6f}", advice.expected_entropy_drop)
                                      : std::string(to_string(advice.termination)));
    if (drawn) row.push_back(advice.mcse ? fmt::format("{:.6f}", *advice.mcse) : "");
    row.push_back(fmt::format("{:.6g}", annotator.seconds));
    row.push_back(has_figures(advice) ? fmt::format("{:.6f}", advice.drop_per_second) : "");
    table.add_row(std::move(row));
  }
  text += table.text();
  if (result.advice.size() > top)
    text += fmt::format("  and {} more (--top N shows more)\n", result.advice.size() - top);
  return text;
}

Json advice_json(const AdviceResult& result, const std::vector<AnnotatorCost>& annotators,
                 const std::vector<ConflictItem>& conflict, double seconds) {
  Json json;
  json["schema"] = "sherlog.advise/1";
  json["termination"] = to_string(result.termination);
  if (!result.message.empty()) json["message"] = result.message;
  if (!conflict.empty()) json["conflict"] = conflict_json(conflict);
  if (!result.methods.empty()) json["method"] = fmt::format("{}", fmt::join(result.methods, ","));
  json["seconds"] = {{"total", seconds}};
  if (!result.grounding.network || result.entropy.termination != Termination::kCompleted) return json;
  if (result.entropy.joint) json["entropy"] = *result.entropy.joint;
  json["marginal_entropy"] = result.entropy.marginal;
  json["annotators"] = Json::array();
  for (const Advice& advice : result.advice) {
    Json entry;
    entry["annotator"] = annotators[advice.annotator].name;
    if (!advice.cluster.empty()) entry["cluster"] = fmt::format("{}", fmt::join(advice.cluster, ","));
    if (has_figures(advice)) entry["expected_entropy_drop"] = advice.expected_entropy_drop;
    if (advice.mcse) entry["mcse"] = *advice.mcse;
    entry["seconds"] = annotators[advice.annotator].seconds;
    if (has_figures(advice)) entry["drop_per_second"] = advice.drop_per_second;
    if (advice.termination != Termination::kCompleted) {
      entry["termination"] = to_string(advice.termination);
      entry["message"] = advice.message;
    }
    json["annotators"].push_back(std::move(entry));
  }
  return json;
}

std::optional<std::vector<AnnotatorCost>> annotators_of(Session& session, const Model& model, const Query& query,
                                                        const std::string& costs) {
  if (!costs.empty()) {
    auto read = read_annotators(model, costs, session.diagnostics());
    session.print_diagnostics();
    if (read && read->empty()) session.error(fmt::format("{}: no annotators", costs));
    return read && !read->empty() ? std::move(read) : std::nullopt;
  }
  std::vector<AnnotatorCost> known = default_annotators(model);
  std::erase_if(known, [&](const AnnotatorCost& annotator) {  // what is asked is no annotator's business
    return std::any_of(query.items.begin(), query.items.end(), [&](const QueryItem& item) {
      return item.kind == QueryItem::Kind::kAtoms && item.predicate == annotator.predicates.front();
    });
  });
  if (known.empty()) {
    session.error("no predicate of the model is a known annotator: name them, with their run times, by --costs FILE");
    return std::nullopt;
  }
  return known;
}

void print_problem(Session& session, const Model& model, const Evidence& evidence, const AdviceResult& result,
                   std::vector<ConflictItem>& conflict) {
  if (result.termination == Termination::kCompleted) return;
  if (result.termination != Termination::kNoPossibleWorld) {
    session.error(result.message.empty() ? to_string(result.termination) : result.message);
    return;
  }
  if (result.grounding.conflict) {
    conflict = conflict_items(*result.grounding.conflict);
  } else if (result.grounding.network) {
    conflict = conflict_items(model, evidence, *result.grounding.network, result.entropy.result.conflict);
  }
  session.print_message(conflict_text(conflict, result.message));
}

int advise_one_scene(Session& session, const Advising& advising) {
  const auto model = session.read_model();
  if (!model) return kBadInput;
  const auto databases = session.read_evidence(*model);
  if (!databases) return kBadInput;
  if (databases->size() != 1) {
    session.error(fmt::format("'advise' answers for one scene, and the evidence has {}", databases->size()));
    return kBadInput;
  }
  const Evidence& evidence = databases->front();
  const auto queries = session.read_queries(*model, *databases);
  if (!queries) return kBadInput;
  const Query* query = &queries->front();
  const auto annotators = annotators_of(session, *model, *query, advising.costs);
  if (!annotators) return kBadInput;
  AdviceOptions advice_options;
  const auto grounding = session.grounding_options(*model);
  if (!grounding) return kBadInput;
  advice_options.grounding = *grounding;
  advice_options.information.inference = session.inference_options();
  advice_options.information.max_outcomes = advising.max_outcomes;

  const AdviceResult result = advise(*model, evidence, *query, *annotators, advice_options, session.monitor());
  session.release_memory();
  for (const std::string& warning : result.entropy.result.warnings) session.warning(warning);
  std::vector<ConflictItem> conflict;
  print_problem(session, *model, evidence, result, conflict);
  return session.finish(exit_code(result.termination), advice_text(result, *annotators, advising.top),
                        [&] { return to_text(advice_json(result, *annotators, conflict, session.seconds())); });
}

int run_advise(Options options, const Advising& advising) {
  Session session(std::move(options));
  if (!session.check_options({}, advising.costs.empty() ? std::vector<std::string>() : std::vector{advising.costs}))
    return kBadInput;
  if (advising.max_outcomes == 0) return session.error("--max-outcomes: 0 is not at least 1"), kBadInput;
  return session.run("sherlog.advise/1", [&] { return advise_one_scene(session, advising); });
}

}  // namespace

void add_advise(CLI::App& app, Action& action) {
  auto options = std::make_shared<Options>();
  auto advising = std::make_shared<Advising>();
  CLI::App* command = app.add_subcommand(
      "advise", "Which annotator to run next: expected drop of entropy for each second of its run time");
  add_model_options(*command, *options);
  add_evidence_options(*command, *options);
  add_query_options(*command, *options);
  command->get_option("--query")->required();
  command
      ->add_option("--costs", advising->costs,
                   "Annotators and their run times: lines 'name seconds [predicate ..]', or JSON {\"name\": seconds}; "
                   "without: published run times for shape, color, size, linemod and goggles_...")
      ->type_name("FILE");
  command->add_option("--top", advising->top, "How many annotators the text shows (default 20)")->type_name("N");
  command
      ->add_option("--max-outcomes", advising->max_outcomes,
                   "Sum over at most so many different outcomes of an annotator; draw them beyond (default 4096)")
      ->type_name("N");
  add_world_options(*command, *options);
  add_inference_options(*command, *options);
  add_common_options(*command, *options);
  command->callback(
      [options, advising, &action] { action = [options, advising] { return run_advise(*options, *advising); }; });
}

}  // namespace sherlog::cli
