// What is asked of the scene store: lists, places and times of things, counts and run times.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "perception_bridge/annotation_types.h"
#include "perception_bridge/scene_store.h"

namespace sherlog {
namespace {

// A time that SQLite can compare: infinities become the largest numbers.
double bounded(double time) {
  constexpr double kMost = std::numeric_limits<double>::max();
  return std::clamp(time, -kMost, kMost);
}

std::int64_t row_limit(const SceneFilter& filter) {
  constexpr std::uint64_t kMost = std::numeric_limits<std::int64_t>::max();
  return filter.limit == 0 ? -1 : static_cast<std::int64_t>(std::min(filter.limit, kMost));
}

// Columns first, first + 1, ...: scene, cluster, place, time, position_frame, x, y, z.
Found read_found(const SqlStatement& row, std::string label, std::optional<double> confidence, int first) {
  Found found;
  found.label = std::move(label);
  found.confidence = confidence;
  found.scene = row.text(first);
  found.cluster = row.text(first + 1);
  found.place = row.text(first + 2);
  found.time = row.real(first + 3);
  found.frame = row.text(first + 4);
  for (int i = first + 5; i < first + 8 && !row.is_null(i); ++i) found.position.push_back(row.real(i));
  return found;
}

// Mean and sample standard deviation of what comes one by one (Welford).
struct RunningMoments {
  std::uint64_t count = 0;
  double mean = 0, squares = 0;

