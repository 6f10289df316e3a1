// sherlog scenes import, export, check, schema: what goes into a store and comes out of it.
#include <fmt/format.h>

#include <fstream>
#include <iostream>
#include <memory>

#include "cli/output.h"
#include "cli/scenes.h"
#include "perception_bridge/annotation_types.h"
#include "perception_bridge/scene_lines.h"

namespace sherlog::cli {
namespace {

struct Importing {
  StoreChoice store;
  std::vector<std::string> files;
  std::string on_error = "stop";
  bool replace = false;
  std::uint64_t max_clusters = SceneLimits{}.max_clusters;
  std::string max_size;
};

struct Exporting {
  StoreChoice store;
  std::string output = "-";
  bool scenes_only = false;
};

Json import_json(const ImportResult& result, std::uint64_t scenes_in_store, double seconds) {
  Json json;
  json["schema"] = "sherlog.scenes.import/1";
  json["termination"] = to_string(result.termination);
  json["lines"] = result.lines;
  json["added"] = result.added;
  json["replaced"] = result.replaced;
  json["clusters"] = result.clusters;
  json["records"] = result.records;
  json["skipped"] = result.skipped;
  json["scenes_in_store"] = scenes_in_store;
  if (!result.failure.empty()) json["message"] = result.failure;
  json["problems"] = Json::array();
  for (const LineProblem& problem : result.problems) {
    json["problems"].push_back({{"line", problem.line}, {"message", problem.text}});
  }
  json["seconds"] = {{"total", seconds}};
  return json;
}

void add_up(const ImportResult& part, ImportResult& sum) {
  sum.lines += part.lines;
  sum.added += part.added;
  sum.replaced += part.replaced;
  sum.clusters += part.clusters;
  sum.records += part.records;
  sum.skipped += part.skipped;
  sum.problems.insert(sum.problems.end(), part.problems.begin(), part.problems.end());
  sum.termination = part.termination;
  sum.failure = part.failure;
}

void say_problems(Session& session, const std::string& file, const ImportResult& result, bool stops) {
  for (const LineProblem& warning : result.warnings) {
    session.warning(fmt::format("{}:{}: {}", file, warning.line, warning.text));
  }
  for (const LineProblem& problem : result.problems) {
    const std::string text = fmt::format("{}:{}: {}", file, problem.line, problem.text);
    if (stops) {
      session.error(text);
    } else {
      session.warning(text);
    }
  }
  if (!stops && result.skipped > result.problems.size()) {
    session.warning(fmt::format("{}: {} lines were skipped in all", file, result.skipped));
  }
  if (!result.failure.empty()) session.error(result.failure);
}

ImportResult import_file(SceneStore& store, const std::string& file, const ImportOptions& options, Session& session) {
  if (file == "-") return import_lines(store, std::cin, options, session.monitor());
  std::ifstream in(file, std::ios::binary);
  if (!in.is_open()) {
    ImportResult result;
    result.termination = Termination::kRefused;
    result.failure = fmt::format("cannot read '{}'", file);
    return result;
  }
  return import_lines(store, in, options, session.monitor());
}

// With `stop` all files are one transaction: a bad line in the last one takes back the first one too.
ImportResult import_files(SceneStore& store, const std::vector<std::string>& files, ImportOptions options,
                          Session& session) {
  const bool stops = options.on_error == OnError::kStop;
  ImportResult sum;
  const auto take_back = [&] {
    store.roll_back();
    sum.added = sum.replaced = sum.records = sum.clusters = 0;
    session.error("nothing was imported");
  };
  options.in_transaction = stops;
  if (stops && !store.begin()) {
    sum.termination = Termination::kRefused;
    sum.failure = store.problem();
    session.error(sum.failure);
    return sum;
  }
  for (const std::string& file : files) {
    const ImportResult result = import_file(store, file, options, session);
    say_problems(session, file, result, stops);
    add_up(result, sum);
    if (result.termination != Termination::kCompleted) break;
  }
  if (!stops) return sum;
  if (sum.termination == Termination::kCompleted && !store.commit()) {
    sum.termination = Termination::kRefused;
    sum.failure = store.problem();
    session.error(sum.failure);
  }
  if (sum.termination != Termination::kCompleted) take_back();
  return sum;
}

int run_import(Options options, const Importing& importing) {
  Session session(std::move(options));
  if (!session.check_options()) return kBadInput;
  SqlOpen how;
  if (!importing.max_size.empty()) {
    const auto bytes = parse_size(importing.max_size);
    if (!bytes)
      return session.error(fmt::format("--max-size: '{}' is not a size such as 500M or 2G", importing.max_size)),
             kBadInput;
    how.max_bytes = *bytes;
  }
  auto store = open_store(session, importing.store, how);
  if (!store) return kBadInput;
  ImportOptions import_options;
  import_options.on_error = importing.on_error == "skip" ? OnError::kSkip : OnError::kStop;
  import_options.replace = importing.replace;
  import_options.limits.max_clusters = importing.max_clusters;
  const ImportResult sum = import_files(*store, importing.files, import_options, session);
  const std::uint64_t scenes = store->scene_count();
  const std::string text = fmt::format(
      "{} scenes with {} clusters added, {} replaced, {} records, {} lines skipped; the store has {} scenes\n",
      sum.added, sum.clusters, sum.replaced, sum.records, sum.skipped, scenes);
  return session.finish(exit_code(sum.termination), text,
                        [&] { return to_text(import_json(sum, scenes, session.seconds())); });
}

int run_export(Options options, const Exporting& exporting) {
  Session session(std::move(options));
  std::vector<std::string> outputs = {exporting.output};
  if (!session.check_options(outputs)) return kBadInput;
  auto store = open_store(session, exporting.store, {.read_only = true});
  if (!store) return kBadInput;
  const auto filter = scene_filter(session, *store, exporting.store);
  if (!filter) return kBadInput;
  ExportOptions export_options;
  export_options.filter = *filter;
  export_options.conclusions = !exporting.scenes_only;
  std::string text;
  std::uint64_t lines = 0;
  bool stopped = false;
  const bool good = export_lines(*store, export_options, [&](std::string_view line) {
    text += line;
    ++lines;
    stopped = session.monitor().interrupted();
    return !stopped;
  });
  if (stopped) return session.error("interrupted; nothing was written"), kInterruptedExit;
  if (!good) return session.error(store->problem()), kBadInput;
  if (exporting.output != "-") {
    if (const auto problem = write_file(exporting.output, text)) return session.error(*problem), kInternalError;
  }
  return session.finish(kDone, exporting.output == "-" ? text : fmt::format("{} lines\n", lines), [&] {
    return to_text(Json{{"schema", "sherlog.scenes.export/1"}, {"lines", lines}});
  });
}

int run_check(Options options, const StoreChoice& choice) {
  Session session(std::move(options));
  if (!session.check_options()) return kBadInput;
  auto store = open_store(session, choice, {.read_only = true});
  if (!store) return kBadInput;
  const std::vector<std::string> problems = store->check();
  for (const std::string& problem : problems) session.error(problem);
  const std::uint64_t scenes = store->scene_count(), clusters = store->cluster_count();
  return session.finish(problems.empty() ? kDone : kBadInput,
                        fmt::format("{} scenes, {} clusters; {}\n", scenes, clusters,
                                    problems.empty() ? "the store is sound" : "the store is damaged"),
                        [&] {
                          Json json{{"schema", "sherlog.scenes.check/1"},
                                    {"version", kStoreVersion},
                                    {"scenes", scenes},
                                    {"clusters", clusters}};
                          json["problems"] = problems;
                          return to_text(json);
                        });
}

}  // namespace

void add_scenes_files(CLI::App& scenes, Action& action) {
  {
    auto options = std::make_shared<Options>();
    auto importing = std::make_shared<Importing>();
    CLI::App* command =
        scenes.add_subcommand("import", "Scenes into a store, one JSON document a line (docs/scenes.md)");
    add_store_option(*command, importing->store);
    command->add_option("FILE", importing->files, "JSON lines; '-': standard input")->required()->type_name("");
    command
        ->add_option("--on-error", importing->on_error,
                     "stop: a bad line takes everything back, of all files; skip: it is left out, and the rest goes on "
                     "(default stop)")
        ->type_name("stop|skip")
        ->check(one_of({"stop", "skip"}));
    command->add_flag("--replace", importing->replace, "A scene whose id the store has takes its place");
    command->add_option("--max-clusters", importing->max_clusters, "Refuse scenes with more (default 5000)")
        ->type_name("N")
        ->check(whole_number(1'000'000));
    command->add_option("--max-size", importing->max_size, "The store does not grow beyond, e.g. 500M, 2G")
        ->type_name("SIZE");
    add_common_options(*command, *options);
    command->callback(
        [options, importing, &action] { action = [options, importing] { return run_import(*options, *importing); }; });
  }
  {
    auto options = std::make_shared<Options>();
    auto exporting = std::make_shared<Exporting>();
    CLI::App* command =
        scenes.add_subcommand("export", "Scenes of a store, and what was concluded from them, as JSON lines");
    add_store_option(*command, exporting->store);
    command->add_option("-o,--output", exporting->output, "Where they go (default '-': standard output)")
        ->type_name("FILE|-");
    command->add_flag("--scenes-only", exporting->scenes_only, "Without evidence, beliefs and identities");
    add_time_options(*command, exporting->store);
    add_common_options(*command, *options);
    command->callback(
        [options, exporting, &action] { action = [options, exporting] { return run_export(*options, *exporting); }; });
  }
  {
    auto options = std::make_shared<Options>();
    auto choice = std::make_shared<StoreChoice>();
    CLI::App* command = scenes.add_subcommand("check", "Whether the file of a store is sound");
    add_store_option(*command, *choice);
    add_common_options(*command, *options);
    command->callback(
        [options, choice, &action] { action = [options, choice] { return run_check(*options, *choice); }; });
  }
  {
    auto options = std::make_shared<Options>();
    CLI::App* command = scenes.add_subcommand("schema", "The JSON Schema of a scene");
    add_common_options(*command, *options);
    command->callback([options, &action] {
      action = [options] {
        Session session(*options);
        if (!session.check_options()) return kBadInput;
        return session.finish(kDone, scene_json_schema(), [] { return scene_json_schema(); });
      };
    });
  }
}

}  // namespace sherlog::cli
