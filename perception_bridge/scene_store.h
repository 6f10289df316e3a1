// The scene store: everything that a robot saw and concluded, in one SQLite file.
//
// Idea      Rows as the observation is built: scenes have clusters, both have annotations; labels, places and times stand in
//           columns of their own with indices, so that "where is the milk?" is one look-up however long the robot has been
//           running. What was concluded (evidence, beliefs, identities and their sightings) hangs on the scenes it came from.
// Safety    Write-ahead log, foreign keys, every change in a transaction: a program that is killed at any point loses nothing
//           that was committed and leaves nothing half there. The schema has a version; older stores are brought up to date
//           when they are opened for writing, stores of a newer version are refused.
// Errors    calls return false or nothing and leave a sentence in problem()
// Cost      inserting: about 20 microseconds an annotation; indexed queries: well under 10 ms at 100,000 scenes
// Threads   one store object for each thread; several programs may read while one writes
#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <unordered_map>
#include <utility>
#include <vector>

#include "perception_bridge/scene.h"
#include "perception_bridge/sqlite.h"

namespace sherlog {

inline constexpr std::int64_t kStoreVersion = 3;

// Scenes with from <= time <= to, in the order of time.
struct SceneFilter {
  double from = -std::numeric_limits<double>::infinity();
  double to = std::numeric_limits<double>::infinity();
  // One of them is the place of the scene or of one of its clusters; empty: any place.
  std::vector<std::string> places = {};
  std::uint64_t limit = 0;  // 0: all
  bool newest_first = false;
};

struct SceneSummary {
  std::string id;
  double time = 0;
  std::string place;
  std::uint64_t clusters = 0, annotations = 0;
};

struct StoredEvidence {
  std::string scene, mapping, text;
};

// What was concluded from a scene: `kind` says by what (a model, a resolver), the document is its own.
struct StoredBelief {
  std::string scene, kind;
  Value document;
};

// One cluster taken for one identity.
struct Sighting {
  std::string scene, cluster;
  double time = 0;                                   // of the scene; filled by the store
  std::optional<double> probability = std::nullopt;  // where it is known
  std::string explanation = {};                      // stay, move, newview, appear
};

// An object that lasts; the fields of RoboSherlock's rs.scene.Object.
struct Identity {
  std::string id;
  double last_seen = 0;
  bool was_seen = false;  // in the scene before the last
  bool in_view = false;
  bool disappeared = false;
  Value::Object other = {};
  std::vector<Sighting> sightings = {};  // in the order of time
};

// A cluster that answers a question about a thing.
struct Found {
  std::string label;  // the name under which it was found
  std::string scene, cluster, place;
  double time = 0;
  std::optional<double> confidence;
  std::vector<double> position;  // empty: not known
  std::string frame;
};

// How much was concluded from a scene, and goes with it.
struct Conclusions {
  std::uint64_t evidence = 0, beliefs = 0, sightings = 0;

  bool any() const { return evidence + beliefs + sightings > 0; }
};

struct TypeCount {
  std::string type;  // its full name where it is known, however it was written
  std::uint64_t of_scenes = 0, of_clusters = 0;
};

struct TimeReport {
  struct Row {
    std::string annotator;
    std::uint64_t runs = 0;
    double mean = 0, deviation = 0;  // milliseconds; sample standard deviation, 0 with one run
  };
  std::vector<Row> annotators;  // in the order of their first run
  Row total;                    // by scene: the sum over its annotators
};

class SceneStore {
 public:
  // An empty or missing file becomes a store, unless it is opened for reading only or `create` is false.
  static std::optional<SceneStore> open(const std::string& path, const SqlOpen& how, std::string& problem);

  // The last problem; "" where there was none.
  const std::string& problem() const { return database_->ok() ? rolled_back_problem_ : database_->problem(); }

  // Asked now and then while the store is read: true ends it with a problem. For stores that are only read.
  void stop_when(std::function<bool()> wants_end) { database_->stop_when(std::move(wants_end)); }
  bool was_stopped() const { return database_->was_stopped(); }

  // Changes between begin and commit are there all or not at all; without them each call is a transaction of its own.
  bool begin();
  bool commit();
  void roll_back();
  // Nested in a transaction: takes back the changes since.
  bool set_mark();
  bool keep_mark();
  void return_to_mark();

