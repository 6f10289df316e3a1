// sherlog scenes import, export, check, schema: what goes into a store and comes out of it.
#include <fmt/format.h>

#include <filesystem>
#include <fstream>
#include <iostream>
#include <memory>

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

// Of all files.
struct Imported {
  ImportResult sum;
  struct File {
    std::string name;
    std::vector<std::uint64_t> skipped;
    std::vector<LineProblem> problems;
  };
  std::vector<File> files;  // with bad lines
};

Json import_json(const Imported& imported, std::uint64_t scenes_in_store, double seconds) {
  const ImportResult& result = imported.sum;
  Json json;
  json["schema"] = "sherlog.scenes.import/1";
  json["termination"] = to_string(result.termination);
  json["lines"] = result.lines;
  json["added"] = result.added;
  json["replaced"] = result.replaced;
  json["unchanged"] = result.unchanged;
  if (result.designators > 0) json["designators"] = result.designators;
  json["clusters"] = result.clusters;
  json["records"] = result.records;
  if (result.dropped.any()) {
    json["dropped"] = {{"evidence", result.dropped.evidence},
                       {"beliefs", result.dropped.beliefs},
                       {"sightings", result.dropped.sightings}};
  }
  json["skipped"] = result.skipped.size();
  json["scenes_in_store"] = scenes_in_store;
  if (!result.failure.empty()) json["message"] = result.failure;
  json["problems"] = Json::array();
  for (const Imported::File& file : imported.files) {
    for (const LineProblem& problem : file.problems) {
      json["problems"].push_back({{"file", file.name}, {"line", problem.line}, {"message", problem.text}});
    }
    json["bad_lines"].push_back({{"file", file.name}, {"lines", file.skipped}});
  }
  json["seconds"] = {{"total", seconds}};
  return json;
}

void add_up(const ImportResult& part, ImportResult& sum) {
  sum.lines += part.lines;
  sum.added += part.added;
  sum.replaced += part.replaced;
  sum.unchanged += part.unchanged;
  sum.designators += part.designators;
  sum.clusters += part.clusters;
  sum.records += part.records;
  sum.dropped.evidence += part.dropped.evidence;
  sum.dropped.beliefs += part.dropped.beliefs;
  sum.dropped.sightings += part.dropped.sightings;
  sum.skipped.insert(sum.skipped.end(), part.skipped.begin(), part.skipped.end());
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
  if (!stops && result.skipped.size() > result.problems.size()) {
    session.warning(fmt::format("{}: {} lines were skipped in all", file, result.skipped.size()));
  }
  if (!result.failure.empty()) session.error(result.failure);
  if (result.termination == Termination::kTimeLimit || result.termination == Termination::kInterrupted) {
    session.error(fmt::format("{}: {} after {} lines", file, stop_words(result.termination), result.lines));
  }
}

ImportResult import_file(SceneStore& store, const std::string& file, const ImportOptions& options, Session& session) {
  if (file == "-") return import_lines(store, std::cin, options, session.monitor());
  std::ifstream in(file, std::ios::binary);
  std::error_code ignored;
  const bool is_directory = std::filesystem::is_directory(file, ignored);
  if (!in.is_open() || is_directory) {
    ImportResult result;
    result.termination = Termination::kRefused;
    result.failure = fmt::format("cannot read '{}'{}", file, is_directory ? ": it is a directory" : "");
    return result;
  }
  return import_lines(store, in, options, session.monitor());
}

// With `stop` all files are one transaction: a bad line in the last one takes back the first one too.
Imported import_files(SceneStore& store, const std::vector<std::string>& files, ImportOptions options,
                      Session& session) {
  const bool stops = options.on_error == OnError::kStop;
  Imported imported;
  ImportResult& sum = imported.sum;
  const auto fail = [&] {
    sum.termination = Termination::kRefused;
    sum.failure = store.problem();
    session.error(sum.failure);
  };
  options.in_transaction = stops;
  if (stops && !store.begin()) {
    fail();
    return imported;
  }
  for (const std::string& file : files) {
    options.max_seconds = session.seconds_left();
    const ImportResult result = import_file(store, file, options, session);
    say_problems(session, file, result, stops);
    add_up(result, sum);
    if (!result.skipped.empty()) imported.files.push_back({file, result.skipped, result.problems});
    if (result.termination != Termination::kCompleted) break;
  }
  if (!stops) return imported;
  if (sum.termination == Termination::kCompleted && !store.commit()) fail();
  if (sum.termination == Termination::kCompleted) return imported;
  store.roll_back();
  sum.added = sum.replaced = sum.unchanged = sum.designators = sum.records = sum.clusters = 0;
  sum.dropped = {};
  session.error("nothing was imported");
  return imported;
}

