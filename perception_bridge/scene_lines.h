// Scenes as JSON lines: how they come into a store and leave it.
//
// Idea      One document a line, so that a file of any size is read in constant memory and a mistake has a line number. A line
//           is a scene (docs/scene.schema.json), or a record of what was concluded, marked by the key "sherlog.record":
//             {"sherlog.record": "evidence", "scene": "s1", "mapping": "fusion", "text": "shape(c0,Box)\n"}
//             {"sherlog.record": "belief", "scene": "s1", "kind": "fusion", "document": {...}}
//             {"sherlog.record": "identity", "id": "cup-1", "lastSeen": 12.5, "sightings": [{"scene": "s1", ...}], ...}
//           Or it is an object designator by itself, as RoboSherlock answers with: those that follow each other with one time
//           stamp are the clusters of one scene, "scene-12.5".
// Errors    kStop: the first bad line ends the import and nothing of it stays. kSkip: bad lines are named and left out. A store
//           that cannot be written ends both.
// Limits    asked at each line. kStop: nothing of the import stays. kSkip: what was read so far does.
// Cost      about 20 microseconds an annotation
#pragma once

#include <cstdint>
#include <functional>
#include <istream>
#include <limits>
#include <string>
#include <string_view>
#include <vector>

#include "mln/monitor.h"
#include "perception_bridge/scene_store.h"

namespace sherlog {

enum class OnError : std::uint8_t { kStop, kSkip };

struct ImportOptions {
  OnError on_error = OnError::kStop;
  bool replace = false;  // what the store has under that id, scene or record; else that is an error
  SceneLimits limits;
  std::uint32_t batch = 200;  // kSkip: scenes of one transaction
  // kStop: the caller has begun a transaction, e.g. over several files, and ends it, whatever comes of this.
  bool in_transaction = false;
  double max_seconds = std::numeric_limits<double>::infinity();
};

struct LineProblem {
  std::uint64_t line = 0;  // from 1
  std::string text;
};

struct ImportResult {
  Termination termination = Termination::kCompleted;  // kRefused: a bad line, or the store could not be written
  std::uint64_t lines = 0;                            // that were not empty
  std::uint64_t added = 0, replaced = 0, records = 0, clusters = 0;
  std::uint64_t unchanged = 0;         // scenes and records that the store has just so
  std::uint64_t designators = 0;       // of the clusters
  Conclusions dropped;                 // of scenes and identities that were replaced
  std::vector<std::uint64_t> skipped;  // the bad lines
  std::vector<LineProblem> problems;   // of the first kMostProblems
  std::vector<LineProblem> warnings;   // the first of each kind
  std::string failure;                 // of the store; "" where it was not that
  static constexpr std::size_t kMostProblems = 20;
};

ImportResult import_lines(SceneStore& store, std::istream& in, const ImportOptions& options, Monitor& monitor);

struct ExportOptions {
  SceneFilter filter;
  // Evidence and beliefs of these scenes as well, and the identities that were seen in them, with those sightings (without a
  // filter: all identities).
  bool conclusions = true;
};

// Each line with its end; false where the store could not be read or `write` returned false. What was written is good: whole
// lines, and nothing in them that is not in the file or the store that it goes to.
bool export_lines(SceneStore& store, const ExportOptions& options, const std::function<bool(std::string_view)>& write);

}  // namespace sherlog