  void add(double value) {
    ++count;
    const double before = value - mean;
    mean += before / static_cast<double>(count);
    squares += before * (value - mean);
  }
  TimeReport::Row row(std::string name) const {
    return {std::move(name), count, mean, count < 2 ? 0.0 : std::sqrt(squares / static_cast<double>(count - 1))};
  }
};

constexpr const char* kOldestFirst = "SELECT id FROM scenes WHERE time BETWEEN ?1 AND ?2 ORDER BY time, id LIMIT ?3";
constexpr const char* kNewestFirst =
    "SELECT id FROM scenes WHERE time BETWEEN ?1 AND ?2 ORDER BY time DESC, id DESC LIMIT ?3";
// Both sides come sorted out of their index and are merged, so that a limit ends the search early.
constexpr const char* kPlaceOldestFirst =
    "SELECT id, time FROM scenes WHERE place = ?4 AND time BETWEEN ?1 AND ?2 UNION "
    "SELECT scene, scene_time FROM clusters WHERE place = ?4 AND scene_time BETWEEN ?1 AND ?2 ORDER BY 2, 1 LIMIT ?3";
constexpr const char* kPlaceNewestFirst =
    "SELECT id, time FROM scenes WHERE place = ?4 AND time BETWEEN ?1 AND ?2 UNION "
    "SELECT scene, scene_time FROM clusters WHERE place = ?4 AND scene_time BETWEEN ?1 AND ?2 "
    "ORDER BY 2 DESC, 1 DESC LIMIT ?3";

}  // namespace

std::vector<std::int64_t> SceneStore::rows(const SceneFilter& filter) {
  std::vector<std::int64_t> result;
  const char* sql = filter.place.empty() ? (filter.newest_first ? kNewestFirst : kOldestFirst)
                                         : (filter.newest_first ? kPlaceNewestFirst : kPlaceOldestFirst);
  SqlStatement& query = database_->statement(sql);
  query.bind(bounded(filter.from)).bind(bounded(filter.to)).bind(row_limit(filter));
  if (!filter.place.empty()) query.bind(std::string_view(filter.place));
  while (query.step()) result.push_back(query.whole(0));
  return result;
}

std::vector<SceneSummary> SceneStore::scenes(const SceneFilter& filter) {
  std::vector<SceneSummary> result;
  for (const std::int64_t row : rows(filter)) {
    SqlStatement& query = database_->statement(
        "SELECT name, time, place, (SELECT count(*) FROM clusters c WHERE c.scene = s.id), "
        "(SELECT count(*) FROM annotations a WHERE a.scene = s.id), "
        "(SELECT c.place FROM clusters c WHERE c.scene = s.id AND c.place <> '' ORDER BY c.id LIMIT 1) "
        "FROM scenes s WHERE s.id = ?");
    if (!query.bind(row).step()) continue;
    // A scene that does not say where it is, is where its first cluster is.
    result.push_back({query.text(0), query.real(1), query.text(query.text(2).empty() ? 5 : 2),
                      static_cast<std::uint64_t>(query.whole(3)), static_cast<std::uint64_t>(query.whole(4))});
    query.reset();
  }
  return result;
}

bool SceneStore::for_each_scene(const SceneFilter& filter, const std::function<bool(const Scene&)>& visit) {
  for (const std::int64_t row : rows(filter)) {
    const Scene scene = read(row);
    if (!database_->ok()) return false;
    if (!visit(scene)) break;
  }
  return database_->ok();
}

std::vector<Found> SceneStore::find(std::string_view name, const SceneFilter& filter) {
  std::vector<Found> result;
  SqlStatement& sightings = database_->statement(
      "SELECT i.name, g.probability, s.name, c.name, c.place, g.time, c.position_frame, c.x, c.y, c.z "
      "FROM identities i JOIN sightings g ON g.identity = i.id JOIN clusters c ON c.id = g.cluster "
      "JOIN scenes s ON s.id = c.scene "
      "WHERE i.name = ? AND g.time BETWEEN ? AND ? ORDER BY g.time DESC, c.id LIMIT ?");
  sightings.bind(name).bind(bounded(filter.from)).bind(bounded(filter.to)).bind(row_limit(filter));
  while (sightings.step()) {
    result.push_back(read_found(sightings, sightings.text(0), sightings.maybe_real(1), 2));
  }
  if (!result.empty()) return result;
  SqlStatement& labels = database_->statement(
      "SELECT l.label, l.confidence, s.name, c.name, c.place, l.time, c.position_frame, c.x, c.y, c.z "
      "FROM labels l JOIN clusters c ON c.id = l.cluster JOIN scenes s ON s.id = c.scene "
      "WHERE l.label = ? AND l.time BETWEEN ? AND ? ORDER BY l.time DESC, l.cluster LIMIT ?");
  labels.bind(name).bind(bounded(filter.from)).bind(bounded(filter.to)).bind(row_limit(filter));
  while (labels.step()) result.push_back(read_found(labels, labels.text(0), labels.maybe_real(1), 2));
  return result;
}

std::vector<Found> SceneStore::at_place(std::string_view place, const SceneFilter& filter) {
  std::vector<Found> result;
  SqlStatement& query = database_->statement(
      "SELECT c.id, s.name, c.name, c.place, c.scene_time, c.position_frame, c.x, c.y, c.z "
      "FROM clusters c JOIN scenes s ON s.id = c.scene "
      "WHERE c.place = ? AND c.scene_time BETWEEN ? AND ? ORDER BY c.scene_time, c.id LIMIT ?");
  query.bind(place).bind(bounded(filter.from)).bind(bounded(filter.to)).bind(row_limit(filter));
  while (query.step()) {
    SqlStatement& best = database_->statement(
        "SELECT label, confidence FROM labels WHERE cluster = ? ORDER BY confidence DESC, label LIMIT 1");
    std::string label;
    std::optional<double> confidence;
    if (best.bind(query.whole(0)).step()) {
      label = best.text(0);
      confidence = best.maybe_real(1);
      best.reset();
    }
    result.push_back(read_found(query, std::move(label), confidence, 1));
  }
  return result;
}

std::vector<std::string> SceneStore::labels_of(std::string_view scene, std::string_view cluster) {
  std::vector<std::string> result;
  SqlStatement& query = database_->statement(
      "SELECT l.label FROM labels l JOIN clusters c ON c.id = l.cluster JOIN scenes s ON s.id = c.scene "
      "WHERE s.name = ? AND c.name = ? ORDER BY l.confidence DESC, l.label");
  query.bind(scene).bind(cluster);
  while (query.step()) result.push_back(query.text(0));
  return result;
}

std::optional<double> SceneStore::last_look(std::string_view place) {
  SqlStatement& query = database_->statement(
      "SELECT max(t) FROM (SELECT max(scene_time) AS t FROM clusters WHERE place = ?1 UNION ALL "
      "SELECT max(time) FROM scenes WHERE place = ?1)");
  if (!query.bind(place).step()) return std::nullopt;
  const auto time = query.maybe_real(0);
  query.reset();
  return time;
}

std::optional<double> SceneStore::newest() {
  SqlStatement& query = database_->statement("SELECT max(time) FROM scenes");
  if (!query.step()) return std::nullopt;
  const auto time = query.maybe_real(0);
  query.reset();
  return time;
}

std::optional<std::string> SceneStore::scene_before(std::string_view scene) {
  SqlStatement& query = database_->statement(
      "SELECT b.name FROM scenes a JOIN scenes b ON (b.time, b.id) < (a.time, a.id) WHERE a.name = ? "
      "ORDER BY b.time DESC, b.id DESC LIMIT 1");
  if (!query.bind(scene).step()) return std::nullopt;
  std::string name = query.text(0);
  query.reset();
  return name;
}

std::uint64_t SceneStore::scene_count() {
  return static_cast<std::uint64_t>(database_->number("SELECT count(*) FROM scenes"));
}

std::uint64_t SceneStore::cluster_count() {
  return static_cast<std::uint64_t>(database_->number("SELECT count(*) FROM clusters"));
}

std::vector<TypeCount> SceneStore::type_counts() {
  std::vector<TypeCount> result;
  SqlStatement query(*database_,
                     "SELECT t.name, count(*) - count(a.cluster), count(a.cluster) FROM annotations a "
                     "JOIN types t ON t.id = a.type GROUP BY a.type ORDER BY t.name");
  while (query.step()) {
    result.push_back(
        {query.text(0), static_cast<std::uint64_t>(query.whole(1)), static_cast<std::uint64_t>(query.whole(2))});
  }
  return result;
}

std::vector<std::pair<std::string, std::uint64_t>> SceneStore::field_counts(std::string_view type,
                                                                            std::string_view field) {
  std::vector<std::pair<std::string, std::uint64_t>> result;
  SqlStatement query(*database_,
                     "SELECT json_extract(a.fields, '$.' || ?) AS value, count(*) FROM annotations a "
                     "WHERE a.type = (SELECT id FROM types WHERE name = ?) AND value IS NOT NULL "
                     "GROUP BY value ORDER BY count(*) DESC, value");
  query.bind(field).bind(type);
  while (query.step()) result.emplace_back(query.text(0), static_cast<std::uint64_t>(query.whole(1)));
  return result;
}

TimeReport SceneStore::times() {
  TimeReport report;
  std::vector<std::pair<std::string, RunningMoments>> annotators;
  RunningMoments total;
  SqlStatement query(
      *database_,
      "SELECT a.scene, json_extract(a.fields, '$.annotator'), json_extract(a.fields, '$.milliseconds') AS ms "
      "FROM annotations a JOIN types t ON t.id = a.type "
      "WHERE t.name = 'rs.annotation.LoggingInformation' AND ms IS NOT NULL ORDER BY a.scene, a.id");
  std::optional<std::int64_t> scene;
  double sum = 0;
  while (query.step()) {
    if (scene && *scene != query.whole(0)) {
      total.add(sum);
      sum = 0;
    }
    scene = query.whole(0);
    sum += query.real(2);
    const std::string name = query.text(1);
    auto entry =
        std::find_if(annotators.begin(), annotators.end(), [&](const auto& other) { return other.first == name; });
    if (entry == annotators.end()) entry = annotators.insert(annotators.end(), {name, {}});
    entry->second.add(query.real(2));
  }
  if (scene) total.add(sum);
  for (const auto& [name, moments] : annotators) report.annotators.push_back(moments.row(name));
  report.total = total.row("total");
  return report;
}

}  // namespace sherlog
