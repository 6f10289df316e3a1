#include "perception_bridge/scene_lines.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <set>
#include <unordered_set>
#include <utility>

namespace sherlog {
namespace {

constexpr std::string_view kRecord = "sherlog.record";
constexpr std::size_t kMostWarnings = 20;

Value record(const char* kind) { return Value(Value::Object{{std::string(kRecord), Value(kind)}}); }

Value identity_record(const Identity& identity) {
  Value line = record("identity");
  Value::Object& object = *line.object();
  object.emplace_back("id", Value(identity.id));
  object.emplace_back("lastSeen", Value(identity.last_seen));
  object.emplace_back("wasSeen", Value(identity.was_seen));
  object.emplace_back("inView", Value(identity.in_view));
  object.emplace_back("disappeared", Value(identity.disappeared));
  object.insert(object.end(), identity.other.begin(), identity.other.end());
  Value::List sightings;
  for (const Sighting& sighting : identity.sightings) {
    Value::Object entry = {{"scene", Value(sighting.scene)}, {"cluster", Value(sighting.cluster)}};
    if (sighting.probability) entry.emplace_back("probability", Value(*sighting.probability));
    entry.emplace_back("explanation", Value(sighting.explanation));
    sightings.emplace_back(std::move(entry));
  }
  object.emplace_back("sightings", Value(std::move(sightings)));
  return line;
}

// One import: what was counted, and the transaction that it runs in.
class Importer {
 public:
  Importer(SceneStore& store, const ImportOptions& options) : store_(store), options_(options) {}

  // False where the import ends here.
  bool take(const std::string& line, std::uint64_t number) {
    ++result.lines;
    std::string problem;
    const auto document = parse_json(line, problem);
    if (!document) {
      errors_.push_back(problem);
    } else if (is_designator(*document)) {
      take_designator(*document, number);
    } else {
      flush();
      if (document->find(kRecord) != nullptr) {
        take_record(*document);
      } else {
        take_scene(*document, number);
      }
    }
    return settle({number});
  }
  // The scene of the last designators.
  bool finish() {
    flush();
    return settle({});
  }
  const std::string& store_failure() const { return store_failure_; }

  ImportResult result;

 private:
  // The errors of these lines, all of one thing.
  bool settle(const std::vector<std::uint64_t>& lines) {
    if (!store_failure_.empty() || ended_) return false;
    if (errors_.empty()) return true;
    for (const std::string& error : errors_) {
      if (result.problems.size() < ImportResult::kMostProblems) result.problems.push_back({lines.front(), error});
    }
    errors_.clear();
    result.skipped.insert(result.skipped.end(), lines.begin(), lines.end());
    ended_ = options_.on_error == OnError::kStop;
    return !ended_;
  }

  void take_scene(const Value& document, std::uint64_t number) {
    SceneMessages messages;
    const auto scene = scene_from_json(document, messages, options_.limits);
    for (const std::string& warning : messages.warnings) warn(number, warning);
    if (scene) {
      add(*scene);
    } else {
      errors_ = std::move(messages.errors);
    }
  }

  void add(const Scene& scene) {
    if (!store_failure_.empty() || ended_) return;
    const Conclusions before = options_.replace ? store_.conclusions_of(scene.id) : Conclusions{};
    switch (store_.add(scene, options_.replace)) {
      case SceneStore::Added::kNew:
        ++result.added;
        result.clusters += scene.clusters.size();
        break;
      case SceneStore::Added::kReplaced:
        ++result.replaced;
        result.clusters += scene.clusters.size();
        result.dropped.evidence += before.evidence;
        result.dropped.beliefs += before.beliefs;
        result.dropped.sightings += before.sightings;
        break;
      case SceneStore::Added::kUnchanged:
        ++result.unchanged;
        break;
      case SceneStore::Added::kDuplicate:
        errors_.push_back(fmt::format("the store has a scene '{}' already", scene.id));
        break;
      case SceneStore::Added::kFailed:
        store_failure_ = store_.problem();
        break;
    }
  }

