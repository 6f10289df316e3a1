// The tables of the scene store, version by version, and how a file becomes a store.
//
// To change the schema: add a step to kSteps (never edit one that was released), raise kStoreVersion, and extend the test that
// opens a store of each version.
#include <fmt/format.h>

#include <array>

#include "perception_bridge/scene_store.h"

namespace sherlog {
namespace {

constexpr std::int64_t kApplication = 0x53484c47;  // "SHLG" in the file's header, shown by file(1)

// Step i brings a store from version i to i + 1.
constexpr std::array<const char*, kStoreVersion> kSteps = {
    R"sql(
CREATE TABLE types(id INTEGER PRIMARY KEY, name TEXT NOT NULL UNIQUE);
CREATE TABLE scenes(
  id INTEGER PRIMARY KEY, name TEXT NOT NULL UNIQUE, time REAL NOT NULL, source TEXT, frame TEXT,
  place TEXT NOT NULL,          -- '' where nothing is said
  layout INTEGER NOT NULL,      -- how the document spells its list of clusters
  other TEXT);                  -- keys that are not known, as JSON
CREATE INDEX scenes_by_time ON scenes(time);
CREATE INDEX scenes_by_place ON scenes(place, time);
CREATE TABLE clusters(
  id INTEGER PRIMARY KEY, scene INTEGER NOT NULL REFERENCES scenes(id) ON DELETE CASCADE, name TEXT NOT NULL,
  scene_time REAL NOT NULL, time REAL, source TEXT, frame TEXT, confidence REAL,
  place TEXT NOT NULL, x REAL, y REAL, z REAL, position_frame TEXT, other TEXT,
  UNIQUE(scene, name));
CREATE INDEX clusters_by_place ON clusters(place, scene_time, scene);
CREATE TABLE annotations(
  id INTEGER PRIMARY KEY, scene INTEGER NOT NULL REFERENCES scenes(id) ON DELETE CASCADE,
  cluster INTEGER REFERENCES clusters(id) ON DELETE CASCADE,  -- NULL: about the whole scene
  type INTEGER NOT NULL REFERENCES types(id), name TEXT, source TEXT, frame TEXT, time REAL, confidence REAL,
  fields TEXT NOT NULL);
CREATE INDEX annotations_by_scene ON annotations(scene);
CREATE INDEX annotations_by_cluster ON annotations(cluster);
CREATE INDEX annotations_by_type ON annotations(type, cluster);
CREATE TABLE labels(
  label TEXT NOT NULL COLLATE NOCASE, time REAL NOT NULL,
  cluster INTEGER NOT NULL REFERENCES clusters(id) ON DELETE CASCADE, confidence REAL,
  PRIMARY KEY(label, time, cluster)) WITHOUT ROWID;
CREATE INDEX labels_by_cluster ON labels(cluster);
)sql",
    R"sql(
CREATE TABLE evidence(
  id INTEGER PRIMARY KEY, scene INTEGER NOT NULL REFERENCES scenes(id) ON DELETE CASCADE,
  mapping TEXT NOT NULL, text TEXT NOT NULL, UNIQUE(scene, mapping));
CREATE TABLE beliefs(
  id INTEGER PRIMARY KEY, scene INTEGER NOT NULL REFERENCES scenes(id) ON DELETE CASCADE,
  kind TEXT NOT NULL, document TEXT NOT NULL, UNIQUE(scene, kind));
CREATE TABLE identities(
  id INTEGER PRIMARY KEY, name TEXT NOT NULL UNIQUE COLLATE NOCASE, last_seen REAL NOT NULL, was_seen INTEGER NOT NULL,
  in_view INTEGER NOT NULL, disappeared INTEGER NOT NULL, other TEXT);
CREATE TABLE sightings(
  identity INTEGER NOT NULL REFERENCES identities(id) ON DELETE CASCADE, time REAL NOT NULL,
  cluster INTEGER NOT NULL REFERENCES clusters(id) ON DELETE CASCADE, probability REAL NOT NULL, explanation TEXT NOT NULL,
  PRIMARY KEY(identity, time, cluster)) WITHOUT ROWID;
CREATE INDEX sightings_by_cluster ON sightings(cluster);
)sql",
    // A sighting of the most probable world has no probability.
    R"sql(
CREATE TABLE sightings_3(
  identity INTEGER NOT NULL REFERENCES identities(id) ON DELETE CASCADE, time REAL NOT NULL,
  cluster INTEGER NOT NULL REFERENCES clusters(id) ON DELETE CASCADE, probability REAL, explanation TEXT NOT NULL,
  PRIMARY KEY(identity, time, cluster)) WITHOUT ROWID;
INSERT INTO sightings_3 SELECT identity, time, cluster, probability, explanation FROM sightings;
DROP TABLE sightings;
ALTER TABLE sightings_3 RENAME TO sightings;
CREATE INDEX sightings_by_cluster ON sightings(cluster);
)sql",
};

