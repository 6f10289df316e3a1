// The subcommands of `sherlog scenes`, and what they share: opening the store, times, concepts.
// To add one: a function here, its call in scenes.cpp and its words in scripts/docs.sh.
#pragma once

#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "cli/commands.h"
#include "cli/report.h"
#include "cli/session.h"
#include "perception_bridge/concepts.h"
#include "perception_bridge/evidence_mapping.h"
#include "perception_bridge/scene_store.h"

namespace sherlog::cli {

void add_scenes_generate(CLI::App& scenes, Action& action);
void add_scenes_files(CLI::App& scenes, Action& action);      // import, export, check, schema, types
void add_scenes_lists(CLI::App& scenes, Action& action);      // list, show, counts, times
void add_scenes_questions(CLI::App& scenes, Action& action);  // where, history, on
void add_scenes_evidence(CLI::App& scenes, Action& action);   // evidence, reprocess, mapping

// Which store, and which of its scenes.
struct StoreChoice {
  std::string path;
  double wait_seconds = 2;
  std::string from, to, during, now;
  double utc_offset = 0;  // hours
  std::string concepts;
  std::uint64_t limit = 0;
};

// The files of a store: its name, and what SQLite puts behind it.
inline constexpr const char* kStoreFiles[] = {"", "-wal", "-shm"};

void add_store_option(CLI::App& command, StoreChoice& choice);    // STORE, --wait
void add_time_options(CLI::App& command, StoreChoice& choice);    // --from --to --during --now --utc-offset
void add_concept_option(CLI::App& command, StoreChoice& choice);  // --concepts

// These say what is wrong and return nothing.
std::optional<SceneStore> open_store(Session& session, const StoreChoice& choice, SqlOpen how);
// For reading, which the command's limits end.
std::optional<SceneStore> open_to_read(Session& session, const StoreChoice& choice);
std::optional<SceneFilter> scene_filter(Session& session, SceneStore& store, const StoreChoice& choice);
std::optional<Concepts> read_concepts(Session& session, const StoreChoice& choice);
// What --mapping names: a shipped mapping, or a JSON file.
std::optional<EvidenceMapping> read_mapping(Session& session, const std::string& name);

// What the limits of the command say now: completed, interrupted or the time limit.
Termination stopped_by(Session& session);
// "interrupted", "the time limit was reached": for a sentence about how far it came.
std::string_view stop_words(Termination termination);
// After the store could not be read: says why, with a document of that schema where a limit did it. The exit code.
int finish_unread(Session& session, SceneStore& store, const char* schema);

// "12.5", "2012-11-22T08:30:00Z" (UTC), "2012-11-22", "2012-11-22T08:30:00" (UTC plus that many hours) in seconds.
std::optional<double> parse_time(std::string_view text, double utc_offset = 0);
// "2012-11-22 08:30:00", in UTC plus that many hours.
std::string time_text(double seconds, double utc_offset = 0);

// A library value as a document of the reports.
Json to_json(const Value& value);
Json to_json(const Found& found);
std::string position_text(const Found& found);

}  // namespace sherlog::cli