  void take_designator(const Value& document, std::uint64_t number) {
    SceneMessages messages;
    auto cluster = designator_from_json(document, messages, options_.limits);
    for (const std::string& warning : messages.warnings) warn(number, warning);
    errors_ = std::move(messages.errors);
    if (!cluster) return;
    if (!cluster->timestamp) {
      errors_.push_back(
          fmt::format("the object designator '{}' has no 'timestamp', which says of which scene it is; a "
                      "scene has a list 'identifiables'",
                      cluster->id));
      return;
    }
    if (!gathered_lines_.empty() && gathered_.timestamp != *cluster->timestamp) flush();
    if (ended_) return;
    if (gathered_lines_.empty()) {
      gathered_ = Scene{};
      gathered_.id = fmt::format("scene-{}", *cluster->timestamp);
      gathered_.timestamp = *cluster->timestamp;
    }
    if (!gathered_ids_.insert(cluster->id).second) {
      errors_.push_back(
          fmt::format("two object designators of the time {} have the id '{}'", gathered_.timestamp, cluster->id));
      return;
    }
    warn(number, "object designators: those of one timestamp are the clusters of one scene");
    gathered_.clusters.push_back(std::move(*cluster));
    gathered_lines_.push_back(number);
  }

  // The designators that were gathered become a scene. Errors are theirs, and not those of the line that is read now.
  void flush() {
    if (gathered_lines_.empty() || ended_) return;
    const auto lines = std::exchange(gathered_lines_, {});
    gathered_ids_.clear();
    const auto others = std::exchange(errors_, validate(gathered_, options_.limits));
    if (errors_.empty()) add(gathered_);
    if (errors_.empty()) result.designators += lines.size();
    settle(lines);
    errors_ = others;
  }

  void warn(std::uint64_t number, const std::string& warning) {
    const bool known = std::any_of(result.warnings.begin(), result.warnings.end(), [&](const LineProblem& other) {
      return other.text.substr(other.text.find(": ") + 1) == warning.substr(warning.find(": ") + 1);
    });
    if (!known && result.warnings.size() < kMostWarnings) result.warnings.push_back({number, warning});
  }

  std::string text_of(const Value& record, const char* key) {
    const Value* value = record.find(key);
    if (value != nullptr && value->text() != nullptr) return *value->text();
    errors_.push_back(fmt::format("the record has no '{}' that is a text", key));
    return {};
  }
  std::string scene_of(const Value& record) {
    std::string scene = text_of(record, "scene");
    if (errors_.empty() && !store_.has(scene)) errors_.push_back(fmt::format("the store has no scene '{}'", scene));
    return scene;
  }
  void check_added(bool good, const char* what) {
    if (good) {
      ++result.records;
    } else if (!store_.problem().empty()) {
      store_failure_ = store_.problem();
    } else {
      errors_.push_back(fmt::format("the {} names a scene or a cluster that the store has not", what));
    }
  }
  // What the store has instead: false where the record is not to be added.
  template <class Stored>
  bool may_add(const std::optional<Stored>& stored, const Stored& record, std::string_view what) {
    if (stored && *stored == record) {
      ++result.unchanged;
      return false;
    }
    if (stored && !options_.replace) errors_.push_back(fmt::format("the store has {} already, and another one", what));
    return errors_.empty();
  }

  void take_record(const Value& record) {
    if (ended_) return;
    const Value* kind = record.find(kRecord);
    const std::string name = kind->text() == nullptr ? "" : *kind->text();
    if (name == "evidence") {
      const StoredEvidence evidence{scene_of(record), text_of(record, "mapping"), text_of(record, "text")};
      if (!errors_.empty()) return;
      const auto stored = store_.evidence(evidence.scene, evidence.mapping);
      const auto what = fmt::format("evidence of '{}' by '{}'", evidence.scene, evidence.mapping);
      if (may_add(stored, evidence.text, what)) check_added(store_.add(evidence), "evidence");
    } else if (name == "belief") {
      const Value* document = record.find("document");
      if (document == nullptr) errors_.emplace_back("the record has no 'document'");
      const StoredBelief belief{scene_of(record), text_of(record, "kind"), document == nullptr ? Value() : *document};
      if (!errors_.empty()) return;
      const auto stored = store_.belief(belief.scene, belief.kind);
      const auto what = fmt::format("a belief about '{}' of the kind '{}'", belief.scene, belief.kind);
      if (may_add(stored, belief.document, what)) check_added(store_.add(belief), "belief");
    } else if (name == "identity") {
      take_identity(record);
    } else {
      errors_.push_back(fmt::format("'{}' is none of evidence, belief, identity", name));
    }
  }

  void take_identity(const Value& record) {
    Identity identity = identity_of(record);
    if (!errors_.empty() || !may_take(identity)) return;
    const auto before = store_.identity(identity.id);
    if (!store_.set_mark()) {
      store_failure_ = store_.problem();
      return;
    }
    check_added(store_.add(identity), "identity");
    if (!errors_.empty() || !store_failure_.empty()) return store_.return_to_mark();
    store_.keep_mark();
    if (before) result.dropped.sightings += lost_sightings(*before, identity);
  }