std::string import_text(const ImportResult& sum, std::uint64_t scenes) {
  std::string text = fmt::format("{} scenes with {} clusters added, {} replaced, {} records, {} lines skipped",
                                 sum.added, sum.clusters, sum.replaced, sum.records, sum.skipped.size());
  if (sum.unchanged > 0) text += fmt::format(", {} as they were", sum.unchanged);
  text += fmt::format("; the store has {} scenes\n", scenes);
  if (sum.dropped.any()) {
    text += fmt::format("dropped with what was replaced: evidence of {}, {} beliefs, {} sightings\n",
                        sum.dropped.evidence, sum.dropped.beliefs, sum.dropped.sightings);
  }
  return text;
}

// A store that was made for nothing goes away again.
void remove_store(const std::string& path) {
  std::error_code ignored;
  for (const char* end : kStoreFiles) std::filesystem::remove(path + end, ignored);
}

int import_into(Session& session, const Importing& importing, const SqlOpen& how) {
  std::error_code ignored;
  const bool existed = std::filesystem::exists(importing.store.path, ignored);
  auto store = open_store(session, importing.store, how);
  if (!store) {
    if (!existed && std::filesystem::is_regular_file(importing.store.path, ignored)) remove_store(importing.store.path);
    return kBadInput;
  }
  ImportOptions import_options;
  import_options.on_error = importing.on_error == "skip" ? OnError::kSkip : OnError::kStop;
  import_options.replace = importing.replace;
  import_options.limits.max_clusters = importing.max_clusters;
  const Imported imported = import_files(*store, importing.files, import_options, session);
  const std::uint64_t scenes = store->scene_count();
  if (!existed && scenes == 0 && imported.sum.termination != Termination::kCompleted) {
    store.reset();
    remove_store(importing.store.path);
  }
  return session.finish(exit_code(imported.sum.termination), import_text(imported.sum, scenes),
                        [&] { return to_text(import_json(imported, scenes, session.seconds())); });
}

int run_import(Options options, const Importing& importing) {
  Session session(std::move(options));
  if (!session.check_options({}, importing.files)) return kBadInput;
  SqlOpen how;
  if (!importing.max_size.empty()) {
    const auto bytes = parse_size(importing.max_size);
    if (!bytes)
      return session.error(fmt::format("--max-size: '{}' is not a size such as 500M or 2G", importing.max_size)),
             kBadInput;
    how.max_bytes = *bytes;
  }
  return session.run("sherlog.scenes.import/1", [&] { return import_into(session, importing, how); });
}

int export_from(Session& session, const Exporting& exporting) {
  auto store = open_to_read(session, exporting.store);
  if (!store) return kBadInput;
  const auto filter = scene_filter(session, *store, exporting.store);
  if (!filter) return kBadInput;
  ExportOptions export_options;
  export_options.filter = *filter;
  export_options.conclusions = !exporting.scenes_only;
  std::string text;
  std::uint64_t lines = 0;
  const bool good = export_lines(*store, export_options, [&](std::string_view line) {
    text += line;
    ++lines;
    return true;
  });
  Termination termination = Termination::kCompleted;
  if (!good && !store->was_stopped()) return session.error(store->problem()), kBadInput;
  if (!good) {
    termination = stopped_by(session);
    session.error(fmt::format("{} after {} lines; the rest is missing", stop_words(termination), lines));
  }
  if (exporting.output != "-") {
    if (!session.write(exporting.output, text)) return kInternalError;
    text = fmt::format("{} lines\n", lines);
  }
  return session.finish(exit_code(termination), text, [&] {
    return to_text(
        Json{{"schema", "sherlog.scenes.export/1"}, {"termination", to_string(termination)}, {"lines", lines}});
  });
}

int run_export(Options options, const Exporting& exporting) {
  Session session(std::move(options));
  if (!session.check_options({exporting.output})) return kBadInput;
  return session.run("sherlog.scenes.export/1", [&] { return export_from(session, exporting); });
}

int run_check(Options options, const StoreChoice& choice) {
  Session session(std::move(options));
  if (!session.check_options()) return kBadInput;
  auto store = open_to_read(session, choice);
  if (!store) return kBadInput;
  const std::vector<std::string> problems = store->check();
  if (store->was_stopped()) return finish_unread(session, *store, "sherlog.scenes.check/1");
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
    command->add_flag("--replace", importing->replace,
                      "What the store has under an id, a scene or a record, makes place for the new one");
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
