// Trackers: each follows clusters from scene to scene by one kind of measurement, under numbers of its own.
//
// Idea      Position, colour and shape fail differently: a thing that is pushed keeps its colours, one that is turned keeps its
//           place. So each is followed for itself. A tracker says of each cluster of a scene how well each of its tracks fits;
//           what the votes mean together is the arbiter's business (tracking_arbiter.h), which then tells the tracker
//           which track each cluster continues.
// Source    Beetz et al., RoboSherlock, ICRA 2015, section 5: trackers with local ids under an arbiter
// Extending a further measurement is a FeatureTracker with rules of its own, or a class derived from Tracker
// Cost      one comparison for each track and cluster
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "perception_bridge/scene.h"
#include "perception_bridge/similarity.h"

namespace sherlog {

class Tracker {
 public:
  // Of this tracker alone: number 3 of two trackers need not be one thing.
  using TrackId = std::uint64_t;

  struct Ballot {
    bool votes = false;  // false: the cluster has nothing that this tracker could compare
    // How well each of its tracks fits, in [0, 1]; a track that cannot be compared is left out.
    std::vector<std::pair<TrackId, double>> fits;
    std::optional<TrackId> choice;  // the track that it would continue by itself; nothing: a new one
  };

  virtual ~Tracker() = default;
  virtual std::string name() const = 0;  // under one arbiter each name is there once
  // A fit at which "the same" and "another one" are equally good, in (0, 1): what fits better is approved of, what fits worse is
  // denied.
  virtual double gate() const = 0;
  // A ballot for each cluster, in their order. Tracks stay as they are.
  virtual std::vector<Ballot> vote(const Scene& scene) const = 0;
  // The cluster is the next look of that track, or the first of a new one: the track's number.
  virtual TrackId follow(const Cluster& cluster, std::optional<TrackId> track) = 0;
  virtual void drop(TrackId track) = 0;
};

// Follows what similarity rules can compare.
class FeatureTracker : public Tracker {
 public:
  FeatureTracker(std::string name, SimilarityConfig similarity, double gate = 0.3);

  std::string name() const override { return name_; }
  double gate() const override { return gate_; }
  std::vector<Ballot> vote(const Scene& scene) const override;
  TrackId follow(const Cluster& cluster, std::optional<TrackId> track) override;
  void drop(TrackId track) override;

 private:
  struct Track {
    TrackId id;
    Cluster look;  // the last one that could be compared
  };
  bool comparable(const Cluster& cluster) const;

  std::string name_;
  SimilarityConfig similarity_;
  double gate_;
  std::vector<Track> tracks_;
  TrackId last_ = 0;
};

// From frame to frame things hardly change, so these sigmas are smaller than those of default_similarity().
std::unique_ptr<Tracker> position_tracker(double sigma = 0.1);  // metres
std::unique_ptr<Tracker> color_tracker(double histogram_sigma = 0.2, double mean_sigma = 0.1);
std::unique_ptr<Tracker> shape_tracker(double sigma = 0.2);  // a descriptor such as VFH
// These three.
std::vector<std::unique_ptr<Tracker>> default_trackers();

}  // namespace sherlog