  // Whether it is to be added; what is there instead is an error or, with `replace`, makes place.
  bool may_take(const Identity& identity) {
    const auto id = store_.identity_id(identity.id);
    if (!id) return true;
    if (*id != identity.id) {
      errors_.push_back(fmt::format(
          "the store has an identity '{}', and '{}' differs from it in upper and lower case only", *id, identity.id));
      return false;
    }
    const auto stored = store_.identity(*id);
    if (!stored) return true;
    const auto what = fmt::format("an identity '{}'", *id);
    return may_add(std::optional(identity_record(*stored)), identity_record(in_order_of(*stored, identity)), what);
  }

  // The sightings as the store orders them, for a comparison.
  static Identity in_order_of(const Identity& stored, Identity identity) {
    const auto place = [&](const Sighting& sighting) {
      return std::find_if(stored.sightings.begin(), stored.sightings.end(), [&](const Sighting& other) {
        return other.scene == sighting.scene && other.cluster == sighting.cluster;
      });
    };
    std::stable_sort(identity.sightings.begin(), identity.sightings.end(),
                     [&](const Sighting& a, const Sighting& b) { return place(a) < place(b); });
    return identity;
  }

  static std::uint64_t lost_sightings(const Identity& before, const Identity& now) {
    std::set<std::pair<std::string_view, std::string_view>> kept;
    for (const Sighting& sighting : now.sightings) kept.emplace(sighting.scene, sighting.cluster);
    return static_cast<std::uint64_t>(
        std::count_if(before.sightings.begin(), before.sightings.end(), [&](const Sighting& sighting) {
          return !kept.contains({sighting.scene, sighting.cluster});
        }));
  }

  Identity identity_of(const Value& record) {
    Identity identity;
    identity.id = text_of(record, "id");
    if (errors_.empty() && identity.id.empty()) errors_.emplace_back("the identity's 'id' is empty");
    for (const auto& [key, value] : *record.object()) {
      if (key == kRecord || key == "id") continue;
      if (key == "lastSeen") {
        take_time(value, identity.last_seen);
      } else if (key == "wasSeen") {
        take_flag(key, value, identity.was_seen);
      } else if (key == "inView") {
        take_flag(key, value, identity.in_view);
      } else if (key == "disappeared") {
        take_flag(key, value, identity.disappeared);
      } else if (key != "sightings") {
        identity.other.emplace_back(key, value);
      } else if (value.list() == nullptr) {
        errors_.push_back(fmt::format("'sightings' is {}, not a list of objects", value.kind()));
      } else {
        for (const Value& item : *value.list()) identity.sightings.push_back(sighting_of(item));
      }
    }
    return identity;
  }

  void take_flag(const std::string& key, const Value& value, bool& target) {
    if (value.flag() != nullptr) {
      target = *value.flag();
    } else {
      errors_.push_back(fmt::format("'{}' is {}, not true or false", key, value.kind()));
    }
  }

  void take_time(const Value& value, double& target) {
    target = value.number().value_or(std::nan(""));
    if (!(target >= 0 && target <= kLatestTime)) {
      errors_.push_back(fmt::format("'lastSeen' is {}, not a number of seconds of at least 0",
                                    value.number() ? json_text(value) : std::string(value.kind())));
    }
  }

  Sighting sighting_of(const Value& item) {
    Sighting sighting;
    if (item.object() == nullptr) {
      errors_.push_back(fmt::format("a sighting is {}, not an object", item.kind()));
      return sighting;
    }
    sighting.scene = text_of(item, "scene");
    sighting.cluster = text_of(item, "cluster");
    if (const Value* value = item.find("probability")) sighting.probability = value->number().value_or(-1);
    if (item.find("explanation") != nullptr) sighting.explanation = text_of(item, "explanation");
    constexpr std::array<std::string_view, 5> kExplanations = {"", "stay", "move", "newview", "appear"};
    if (std::ranges::find(kExplanations, sighting.explanation) == kExplanations.end()) {
      errors_.push_back(fmt::format("a sighting's 'explanation' is '{}', and none of stay, move, newview, appear",
                                    sighting.explanation));
    }
    if (sighting.probability && !(*sighting.probability >= 0 && *sighting.probability <= 1)) {
      errors_.emplace_back("a sighting's 'probability' is not in [0, 1]");
    }
    return sighting;
  }

