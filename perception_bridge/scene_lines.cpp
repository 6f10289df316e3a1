#include "perception_bridge/scene_lines.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace sherlog {
namespace {

constexpr std::string_view kRecord = "sherlog.record";
constexpr std::size_t kMostWarnings = 20;

// One import: what was counted, and the transaction that it runs in.
class Importer {
 public:
  Importer(SceneStore& store, const ImportOptions& options) : store_(store), options_(options) {}

  // False where the import ends here.
  bool take(const std::string& line, std::uint64_t number) {
    ++result.lines;
    errors_.clear();
    std::string problem;
    const auto document = parse_json(line, problem);
    if (!document) {
      errors_.push_back(problem);
    } else if (document->find(kRecord) != nullptr) {
      take_record(*document);
    } else {
      take_scene(*document, number);
    }
    if (!store_failure_.empty()) return false;
    if (errors_.empty()) return true;
    ++result.skipped;
    for (const std::string& error : errors_) {
      if (result.problems.size() < ImportResult::kMostProblems) result.problems.push_back({number, error});
    }
    return options_.on_error == OnError::kSkip;
  }
  const std::string& store_failure() const { return store_failure_; }

  ImportResult result;

 private:
  void take_scene(const Value& document, std::uint64_t number) {
    SceneMessages messages;
    const auto scene = scene_from_json(document, messages, options_.limits);
    for (const std::string& warning : messages.warnings) warn(number, warning);
    if (!scene) {
      errors_ = std::move(messages.errors);
      return;
    }
    switch (store_.add(*scene, options_.replace)) {
      case SceneStore::Added::kNew:
        ++result.added;
        result.clusters += scene->clusters.size();
        break;
      case SceneStore::Added::kReplaced:
        ++result.replaced;
        result.clusters += scene->clusters.size();
        break;
      case SceneStore::Added::kDuplicate:
        errors_.push_back(fmt::format("the store has a scene '{}' already", scene->id));
        break;
      case SceneStore::Added::kFailed:
        store_failure_ = store_.problem();
        break;
    }
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

  void take_record(const Value& record) {
    const Value* kind = record.find(kRecord);
    const std::string name = kind->text() == nullptr ? "" : *kind->text();
    if (name == "evidence") {
      const StoredEvidence evidence{scene_of(record), text_of(record, "mapping"), text_of(record, "text")};
      if (errors_.empty()) check_added(store_.add(evidence), "evidence");
    } else if (name == "belief") {
      const Value* document = record.find("document");
      const StoredBelief belief{scene_of(record), text_of(record, "kind"), document == nullptr ? Value() : *document};
      if (errors_.empty()) check_added(store_.add(belief), "belief");
    } else if (name == "identity") {
      take_identity(record);
    } else {
      errors_.push_back(fmt::format("'{}' is none of evidence, belief, identity", name));
    }
  }

  void take_identity(const Value& record) {
    Identity identity;
    identity.id = text_of(record, "id");
    for (const auto& [key, value] : *record.object()) {
      if (key == kRecord || key == "id") continue;
      const bool* flag = value.flag();
      if (key == "lastSeen" && value.number()) {
        identity.last_seen = *value.number();
      } else if (key == "wasSeen" && flag != nullptr) {
        identity.was_seen = *flag;
      } else if (key == "inView" && flag != nullptr) {
        identity.in_view = *flag;
      } else if (key == "disappeared" && flag != nullptr) {
        identity.disappeared = *flag;
      } else if (key == "sightings" && value.list() != nullptr) {
        for (const Value& item : *value.list()) identity.sightings.push_back(sighting_of(item));
      } else {
        identity.other.emplace_back(key, value);
      }
    }
    if (!errors_.empty()) return;
    if (!store_.set_mark()) {
      store_failure_ = store_.problem();
      return;
    }
    check_added(store_.add(identity), "identity");
    if (errors_.empty() && store_failure_.empty()) {
      store_.keep_mark();
    } else {
      store_.return_to_mark();
    }
  }

  Sighting sighting_of(const Value& item) {
    Sighting sighting;
    sighting.scene = text_of(item, "scene");
    sighting.cluster = text_of(item, "cluster");
    if (const Value* value = item.find("probability")) sighting.probability = value->number().value_or(-1);
    if (const Value* value = item.find("explanation"); value != nullptr && value->text() != nullptr) {
      sighting.explanation = *value->text();
    }
    if (!(sighting.probability >= 0 && sighting.probability <= 1)) {
      errors_.emplace_back("a sighting's 'probability' is not in [0, 1]");
    }
    return sighting;
  }

  SceneStore& store_;
  const ImportOptions& options_;
  std::vector<std::string> errors_;  // of this line
  std::string store_failure_;
};

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
    sightings.emplace_back(Value::Object{{"scene", Value(sighting.scene)},
                                         {"cluster", Value(sighting.cluster)},
                                         {"probability", Value(sighting.probability)},
                                         {"explanation", Value(sighting.explanation)}});
  }
  object.emplace_back("sightings", Value(std::move(sightings)));
  return line;
}

}  // namespace

ImportResult import_lines(SceneStore& store, std::istream& in, const ImportOptions& options, Monitor& monitor) {
  Importer importer(store, options);
  ImportResult& result = importer.result;
  const bool own = !options.in_transaction || options.on_error == OnError::kSkip;
  const auto end_with = [&](Termination termination, const std::string& failure) {
    if (own) store.roll_back();
    result.termination = termination;
    result.failure = failure;
    return std::move(result);
  };
  if (own && !store.begin()) return end_with(Termination::kRefused, store.problem());
  std::string line;
  std::uint64_t number = 0, since_commit = 0;
  // What of the counts is committed: a failing store takes the rest back.
  ImportResult committed;
  const auto take_back = [&] {
    result.added = committed.added;
    result.replaced = committed.replaced;
    result.records = committed.records;
    result.clusters = committed.clusters;
  };
  while (std::getline(in, line)) {
    ++number;
    if (!line.empty() && line.back() == '\r') line.pop_back();
    if (line.find_first_not_of(" \t") == std::string::npos) continue;
    if (number % 64 == 0) {
      monitor.progress("lines", static_cast<double>(number), 0);
      if (monitor.interrupted()) {
        take_back();
        return end_with(Termination::kInterrupted, "");
      }
    }
    if (!importer.take(line, number)) {
      take_back();
      return end_with(Termination::kRefused, importer.store_failure());
    }
    if (options.on_error == OnError::kSkip && ++since_commit >= options.batch) {
      since_commit = 0;
      if (!store.commit() || !store.begin()) {
        take_back();
        return end_with(Termination::kRefused, store.problem());
      }
      committed = result;
    }
  }
  if (in.bad() || (own && !store.commit())) {
    take_back();
    return end_with(Termination::kRefused, in.bad() ? "the file cannot be read to its end" : store.problem());
  }
  return std::move(result);
}

bool export_lines(SceneStore& store, const ExportOptions& options, const std::function<bool(std::string_view)>& write) {
  const auto put = [&](const Value& document) { return write(json_text(document) + "\n"); };
  bool written = true;
  const bool read = store.for_each_scene(options.filter, [&](const Scene& scene) {
    written = put(scene_to_json(scene));
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
  for (const std::string& id : store.identities()) {
    const auto identity = store.identity(id);
    if (identity && !put(identity_record(*identity))) return false;
  }
  return store.problem().empty();
}

}  // namespace sherlog