  enum class Added : std::uint8_t { kNew, kReplaced, kUnchanged, kDuplicate, kFailed };
  // kDuplicate: the store has a scene of that id, and `replace` is false; nothing is changed. kUnchanged: it has this very
  // scene; what was concluded from it stays. A scene that is replaced loses that.
  Added add(const Scene& scene, bool replace = false);
  bool remove(std::string_view scene);
  // These replace what the scene (for that mapping, of that kind) or the identity had. False also where the scene or a
  // sighting's cluster is not in the store. Identities are found whatever the case of their names; so two that differ in
  // nothing else are a problem.
  bool add(const StoredEvidence& evidence);
  bool add(const StoredBelief& belief);
  bool add(const Identity& identity);
  bool remove_identity(std::string_view id);
  bool remove_beliefs(std::string_view kind);  // of all scenes

  bool has(std::string_view scene);
  std::optional<Scene> scene(std::string_view id);
  std::vector<SceneSummary> scenes(const SceneFilter& filter = {});
  // Until `visit` returns false.
  bool for_each_scene(const SceneFilter& filter, const std::function<bool(const Scene&)>& visit);
  std::optional<std::string> evidence(std::string_view scene, std::string_view mapping);
  std::optional<Value> belief(std::string_view scene, std::string_view kind);
  // That of the newest scene that has one of the kind.
  std::optional<StoredBelief> newest_belief(std::string_view kind);
  std::optional<Identity> identity(std::string_view id);
  // The id as the store spells it: upper and lower case are one.
  std::optional<std::string> identity_id(std::string_view id);
  Conclusions conclusions_of(std::string_view scene);
  std::vector<StoredEvidence> evidence_of(std::string_view scene);
  std::vector<StoredBelief> beliefs_of(std::string_view scene);
  std::vector<std::string> identities();

  // Newest first. `name`: an identity's, or a label that an annotator gave (upper and lower case are one).
  std::vector<Found> find(std::string_view name, const SceneFilter& filter);
  // All clusters at a place, in the order of time, each under its most confident label ("" without one). One that does not say
  // where it is, is where its scene is.
  std::vector<Found> at_place(std::string_view place, const SceneFilter& filter);
  // The time of the newest scene that looked at the place.
  std::optional<double> last_look(std::string_view place);
  std::optional<double> newest();
  // The scene before that one, by time.
  std::optional<std::string> scene_before(std::string_view scene);
  // Every name that annotators gave to the cluster, most confident first; then the identities that it was taken for.
  std::vector<std::string> names_of(std::string_view scene, std::string_view cluster);

  std::uint64_t scene_count();
  std::uint64_t cluster_count();
  std::vector<TypeCount> type_counts();
  // How many annotations of that type have which text in that field, most frequent first.
  std::vector<std::pair<std::string, std::uint64_t>> field_counts(std::string_view type, std::string_view field);
  TimeReport times();
  // What is wrong with the file, or nothing: SQLite's check of pages and indices, and the foreign keys.
  std::vector<std::string> check();

 private:
  explicit SceneStore(std::unique_ptr<SqlDatabase> database) : database_(std::move(database)) {}
  std::vector<std::int64_t> rows(const SceneFilter& filter);
  bool in_transaction(const std::function<void()>& body);
  // The rows of all spellings of a type, for an SQL list: "3,17".
  std::string type_rows(std::string_view type);
  std::int64_t type_row(std::string_view name);
  std::optional<std::int64_t> scene_row(std::string_view id);
  std::optional<std::int64_t> cluster_row(std::int64_t scene, std::string_view id);
  void insert(const Scene& scene);
  void insert_cluster(const Scene& scene, std::int64_t row, const Cluster& cluster);
  void insert_annotation(std::int64_t scene, std::optional<std::int64_t> cluster, const Annotation& annotation);
  void insert_labels(std::int64_t cluster, double time, const Cluster& source);
  Scene read(std::int64_t row);

  std::unique_ptr<SqlDatabase> database_;
  std::unordered_map<std::string, std::int64_t> types_;
  std::string rolled_back_problem_;  // what made a transaction end; a new one can begin all the same
};

// The statements that make an empty file a store of that version; what a test needs to make an old one.
std::string store_schema(std::int64_t version);

}  // namespace sherlog
