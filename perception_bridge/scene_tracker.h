// Who is who over time: scenes in, one belief about objects out. For a robot's main loop.
//
// Idea      Two moments are enough: what is believed so far (each object as it was seen last) and the new scene. The evidence
//           mapping compares them, a model says what follows, and the marginals update the belief: a cluster that is
//           most probably an old object is a sighting of it, one that is none is a new object. What was not seen is hidden
//           where its place is out of view, else it has disappeared; both stay candidates for later scenes, so that a thing that
//           comes back keeps its name. With an arbiter (use_arbiter) the model is asked only where the trackers contradict
//           each other or are not sure; the belief is updated in the same way.
//           A sighting is open while something else is nearly as probable. Then the look alone stands for the object, without what
//           older sightings say, and the question stays (open_question.h): when a later scene settles it, the sightings from
//           there on go to the object that they are of, and the step names the revision.
// Source    Beetz et al., RoboSherlock, ICRA 2015, section 5; the fields of an object and the rule for merging are those of the
//           published system: new annotations replace old ones of the same type and source, others stay.
// Model     any that declares is(old, new, explanation), appear, disappear, hidden, and what the mapping writes
// Errors    a scene older than the last one, one with too many pairs, or one that the model has no answer for: the step says so,
//           the belief stays
// Cost      one grounding and one inference a scene, quadratic in the clusters
#pragma once

#include <limits>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "perception_bridge/association_question.h"
#include "perception_bridge/open_question.h"
#include "perception_bridge/scene_store.h"
#include "perception_bridge/tracking_arbiter.h"

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
    std::string object;       // the one that it is taken for
    std::string explanation;  // stay, move, newview, appear
    std::optional<double> probability =
        {};                         // of being that object; of having appeared; nothing of the most probable world
    std::vector<Candidate> others;  // that it could be as well, with at least 1 %
    // With an arbiter: the trackers that had a say, and which of its own tracks each would have continued (none: a new one).
    std::vector<std::pair<std::string, std::optional<Tracker::TrackId>>> votes = {};
  };
  // What an earlier scene's cluster was taken for, and is believed to be since this scene.
  struct Revision {
    std::string scene, cluster;
    std::string was, is;
    std::optional<double> probability = {};
  };
  std::string scene;
  Termination termination = Termination::kCompleted;
  std::string message;             // where not completed
  std::string method;              // of the engine; "arbiter" where the model was not asked
  std::optional<Verdict> verdict;  // of the arbiter, where there is one
  std::string reason;              // why it did not decide
  std::vector<ClusterBelief> clusters;
  std::vector<std::string> disappeared, hidden;  // objects
  std::vector<Revision> revisions;
  std::string evidence;                                // the database that was asked, if any
  std::shared_ptr<const Contradiction> contradiction;  // where no world is possible; while the tracker lives
  double seconds = 0;
};

struct TrackerOptions {
  std::string prefix = "object-";  // of new names: object-1, object-2, ...
  // Objects that were not seen for longer are no candidates any more.
  double forget_seconds = std::numeric_limits<double>::infinity();
  // A sighting is open while another explanation has at least this share of its probability, in (0, 1].
  double rival = 0.5;
  // The least probability at which an earlier sighting is taken for another object.
  double settled = 0.8;
  std::size_t most_questions = 16;  // kept open; the oldest go first
  // Of objects and clusters; a scene with more is refused, and nothing is compared.
  std::uint64_t most_pairs = 250'000;
};

class SceneTracker {
 public:
  // Nothing, and a sentence, where the model lacks what it must declare.
  static std::optional<SceneTracker> make(Model model, EvidenceMapping mapping, InferenceOptions inference,
                                          TrackerOptions options, std::string& problem);

  // From now on trackers vote, and the model is asked only where they do not agree.
  void use_arbiter(TrackingArbiter arbiter);

