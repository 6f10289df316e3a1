// What the parts of sherlog perceive share: its options, and what is made of them.
#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "cli/session.h"
#include "perception_bridge/scene_store.h"
#include "rgbd/pipeline/perception.h"
#include "rgbd/pose/segmentation.h"

namespace sherlog::cli {

struct PerceiveArguments {
  std::string frames, query, keys, store, prefix, map, known, evidence, record;
  std::string mapping = "robosherlock";
  std::vector<std::string> flow, annotators;
  std::optional<std::uint64_t> every;
  std::uint64_t most_people = rgbd::SegmentationOptions().most_means;
  std::uint64_t first = 0, last = std::numeric_limits<std::uint64_t>::max();
  bool times = false, replace = false, moving = false, labels = false, people = false, plan = false;

  // Labels of people hold from frame to frame.
  std::uint64_t step() const { return every.value_or(people ? 1 : 10); }
  bool wants_things() const { return !query.empty() || !store.empty() || !evidence.empty(); }
};

// Each says what is wrong, and is then false or empty.

// The files that are read, but for FRAMES, the store and the mapping.
bool add_inputs(Session& session, const PerceiveArguments& arguments, std::vector<std::string>& inputs);
bool read_knowledge(Session& session, const PerceiveArguments& arguments, rgbd::Knowledge& knowledge);
bool read_request(Session& session, const PerceiveArguments& arguments, std::optional<rgbd::Request>& request);
std::optional<rgbd::Perception> make_perception(Session& session, const PerceiveArguments& arguments,
                                                const rgbd::Knowledge& knowledge, const std::string& name,
                                                const std::optional<rgbd::Request>& request);

// The store that scenes go to: opened at once where it is there already, else with the first frame, so that frames that
// cannot be read make no store.
class StoreTarget {
 public:
  // Empty path: no store is wanted.
  StoreTarget(Session& session, std::string path) : session_(session), path_(std::move(path)) {}
  bool is_wanted() const { return !path_.empty(); }
  bool is_open() const { return store_.has_value(); }
  // With a transaction begun. False: said why.
  bool open();
  bool open_if_there();
  SceneStore& store() { return *store_; }  // of an open one

 private:
  Session& session_;
  std::string path_;
  std::optional<SceneStore> store_;
};

// --plan: who would run, in which order, and for what. No frame is looked at.
int plan_perception(Session& session, const PerceiveArguments& arguments);

}  // namespace sherlog::cli
