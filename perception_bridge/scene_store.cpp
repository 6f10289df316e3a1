#include "perception_bridge/scene_store.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <map>

#include "perception_bridge/annotation_types.h"

namespace sherlog {
namespace {

// Where annotators put the name of a thing: what "where is X?" looks for. To make another one count: its line here.
struct LabelField {
  std::string_view type, pointer;
};
constexpr std::array<LabelField, 7> kLabelFields = {{
    {"rs.annotation.Detection", "/name"},
    {"rs.annotation.Classification", "/classname"},
    {"rs.annotation.Product", "/name"},
    {"rs.annotation.Goggles", "/title"},
    {"rs.annotation.GroundTruth", "/object"},
    {"rs.annotation.GroundTruth", "/classificationGT/classname"},
    {"rs.annotation.Barcode", "/barcode"},
}};

// How the document spelled its list of clusters.
std::int64_t layout_of(const Scene& scene) {
  return (scene.calls_them_clusters ? 1 : 0) + (scene.has_clusters_key ? 2 : 0);
}

std::optional<std::string> other_text(const Value::Object& other) {
  return other.empty() ? std::nullopt : std::optional(json_text(Value(other)));
}

Value::Object parse_object(const std::string& text) {
  std::string problem;
  auto value = parse_json(text, problem);
  Value::Object* object = value ? value->object() : nullptr;
  return object == nullptr ? Value::Object() : std::move(*object);
}

Annotation read_annotation_row(const SqlStatement& row, int first) {
  Annotation annotation;
  annotation.type = row.text(first);
  annotation.id = row.maybe_text(first + 1);
  annotation.source = row.maybe_text(first + 2);
  annotation.frame = row.maybe_text(first + 3);
  annotation.timestamp = row.maybe_real(first + 4);
  annotation.confidence = row.maybe_real(first + 5);
  annotation.fields = parse_object(row.text(first + 6));
  return annotation;
}

}  // namespace

bool SceneStore::begin() {
  database_->clear_problem();  // of a call before
  rolled_back_problem_.clear();
  return database_->execute("BEGIN IMMEDIATE");
}

bool SceneStore::commit() { return database_->execute("COMMIT"); }

// The problem that led here stays: it is what the caller has to tell.
void SceneStore::roll_back() {
  SqlDatabase& database = *database_;
  const std::string problem = database.problem();
  database.clear_problem();
  if (database.in_transaction()) database.execute("ROLLBACK");
  database.clear_problem();
  types_.clear();
  rolled_back_problem_ = problem;
}

bool SceneStore::set_mark() { return database_->execute("SAVEPOINT mark"); }
bool SceneStore::keep_mark() { return database_->execute("RELEASE mark"); }

void SceneStore::return_to_mark() {
  database_->clear_problem();
  database_->execute("ROLLBACK TO mark; RELEASE mark");
  types_.clear();
}

bool SceneStore::in_transaction(const std::function<void()>& body) {
  const bool mine = !database_->in_transaction();
  if (mine && !begin()) return false;
  body();
  if (mine && (!database_->ok() || !commit())) {
    roll_back();
    return false;
  }
  return database_->ok();
}

std::int64_t SceneStore::type_row(std::string_view name) {
  const auto known = types_.find(std::string(name));
  if (known != types_.end()) return known->second;
  SqlStatement& query = database_->statement("SELECT id FROM types WHERE name = ?");
  std::int64_t row = 0;
  if (query.bind(name).step()) {
    row = query.whole(0);
    query.reset();
  } else {
    database_->statement("INSERT INTO types(name) VALUES (?)").bind(name).run();
    row = database_->last_row();
  }
  types_.emplace(std::string(name), row);
  return row;
}

std::optional<std::int64_t> SceneStore::scene_row(std::string_view id) {
  SqlStatement& query = database_->statement("SELECT id FROM scenes WHERE name = ?");
  if (!query.bind(id).step()) return std::nullopt;
  const std::int64_t row = query.whole(0);
  query.reset();
  return row;
}

std::optional<std::int64_t> SceneStore::cluster_row(std::int64_t scene, std::string_view id) {
  SqlStatement& query = database_->statement("SELECT id FROM clusters WHERE scene = ? AND name = ?");
  if (!query.bind(scene).bind(id).step()) return std::nullopt;
  const std::int64_t row = query.whole(0);
  query.reset();
  return row;
}

// --- writing ---

SceneStore::Added SceneStore::add(const Scene& scene, bool replace) {
  Added added = Added::kNew;
  const bool good = in_transaction([&] {
    if (const auto row = scene_row(scene.id)) {
      added = !replace                                            ? Added::kDuplicate
              : scene_to_json(read(*row)) == scene_to_json(scene) ? Added::kUnchanged
                                                                  : Added::kReplaced;
    }
    if (added == Added::kDuplicate || added == Added::kUnchanged) return;
    if (added == Added::kReplaced) remove(scene.id);
    insert(scene);
  });
  return good ? added : Added::kFailed;
}

bool SceneStore::remove(std::string_view scene) {
  return in_transaction([&] { database_->statement("DELETE FROM scenes WHERE name = ?").bind(scene).run(); });
}

void SceneStore::insert(const Scene& scene) {
  std::string place = place_of(scene.annotations);
  database_
      ->statement("INSERT INTO scenes(name, time, source, frame, place, layout, other) VALUES (?, ?, ?, ?, ?, ?, ?)")
      .bind(std::string_view(scene.id))
      .bind(scene.timestamp)
      .bind(scene.source)
      .bind(scene.frame)
      .bind(std::string_view(place))
      .bind(layout_of(scene))
      .bind(other_text(scene.other))
      .run();
  const std::int64_t row = database_->last_row();
  for (const Annotation& annotation : scene.annotations) insert_annotation(row, std::nullopt, annotation);
  for (const Cluster& cluster : scene.clusters) {
    if (!database_->ok()) return;
    insert_cluster(scene, row, cluster);
  }
}

void SceneStore::insert_cluster(const Scene& scene, std::int64_t row, const Cluster& cluster) {
  const auto position = position_of(cluster);
  const std::string place = place_of(cluster.annotations);
  SqlStatement& insert = database_->statement(
      "INSERT INTO clusters(scene, name, scene_time, time, source, frame, confidence, other, place, position_frame, x, "
      "y, z) "
      "VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)");
  insert.bind(row).bind(std::string_view(cluster.id)).bind(scene.timestamp).bind(cluster.timestamp);
  insert.bind(cluster.source).bind(cluster.has_frame_of_scene ? std::nullopt : cluster.frame);
  insert.bind(cluster.confidence).bind(other_text(cluster.other)).bind(std::string_view(place));
  if (position) {
    insert.bind(position->frame.empty() ? std::string_view(scene.frame.value_or("")) : position->frame);
    for (const double coordinate : position->coordinates) insert.bind(coordinate);
  }
  insert.run();
  const std::int64_t cluster_id = database_->last_row();
  for (const ObjectHypothesis& hypothesis : cluster.hypotheses) insert_annotation(row, cluster_id, hypothesis);
  for (const Annotation& annotation : cluster.annotations) insert_annotation(row, cluster_id, annotation);
  insert_labels(cluster_id, scene.timestamp, cluster);
}

void SceneStore::insert_annotation(std::int64_t scene, std::optional<std::int64_t> cluster,
                                   const Annotation& annotation) {
  const std::int64_t type = type_row(annotation.type);
  SqlStatement& insert = database_->statement(
      "INSERT INTO annotations(scene, cluster, type, name, source, frame, time, confidence, fields) "
      "VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)");
  insert.bind(scene);
  if (cluster) {
    insert.bind(*cluster);
  } else {
    insert.bind_null();
  }
  insert.bind(type).bind(annotation.id).bind(annotation.source).bind(annotation.frame).bind(annotation.timestamp);
  insert.bind(annotation.confidence).bind(std::string_view(json_text(Value(annotation.fields)))).run();
}

void SceneStore::insert_labels(std::int64_t cluster, double time, const Cluster& source) {
  std::map<std::string, std::optional<double>> labels;
  for (const Annotation& annotation : source.annotations) {
    const std::string_view type = full_type_name(annotation.type);
    for (const LabelField& field : kLabelFields) {
      if (field.type != type) continue;
      for (const Value* value : select(annotation.fields, field.pointer)) {
        if (value->text() == nullptr || value->text()->empty()) continue;
        auto& confidence = labels[*value->text()];
        // A person's word is worth more than any annotator's.
        const auto given = type == "rs.annotation.GroundTruth" ? std::optional(1.0) : annotation.confidence;
        confidence = std::max(confidence, given);
      }
    }
  }
  for (const auto& [label, confidence] : labels) {
    database_->statement("INSERT OR IGNORE INTO labels(label, time, cluster, confidence) VALUES (?, ?, ?, ?)")
        .bind(std::string_view(label))
        .bind(time)
        .bind(cluster)
        .bind(confidence)
        .run();
  }
}

bool SceneStore::add(const StoredEvidence& evidence) {
  const auto scene = scene_row(evidence.scene);
  return scene && in_transaction([&] {
           database_
               ->statement(
                   "INSERT INTO evidence(scene, mapping, text) VALUES (?, ?, ?) "
                   "ON CONFLICT(scene, mapping) DO UPDATE SET text = excluded.text")
               .bind(*scene)
               .bind(std::string_view(evidence.mapping))
               .bind(std::string_view(evidence.text))
               .run();
         });
}

bool SceneStore::add(const StoredBelief& belief) {
  const auto scene = scene_row(belief.scene);
  return scene && in_transaction([&] {
           database_
               ->statement(
                   "INSERT INTO beliefs(scene, kind, document) VALUES (?, ?, ?) "
                   "ON CONFLICT(scene, kind) DO UPDATE SET document = excluded.document")
               .bind(*scene)
               .bind(std::string_view(belief.kind))
               .bind(std::string_view(json_text(belief.document)))
               .run();
         });
}

bool SceneStore::add(const Identity& identity) {
  bool complete = true;
  const bool good = in_transaction([&] {
    const auto stored = identity_id(identity.id);
    if (stored && *stored != identity.id) {
      database_->refuse(
          fmt::format("the store has an identity '{}', and '{}' differs from it in upper and lower case only", *stored,
                      identity.id));
    }
    // One that is stored again keeps its place among the others.
    database_
        ->statement(
            "INSERT INTO identities(name, last_seen, was_seen, in_view, disappeared, other) VALUES (?, ?, ?, ?, ?, ?) "
            "ON CONFLICT(name) DO UPDATE SET last_seen = excluded.last_seen, was_seen = excluded.was_seen, "
            "in_view = excluded.in_view, disappeared = excluded.disappeared, other = excluded.other")
        .bind(std::string_view(identity.id))
        .bind(identity.last_seen)
        .bind(std::int64_t{identity.was_seen})
        .bind(std::int64_t{identity.in_view})
        .bind(std::int64_t{identity.disappeared})
        .bind(other_text(identity.other))
        .run();
    SqlStatement& query = database_->statement("SELECT id FROM identities WHERE name = ?");
    const std::int64_t row = query.bind(std::string_view(identity.id)).step() ? query.whole(0) : 0;
    query.reset();
    database_->statement("DELETE FROM sightings WHERE identity = ?").bind(row).run();
    for (const Sighting& sighting : identity.sightings) {
      const auto scene = scene_row(sighting.scene);
      const auto cluster = scene ? cluster_row(*scene, sighting.cluster) : std::nullopt;
      complete = complete && cluster;
      if (!cluster) continue;
      database_
          ->statement(
              "INSERT OR REPLACE INTO sightings(identity, time, cluster, probability, explanation) "
              "SELECT ?, scene_time, id, ?, ? FROM clusters WHERE id = ?")
          .bind(row)
          .bind(sighting.probability)
          .bind(std::string_view(sighting.explanation))
          .bind(*cluster)
          .run();
    }
  });
  return good && complete;
}

bool SceneStore::remove_beliefs(std::string_view kind) {
  return in_transaction([&] { database_->statement("DELETE FROM beliefs WHERE kind = ?").bind(kind).run(); });
}

bool SceneStore::remove_identity(std::string_view id) {
  // Just this one; the first comparison is that of the index.
  constexpr const char* kRemove = "DELETE FROM identities WHERE name = ?1 AND name = ?1 COLLATE BINARY";
  return in_transaction([&] { database_->statement(kRemove).bind(id).run(); });
}

// --- reading ---

bool SceneStore::has(std::string_view scene) { return scene_row(scene).has_value(); }

std::optional<Scene> SceneStore::scene(std::string_view id) {
  const auto row = scene_row(id);
  if (!row) return std::nullopt;
  Scene result = read(*row);
  return database_->ok() ? std::optional(std::move(result)) : std::nullopt;
}

Scene SceneStore::read(std::int64_t row) {
  Scene scene;
  SqlStatement& head = database_->statement("SELECT name, time, source, frame, layout, other FROM scenes WHERE id = ?");
  if (head.bind(row).step()) {
    scene.id = head.text(0);
    scene.timestamp = head.real(1);
    scene.source = head.maybe_text(2);
    scene.frame = head.maybe_text(3);
    scene.calls_them_clusters = (head.whole(4) & 1) != 0;
    scene.has_clusters_key = (head.whole(4) & 2) != 0;
    if (!head.is_null(5)) scene.other = parse_object(head.text(5));
    head.reset();
  }
  std::unordered_map<std::int64_t, std::size_t> index;  // row of a cluster -> its place in the scene
  SqlStatement& clusters = database_->statement(
      "SELECT id, name, time, source, frame, confidence, other FROM clusters WHERE scene = ? ORDER BY id");
  clusters.bind(row);
  while (clusters.step()) {
    index.emplace(clusters.whole(0), scene.clusters.size());
    Cluster& cluster = scene.clusters.emplace_back();
    cluster.id = clusters.text(1);
    cluster.timestamp = clusters.maybe_real(2);
    cluster.source = clusters.maybe_text(3);
    cluster.frame = clusters.maybe_text(4);
    cluster.confidence = clusters.maybe_real(5);
    if (!clusters.is_null(6)) cluster.other = parse_object(clusters.text(6));
  }
  SqlStatement& annotations = database_->statement(
      "SELECT a.cluster, t.name, a.name, a.source, a.frame, a.time, a.confidence, a.fields "
      "FROM annotations a JOIN types t ON t.id = a.type WHERE a.scene = ? ORDER BY a.id");
  annotations.bind(row);
  while (annotations.step()) {
    Annotation annotation = read_annotation_row(annotations, 1);
    if (annotations.is_null(0)) {
      scene.annotations.push_back(std::move(annotation));
      continue;
    }
    const auto owner = index.find(annotations.whole(0));
    if (owner == index.end()) continue;
    Cluster& cluster = scene.clusters[owner->second];
    (is_hypothesis_type(annotation.type) ? cluster.hypotheses : cluster.annotations).push_back(std::move(annotation));
  }
  take_frame_of_scene(scene);
  return scene;
}

std::optional<std::string> SceneStore::evidence(std::string_view scene, std::string_view mapping) {
  SqlStatement& query = database_->statement(
      "SELECT e.text FROM evidence e JOIN scenes s ON s.id = e.scene WHERE s.name = ? AND e.mapping = ?");
  if (!query.bind(scene).bind(mapping).step()) return std::nullopt;
  std::string text = query.text(0);
  query.reset();
  return text;
}

std::optional<Value> SceneStore::belief(std::string_view scene, std::string_view kind) {
  for (StoredBelief& belief : beliefs_of(scene)) {
    if (belief.kind == kind) return std::move(belief.document);
  }
  return std::nullopt;
}

std::vector<StoredEvidence> SceneStore::evidence_of(std::string_view scene) {
  std::vector<StoredEvidence> result;
  SqlStatement& query = database_->statement(
      "SELECT e.mapping, e.text FROM evidence e JOIN scenes s ON s.id = e.scene WHERE s.name = ? ORDER BY e.mapping");
  query.bind(scene);
  while (query.step()) result.push_back({std::string(scene), query.text(0), query.text(1)});
  return result;
}

std::optional<StoredBelief> SceneStore::newest_belief(std::string_view kind) {
  SqlStatement& query = database_->statement(
      "SELECT s.name, b.kind, b.document FROM beliefs b JOIN scenes s ON s.id = b.scene WHERE b.kind = ? "
      "ORDER BY s.time DESC, s.id DESC LIMIT 1");
  if (!query.bind(kind).step()) return std::nullopt;
  std::string problem;
  StoredBelief belief{query.text(0), query.text(1), parse_json(query.text(2), problem).value_or(Value())};
  query.reset();
  return belief;
}

std::vector<StoredBelief> SceneStore::beliefs_of(std::string_view scene) {
  std::vector<StoredBelief> result;
  SqlStatement& query = database_->statement(
      "SELECT b.kind, b.document FROM beliefs b JOIN scenes s ON s.id = b.scene WHERE s.name = ? ORDER BY b.kind");
  query.bind(scene);
  while (query.step()) {
    std::string problem;
    result.push_back({std::string(scene), query.text(0), parse_json(query.text(1), problem).value_or(Value())});
  }
  return result;
}

std::optional<std::string> SceneStore::identity_id(std::string_view id) {
  SqlStatement& query = database_->statement("SELECT name FROM identities WHERE name = ?");
  if (!query.bind(id).step()) return std::nullopt;
  std::string name = query.text(0);
  query.reset();
  return name;
}

Conclusions SceneStore::conclusions_of(std::string_view scene) {
  SqlStatement& query = database_->statement(
      "SELECT (SELECT count(*) FROM evidence e WHERE e.scene = s.id), (SELECT count(*) FROM beliefs b WHERE b.scene = "
      "s.id), (SELECT count(*) FROM sightings g JOIN clusters c ON c.id = g.cluster WHERE c.scene = s.id) "
      "FROM scenes s WHERE s.name = ?");
  Conclusions result;
  if (!query.bind(scene).step()) return result;
  result = {static_cast<std::uint64_t>(query.whole(0)), static_cast<std::uint64_t>(query.whole(1)),
            static_cast<std::uint64_t>(query.whole(2))};
  query.reset();
  return result;
}

std::vector<std::string> SceneStore::identities() {
  std::vector<std::string> result;
  SqlStatement& query = database_->statement("SELECT name FROM identities ORDER BY id");
  while (query.step()) result.push_back(query.text(0));
  return result;
}

std::optional<Identity> SceneStore::identity(std::string_view id) {
  SqlStatement& head = database_->statement(
      "SELECT id, name, last_seen, was_seen, in_view, disappeared, other FROM identities WHERE name = ?");
  if (!head.bind(id).step()) return std::nullopt;
  Identity identity;
  const std::int64_t row = head.whole(0);
  identity.id = head.text(1);
  identity.last_seen = head.real(2);
  identity.was_seen = head.whole(3) != 0;
  identity.in_view = head.whole(4) != 0;
  identity.disappeared = head.whole(5) != 0;
  if (!head.is_null(6)) identity.other = parse_object(head.text(6));
  head.reset();
  SqlStatement& sightings = database_->statement(
      "SELECT s.name, c.name, g.time, g.probability, g.explanation FROM sightings g JOIN clusters c ON c.id = "
      "g.cluster "
      "JOIN scenes s ON s.id = c.scene WHERE g.identity = ? ORDER BY g.time, c.id");
  sightings.bind(row);
  while (sightings.step()) {
    identity.sightings.push_back(
        {sightings.text(0), sightings.text(1), sightings.real(2), sightings.maybe_real(3), sightings.text(4)});
  }
  return identity;
}

}  // namespace sherlog
