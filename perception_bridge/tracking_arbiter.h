// The arbiter over the trackers: where their votes allow one explanation of the scene, it needs no inference.
//
// Idea      It keeps a table from each tracker's local tracks to the objects that everybody knows. A cluster goes to an object
//           where a tracker approves of it and none denies it; a tracker that has no track of the object, or nothing to
//           compare, says nothing. The best such one-to-one assignment is the candidate. It is
//             contradicted  where a cluster and an object are left over of which some tracker says that they are one (a thing
//                           that was moved, or that looks different now), or where an object is seen at a place that is not
//                           in view
//             unsure        where too few trackers vote, or a rival or "a new thing" is too probable: the odds of a pair are
//                           the product of fit / gate over the trackers, and its probability the smaller one of those
//                           among the objects for that cluster and among the clusters for that object
//           and else it is what has happened: objects stay, appear, disappear or are hidden. To be moved or seen from another
//           side always contradicts some tracker; that is for the model to say.
// Source    Beetz et al., RoboSherlock, ICRA 2015, section 5: vote for an explanation consistent with all trackers, else ask the
//           Markov logic network
// Errors    none: what cannot be decided is said so
// Cost      one comparison for each track and cluster, and one assignment
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "perception_bridge/trackers.h"

namespace sherlog {

struct ArbiterOptions {
  double sure = 0.8;               // the least probability of each decision, in (0, 1]
  std::uint32_t votes_needed = 2;  // trackers that say something about a cluster
};
// The inequality that does not hold, or nothing.
std::string validate(const ArbiterOptions& options);

enum class Verdict : std::uint8_t { kAgreed, kContradicted, kUnsure };
std::string_view to_string(Verdict verdict);

struct ArbiterCounts {
  std::uint64_t scenes = 0, contradicted = 0, unsure = 0;
  std::uint64_t calls() const { return contradicted + unsure; }
  double share_of_calls() const { return scenes == 0 ? 0 : static_cast<double>(calls()) / static_cast<double>(scenes); }
};

struct Judgement {
  Verdict verdict = Verdict::kAgreed;
  std::string reason;                                   // a sentence where not agreed
  std::vector<std::optional<std::size_t>> association;  // by cluster: the object's position; nothing: a new one
  std::vector<double> probability;                      // by cluster
  // By cluster: the trackers that voted and the local track that each would continue (nothing: a new one).
  std::vector<std::vector<std::pair<std::string, std::optional<Tracker::TrackId>>>> votes;

  void object_to(Verdict why, std::string sentence);
};

class TrackingArbiter {
 public:
  explicit TrackingArbiter(std::vector<std::unique_ptr<Tracker>> trackers = default_trackers(),
                           ArbiterOptions options = {});

  // `objects`: names of those that could be in the scene; `out_of_view`: of their places.
  Judgement judge(const Scene& scene, std::span<const std::string> objects, const std::vector<bool>& out_of_view) const;
  // What the clusters were found to be, by whomever; counts the scene.
  void settle(const Scene& scene, std::span<const std::string> objects_of_clusters, Verdict verdict);
  // Takes an object up again.
  void resume(const std::string& object, const Cluster& cluster);
  // Nothing that the trackers know of it counts any more.
  void forget(const std::string& object);

  const ArbiterCounts& counts() const { return counts_; }

 private:
  struct Voter {
    std::unique_ptr<Tracker> tracker;
    std::map<std::string, Tracker::TrackId> track_of;  // by object
  };
  struct Pairs;
  Pairs collect(const Scene& scene, std::span<const std::string> objects, Judgement& judgement) const;

  std::vector<Voter> voters_;
  ArbiterOptions options_;
  ArbiterCounts counts_;
};

}  // namespace sherlog