  SceneStore& store_;
  const ImportOptions& options_;
  std::vector<std::string> errors_;  // of this line
  std::string store_failure_;
  bool ended_ = false;  // by an error, where the first one ends the import
  Scene gathered_;      // of designators
  std::vector<std::uint64_t> gathered_lines_;
  std::set<std::string> gathered_ids_;
};

}  // namespace

ImportResult import_lines(SceneStore& store, std::istream& in, const ImportOptions& options, Monitor& monitor) {
  Importer importer(store, options);
  ImportResult& result = importer.result;
  const StopCondition stop(monitor, options.max_seconds);
  const bool own = !options.in_transaction || options.on_error == OnError::kSkip;
  // What of the counts is committed: a failing store takes the rest back.
  ImportResult committed;
  const auto end_with = [&](Termination termination, const std::string& failure) {
    if (own) store.roll_back();
    result.added = committed.added;
    result.replaced = committed.replaced;
    result.unchanged = committed.unchanged;
    result.designators = committed.designators;
    result.records = committed.records;
    result.clusters = committed.clusters;
    result.dropped = committed.dropped;
    result.termination = termination;
    result.failure = failure;
    return std::move(result);
  };
  if (own && !store.begin()) return end_with(Termination::kRefused, store.problem());
  std::string line;
  std::uint64_t number = 0, since_commit = 0;
  Termination stopped = Termination::kCompleted;
  while (stopped == Termination::kCompleted && std::getline(in, line)) {
    ++number;
    if (!line.empty() && line.back() == '\r') line.pop_back();
    if (line.find_first_not_of(" \t") == std::string::npos) continue;
    stopped = stop.reason();
    if (stopped != Termination::kCompleted) break;
    if (number % 64 == 0) monitor.progress("lines", static_cast<double>(number), 0);
    if (!importer.take(line, number)) return end_with(Termination::kRefused, importer.store_failure());
    if (options.on_error == OnError::kSkip && ++since_commit >= options.batch) {
      since_commit = 0;
      if (!store.commit() || !store.begin()) return end_with(Termination::kRefused, store.problem());
      committed = result;
    }
  }
  // Reading from a pipe ends like a file where it was interrupted.
  if (stopped == Termination::kCompleted && stop.interrupted()) stopped = Termination::kInterrupted;
  if (in.bad()) return end_with(Termination::kRefused, "the file cannot be read to its end");
  if (stopped != Termination::kCompleted && options.on_error == OnError::kStop) return end_with(stopped, "");
  // Half a scene of designators is none.
  if (stopped == Termination::kCompleted && !importer.finish()) {
    return end_with(Termination::kRefused, importer.store_failure());
  }
  if (own && !store.commit()) return end_with(Termination::kRefused, store.problem());
  result.termination = stopped;
  return std::move(result);
}

bool export_lines(SceneStore& store, const ExportOptions& options, const std::function<bool(std::string_view)>& write) {
  const auto put = [&](const Value& document) { return write(json_text(document) + "\n"); };
  bool written = true;
  std::unordered_set<std::string> scenes;
  const bool read = store.for_each_scene(options.filter, [&](const Scene& scene) {
    written = put(scene_to_json(scene));
    scenes.insert(scene.id);
    if (!options.conclusions) return written;
    for (const StoredEvidence& evidence : store.evidence_of(scene.id)) {
      Value line = record("evidence");
      line.object()->emplace_back("scene", Value(evidence.scene));
      line.object()->emplace_back("mapping", Value(evidence.mapping));
      line.object()->emplace_back("text", Value(evidence.text));
      written = written && put(line);
    }
    for (const StoredBelief& belief : store.beliefs_of(scene.id)) {
      Value line = record("belief");
      line.object()->emplace_back("scene", Value(belief.scene));
      line.object()->emplace_back("kind", Value(belief.kind));
      line.object()->emplace_back("document", belief.document);
      written = written && put(line);
    }
    return written;
  });
  if (!read || !written || !options.conclusions) return read && written;
  const bool all = scenes.size() == store.scene_count();
  for (const std::string& id : store.identities()) {
    auto identity = store.identity(id);
    if (!identity) continue;
    std::erase_if(identity->sightings, [&](const Sighting& sighting) { return !scenes.contains(sighting.scene); });
    if (identity->sightings.empty() && !all) continue;
    if (!put(identity_record(*identity))) return false;
  }
  return store.problem().empty();
}

}  // namespace sherlog
