// Who is who over time: scenes in, one belief about objects out. For a robot's main loop.
//
// Idea      Two moments are enough: what is believed so far (each object as it was seen last) and the new scene. The evidence
//           mapping compares them, a model says what follows, and the marginals update the belief: a cluster that is
//           most probably an old object is a sighting of it, one that is none is a new object. What was not seen is hidden
//           where its place is out of view, else it has disappeared; both stay candidates for later scenes, so that a thing that
//           comes back keeps its name.
// Source    Beetz et al., RoboSherlock, ICRA 2015, section 5; the fields of an object and the rule for merging are those of the
//           published system: new annotations replace old ones of the same type and source, others stay.
// Model     any that declares is(old, new, explanation), appear, disappear, hidden, and what the mapping writes
// Errors    a scene older than the last one, or one that the model has no answer for: the step says so, the belief stays
// Cost      one grounding and one inference a scene, quadratic in the clusters
#pragma once

#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "inference/standing_question.h"
#include "perception_bridge/evidence_mapping.h"
#include "perception_bridge/scene_store.h"

namespace sherlog {

struct TrackedObject {
  Identity identity;
  Cluster cluster;  // as it was seen last, with what older sightings say besides
};

// What one scene did to the belief.
struct TrackingStep {
  struct Candidate {
    std::string object;
    double probability = 0;  // that the cluster is it
  };
  struct ClusterBelief {
    std::string cluster;
    std::string object;             // the one that it is taken for
    std::string explanation;        // stay, move, newview, appear
    double probability = 0;         // of being that object; of having appeared
    std::vector<Candidate> others;  // that it could be as well, with at least 1 %
  };
  std::string scene;
  Termination termination = Termination::kCompleted;
  std::string message;  // where not completed
  std::string method;
  std::vector<ClusterBelief> clusters;
  std::vector<std::string> disappeared, hidden;  // objects
  std::string evidence;                          // the database that was asked
  double seconds = 0;
};

struct TrackerOptions {
  std::string prefix = "object-";  // of new names: object-1, object-2, ...
  // Objects that were not seen for longer are no candidates any more.
  double forget_seconds = std::numeric_limits<double>::infinity();
};

class SceneTracker {
 public:
  // Nothing, and a sentence, where the model lacks what it must declare.
  static std::optional<SceneTracker> make(Model model, EvidenceMapping mapping, InferenceOptions inference,
                                          TrackerOptions options, std::string& problem);

  TrackingStep feed(const Scene& scene, Monitor& monitor);
  // Takes an object up again, e.g. from a store.
  void resume(Identity identity, Cluster cluster, double time);

  const std::vector<TrackedObject>& objects() const { return objects_; }
  std::optional<double> last_time() const { return last_time_; }

 private:
  SceneTracker(StandingQuestion question, EvidenceMapping mapping, TrackerOptions options);
  std::string new_name();
  void take_new(const Scene& scene, const Cluster& cluster, double probability, TrackingStep& step);

  std::unique_ptr<StandingQuestion> question_;
  EvidenceMapping mapping_;
  TrackerOptions options_;
  std::vector<TrackedObject> objects_;
  std::optional<double> last_time_;
  std::uint64_t names_ = 0;
};

// As a document for the store's beliefs.
Value step_to_json(const TrackingStep& step);

}  // namespace sherlog
