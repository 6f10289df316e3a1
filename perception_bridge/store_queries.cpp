// What is asked of the scene store: lists, places and times of things, counts and run times.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <map>

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

constexpr const char* kOldestFirst =
    "SELECT id, time FROM scenes WHERE time BETWEEN ?1 AND ?2 ORDER BY time, id LIMIT ?3";
constexpr const char* kNewestFirst =
    "SELECT id, time FROM scenes WHERE time BETWEEN ?1 AND ?2 ORDER BY time DESC, id DESC LIMIT ?3";
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
  std::vector<std::pair<double, std::int64_t>> found;
  const auto take = [&](const char* sql, const std::string* place) {
    SqlStatement& query = database_->statement(sql);
    query.bind(bounded(filter.from)).bind(bounded(filter.to)).bind(row_limit(filter));
    if (place != nullptr) query.bind(std::string_view(*place));
    while (query.step()) found.emplace_back(query.real(1), query.whole(0));
  };
  if (filter.places.empty()) take(filter.newest_first ? kNewestFirst : kOldestFirst, nullptr);
  for (const std::string& place : filter.places) {
    take(filter.newest_first ? kPlaceNewestFirst : kPlaceOldestFirst, &place);
  }
  if (filter.places.size() > 1) {
    std::sort(found.begin(), found.end());
    found.erase(std::unique(found.begin(), found.end()), found.end());
    if (filter.newest_first) std::reverse(found.begin(), found.end());
    if (filter.limit > 0) found.resize(std::min<std::size_t>(found.size(), filter.limit));
  }
  std::vector<std::int64_t> result;
  result.reserve(found.size());
  for (const auto& [time, row] : found) result.push_back(row);
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
      "SELECT i.name, g.probability, s.name, c.name, CASE WHEN c.place = '' THEN s.place ELSE c.place END, g.time, "
      "c.position_frame, c.x, c.y, c.z "
      "FROM identities i JOIN sightings g ON g.identity = i.id JOIN clusters c ON c.id = g.cluster "
      "JOIN scenes s ON s.id = c.scene "
      "WHERE i.name = ? AND g.time BETWEEN ? AND ? ORDER BY g.time DESC, c.id LIMIT ?");
  sightings.bind(name).bind(bounded(filter.from)).bind(bounded(filter.to)).bind(row_limit(filter));
  while (sightings.step()) {
    result.push_back(read_found(sightings, sightings.text(0), sightings.maybe_real(1), 2));
  }
  if (!result.empty()) return result;
  SqlStatement& labels = database_->statement(
      "SELECT l.label, l.confidence, s.name, c.name, CASE WHEN c.place = '' THEN s.place ELSE c.place END, l.time, "
      "c.position_frame, c.x, c.y, c.z "
      "FROM labels l JOIN clusters c ON c.id = l.cluster JOIN scenes s ON s.id = c.scene "
      "WHERE l.label = ? AND l.time BETWEEN ? AND ? ORDER BY l.time DESC, l.cluster LIMIT ?");
  labels.bind(name).bind(bounded(filter.from)).bind(bounded(filter.to)).bind(row_limit(filter));
  while (labels.step()) result.push_back(read_found(labels, labels.text(0), labels.maybe_real(1), 2));
  return result;
}

std::vector<Found> SceneStore::at_place(std::string_view place, const SceneFilter& filter) {
  std::vector<Found> result;
  if (place.empty()) return result;
  SqlStatement& query = database_->statement(
      "SELECT c.id, s.name, c.name, c.place, c.scene_time, c.position_frame, c.x, c.y, c.z "
      "FROM clusters c JOIN scenes s ON s.id = c.scene WHERE c.place = ?1 AND c.scene_time BETWEEN ?2 AND ?3 UNION ALL "
      "SELECT c.id, s.name, c.name, s.place, c.scene_time, c.position_frame, c.x, c.y, c.z "
      "FROM scenes s JOIN clusters c ON c.scene = s.id "
      "WHERE s.place = ?1 AND s.time BETWEEN ?2 AND ?3 AND c.place = '' ORDER BY 5, 1 LIMIT ?4");
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

std::vector<std::string> SceneStore::names_of(std::string_view scene, std::string_view cluster) {
  std::vector<std::string> result;
  const auto take = [&](const char* sql) {
    SqlStatement& query = database_->statement(sql);
    query.bind(scene).bind(cluster);
    while (query.step()) result.push_back(query.text(0));
  };
  take(
      "SELECT l.label FROM labels l JOIN clusters c ON c.id = l.cluster JOIN scenes s ON s.id = c.scene "
      "WHERE s.name = ? AND c.name = ? ORDER BY l.confidence DESC, l.label");
  take(
      "SELECT i.name FROM sightings g JOIN clusters c ON c.id = g.cluster JOIN scenes s ON s.id = c.scene "
      "JOIN identities i ON i.id = g.identity WHERE s.name = ? AND c.name = ? ORDER BY g.probability DESC, i.name");
  return result;
}

std::optional<double> SceneStore::last_look(std::string_view place) {
  if (place.empty()) return std::nullopt;  // not said, which is no place
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

std::string SceneStore::type_rows(std::string_view type) {
  std::string rows;
  SqlStatement query(*database_, "SELECT id, name FROM types ORDER BY id");
  while (query.step()) {
    if (full_type_name(query.text(1)) != full_type_name(type)) continue;
    rows += fmt::format("{}{}", rows.empty() ? "" : ",", query.whole(0));
  }
  return rows;
}

std::vector<TypeCount> SceneStore::type_counts() {
  std::map<std::string, TypeCount, std::less<>> counts;  // by full name
  SqlStatement query(*database_,
                     "SELECT t.name, count(*) - count(a.cluster), count(a.cluster) FROM annotations a "
                     "JOIN types t ON t.id = a.type GROUP BY a.type");
  while (query.step()) {
    const std::string name(full_type_name(query.text(0)));
    TypeCount& count = counts.try_emplace(name, TypeCount{name, 0, 0}).first->second;
    count.of_scenes += static_cast<std::uint64_t>(query.whole(1));
    count.of_clusters += static_cast<std::uint64_t>(query.whole(2));
  }
  std::vector<TypeCount> result;
  result.reserve(counts.size());
  for (auto& [name, count] : counts) result.push_back(std::move(count));
  return result;
}

std::vector<std::pair<std::string, std::uint64_t>> SceneStore::field_counts(std::string_view type,
                                                                            std::string_view field) {
  std::vector<std::pair<std::string, std::uint64_t>> result;
  const std::string sql = fmt::format(
      "SELECT json_extract(a.fields, '$.' || ?) AS value, count(*) FROM annotations a WHERE a.type IN ({}) "
      "AND value IS NOT NULL GROUP BY value ORDER BY count(*) DESC, value",
      type_rows(type));
  SqlStatement query(*database_, sql.c_str());
  query.bind(field);
  while (query.step()) result.emplace_back(query.text(0), static_cast<std::uint64_t>(query.whole(1)));
  return result;
}

TimeReport SceneStore::times() {
  TimeReport report;
  std::vector<std::pair<std::string, RunningMoments>> annotators;
  RunningMoments total;
  const std::string sql = fmt::format(
      "SELECT a.scene, json_extract(a.fields, '$.annotator'), json_extract(a.fields, '$.milliseconds') AS ms "
      "FROM annotations a WHERE a.type IN ({}) AND ms IS NOT NULL ORDER BY a.scene, a.id",
      type_rows("rs.annotation.LoggingInformation"));
  SqlStatement query(*database_, sql.c_str());
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