// Inside a transaction that holds the lock: another program may have been faster.
void bring_up_to_date(SqlDatabase& database) {
  const std::int64_t version = database.number("PRAGMA user_version");
  for (std::int64_t step = version; step < kStoreVersion; ++step) {
    database.execute(kSteps[static_cast<std::size_t>(step)]);
  }
  database.execute(fmt::format("PRAGMA application_id = {}; PRAGMA user_version = {}", kApplication, kStoreVersion));
}

// "" where the file is a store, or can become one.
std::string check_file(SqlDatabase& database) {
  const std::int64_t application = database.number("PRAGMA application_id");
  const std::int64_t version = database.number("PRAGMA user_version");
  const std::int64_t tables = database.number("SELECT count(*) FROM sqlite_master");
  if (!database.ok()) return database.problem();
  if (application != kApplication && (tables > 0 || application != 0 || version != 0)) {
    return fmt::format("'{}' is an SQLite file, but not a scene store", database.path());
  }
  if (version < 0) {
    return fmt::format("the store '{}' is damaged: its schema has the number {}", database.path(), version);
  }
  if (version > kStoreVersion) {
    return fmt::format("the store '{}' was made by a newer program (schema {}; this one knows schemas up to {})",
                       database.path(), version, kStoreVersion);
  }
  return {};
}

bool is_current(SqlDatabase& database) { return database.number("PRAGMA user_version") == kStoreVersion; }

// "" or the problem.
std::string prepare_for_writing(SqlDatabase& database) {
  if (database.number("SELECT count(*) FROM pragma_journal_mode WHERE journal_mode = 'wal'") == 0) {
    database.execute("PRAGMA journal_mode = WAL");
  }
  // FULL: what was committed survives a power cut too, not only a killed program.
  database.execute("PRAGMA synchronous = FULL; PRAGMA cache_size = -65536");
  if (is_current(database) || !database.execute("BEGIN IMMEDIATE")) return database.problem();
  bring_up_to_date(database);
  database.execute("COMMIT");
  std::string problem = database.problem();
  database.clear_problem();
  if (database.in_transaction()) database.execute("ROLLBACK");
  return problem;
}

}  // namespace

std::string store_schema(std::int64_t version) {
  std::string text;
  for (std::int64_t step = 0; step < version; ++step) text += kSteps[static_cast<std::size_t>(step)];
  return text + fmt::format("PRAGMA application_id = {}; PRAGMA user_version = {};", kApplication, version);
}

std::optional<SceneStore> SceneStore::open(const std::string& path, const SqlOpen& how, std::string& problem) {
  auto database = std::make_unique<SqlDatabase>(path, how);
  problem = database->ok() ? check_file(*database) : database->problem();
  if (!problem.empty()) return std::nullopt;
  if (!how.read_only) {
    problem = prepare_for_writing(*database);
    if (!problem.empty()) return std::nullopt;
  } else if (!is_current(*database)) {
    // An older store is brought up to date first.
    database.reset();
    SqlOpen writing = how;
    writing.read_only = false;
    writing.create = false;
    if (!open(path, writing, problem)) {
      problem += "; it has an older schema and has to be written once before it can be read";
      return std::nullopt;
    }
    return open(path, how, problem);
  }
  return SceneStore(std::move(database));
}

std::vector<std::string> SceneStore::check() {
  std::vector<std::string> problems;
  SqlStatement pages(*database_, "PRAGMA integrity_check(20)");
  while (pages.step()) {
    if (pages.text(0) != "ok") problems.push_back(pages.text(0));
  }
  SqlStatement keys(*database_, "PRAGMA foreign_key_check");
  while (keys.step() && problems.size() < 20) {
    problems.push_back(fmt::format("a row of {} belongs to a row of {} that is not there", keys.text(0), keys.text(2)));
  }
  if (!database_->ok()) problems.push_back(database_->problem());
  return problems;
}

}  // namespace sherlog
