// Frames in, scenes out: the pipeline as a whole, for a program's main loop.
//
// Idea      What is wanted decides once which annotators run and in which order; then every frame goes through them
//           and becomes a scene as the scene store, the evidence mappings and the tracker know it. What is said of it
//           with which consumer is the caller's: SceneStore::add(scene), evidence_text(observe(mapping, scene)),
//           answer_to(request, scene).
// Source    deliverable 3, Figs. 1 and 3
// Errors    make(): what cannot be planned. perceive(): annotators that failed, by name; the scene has what the others
//           found. Images of another size than the calibration: a failed "Frame", and nobody runs
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "rgbd/pipeline/object_annotators.h"
#include "rgbd/pipeline/people_annotators.h"
#include "rgbd/pipeline/request.h"
#include "rgbd/pipeline/run.h"

namespace sherlog::rgbd {

struct PerceptionOptions {
  // What is asked for; nothing: only the depth images are preprocessed, and no object is looked for.
  std::optional<Request> request = {};
  bool everything = false;             // all that can be found, whatever is asked for
  std::vector<std::string> also = {};  // further views and types
  std::vector<std::string> flow = {};  // these annotators in this order; empty: planned from what is wanted
  std::uint32_t threads = 0;           // 0: as many as the machine has
  bool log_times = false;              // rs.annotation.LoggingInformation in the scenes
  std::string prefix = "scene-";       // of the scenes' names: and the frame's number
};

struct Perceived {
  sherlog::Scene scene;
  Analysis analysis;
  std::vector<AnnotatorRun> runs;
  std::size_t reaching = 0;  // arms and the like over the table, and things in hands
};

class Perception {
 public:
  static std::optional<Perception> make(Annotators annotators, PerceptionOptions options, std::string& problem);

  // Times have to grow from frame to frame for annotators that remember.
  // `bodies`: what the robot knows to be there.
  Perceived perceive(const Frame& frame, const Calibration& calibration, std::size_t number,
                     const KnownBodies& bodies = {});
  // In their order.
  std::vector<std::string> annotators() const;
  const Flow& flow() const { return flow_; }
  const Annotator& annotator(std::size_t step) const { return *annotators_[flow_.order[step]]; }
  const RunTimes& times() const { return times_; }

 private:
  Perception(Annotators annotators, Flow flow, PerceptionOptions options)
      : annotators_(std::move(annotators)), flow_(std::move(flow)), options_(std::move(options)) {}

  Annotators annotators_;
  Flow flow_;
  PerceptionOptions options_;
  RunTimes times_;
};

}  // namespace sherlog::rgbd