  TrackingStep feed(const Scene& scene, Monitor& monitor);
  // Names that new objects do not get, in upper or lower case.
  void avoid(const std::vector<std::string>& names);
  // Takes an object up again, e.g. from a store.
  void resume(Identity identity, Cluster cluster, double time);
  // What identities and sightings do not say: how objects look, open questions, which names were used. After resuming all objects
  // this makes a tracker go on as if it had never stopped, in whatever order they came. False, and a sentence, where it is no such document.
  Value state() const;
  bool restore(const Value& state, std::string& problem);

  const std::vector<TrackedObject>& objects() const { return objects_; }
  std::optional<double> last_time() const { return last_time_; }
  const std::vector<OpenQuestion>& open_questions() const { return questions_; }
  // Names of objects that turned out to be others.
  const std::vector<std::string>& removed() const { return removed_; }
  // How often the arbiter decided; nothing without one.
  std::optional<ArbiterCounts> arbiter_counts() const;

 private:
  // The objects that a scene could show.
  struct Candidates {
    std::vector<std::size_t> objects;  // positions
    std::vector<std::string> names;
    std::vector<Cluster> looks;
    std::vector<bool> out_of_view;
  };
  // What is what, whoever said so.
  struct Finding {
    Resolution resolution;
    std::vector<std::optional<double>> probability;                 // by cluster
    std::vector<bool> open;                                         // by cluster
    std::vector<std::vector<TrackingStep::Candidate>> others = {};  // by cluster
  };

  SceneTracker(AssociationQuestion question, TrackerOptions options);
  std::string new_name();
  Candidates candidates_of(const Scene& scene) const;
  std::optional<Finding> arbitrate(const Scene& scene, const Candidates& candidates, TrackingStep& step) const;
  std::optional<Finding> ask_model(const Scene& scene, const Candidates& candidates, TrackingStep& step,
                                   Monitor& monitor) const;
  bool is_open(double probability, double rival) const { return rival >= options_.rival * probability; }
  TrackedObject* find_object(const std::string& name);
  void take_known(const Scene& scene, const Cluster& cluster, TrackedObject& object, const std::string& explanation,
                  std::optional<double> probability, bool open);
  TrackedObject& take_new(const Scene& scene, const Cluster& cluster, std::optional<double> probability);
  void mark_unseen(const Candidates& candidates, const Finding& finding, const std::vector<bool>& seen,
                   TrackingStep& step);

  // Second thoughts about earlier scenes, in scene_tracker_revision.cpp.
  struct Answered;
  struct Change;
  struct Tail;
  void reconsider(const Scene& scene, TrackingStep& step, Monitor& monitor);
  bool gains(OpenQuestion& question, std::size_t position, const Scene& scene);
  std::vector<Change> changes_by(const OpenQuestion& question, const Answered& answered) const;
  bool possible(const OpenQuestion& question, const std::vector<Change>& changes);
  void revise(std::size_t position, std::vector<Change> changes, const Scene& scene, TrackingStep& step);
  void hand_over(const OpenQuestion& question, Change& change, Tail tail, const Scene& scene, TrackingStep& step);
  void rename_since(std::size_t position, const std::vector<Change>& changes, TrackingStep& step);
  void relearn(const std::string& name);
  Tail cut_tail(const OpenQuestion& question, const std::string& name, const Scene& scene, TrackingStep& step);
  void settle(OpenQuestion& question, const Answered& answered);

  AssociationQuestion question_;
  TrackerOptions options_;
  std::optional<TrackingArbiter> arbiter_;
  std::vector<TrackedObject> objects_;
  std::vector<OpenQuestion> questions_;  // the oldest first
  std::vector<std::string> removed_;
  std::optional<double> last_time_;
  std::uint64_t names_ = 0;
  std::set<std::string> taken_;  // in lower case
};

// The later look; annotations of the earlier one stay where the later one has none of that type and source. Where the thing is
// is said by one of them only: by the later one, or by the earlier one, in its frame, where the later one has no position.
Cluster merged_look(const Cluster& earlier, Cluster later);

// As a document for the store's beliefs.
Value step_to_json(const TrackingStep& step);

}  // namespace sherlog
