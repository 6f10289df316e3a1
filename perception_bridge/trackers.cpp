#include "perception_bridge/trackers.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "inference/assignment.h"

namespace sherlog {

FeatureTracker::FeatureTracker(std::string name, SimilarityConfig similarity, double gate)
    : name_(std::move(name)), similarity_(std::move(similarity)), gate_(gate) {}

bool FeatureTracker::comparable(const Cluster& cluster) const {
  return similarity_between(similarity_, cluster, cluster).value.has_value();
}

std::vector<Tracker::Ballot> FeatureTracker::vote(const Scene& scene) const {
  std::vector<Ballot> ballots;
  std::vector<double> gains;  // by cluster and track
  for (const Cluster& cluster : scene.clusters) {
    Ballot ballot;
    ballot.votes = comparable(cluster);
    for (const Track& track : tracks_) {
      double gain = -std::numeric_limits<double>::infinity();
      if (const auto fit = similarity_between(similarity_, track.look, cluster).value) {
        ballot.fits.emplace_back(track.id, *fit);
        if (*fit >= gate_) gain = std::log(*fit / gate_);
      }
      gains.push_back(gain);
    }
    ballots.push_back(std::move(ballot));
  }
  const Assignment best = best_assignment(gains, scene.clusters.size(), tracks_.size());
  for (std::size_t n = 0; n < ballots.size(); ++n) {
    if (best.column_of[n]) ballots[n].choice = tracks_[*best.column_of[n]].id;
  }
  return ballots;
}

Tracker::TrackId FeatureTracker::follow(const Cluster& cluster, std::optional<TrackId> track) {
  auto known = tracks_.end();
  if (track) known = std::ranges::find(tracks_, *track, &Track::id);
  if (known == tracks_.end()) {
    tracks_.push_back({++last_, cluster});
    return last_;
  }
  // What cannot be compared would make the tracker forget what it is looking for.
  if (comparable(cluster)) known->look = cluster;
  return known->id;
}

void FeatureTracker::drop(TrackId track) {
  std::erase_if(tracks_, [&](const Track& known) { return known.id == track; });
}

std::unique_ptr<Tracker> position_tracker(double sigma) {
  return std::make_unique<FeatureTracker>(
      "position", SimilarityConfig{{{"rs.annotation.PoseAnnotation", DistanceKind::kPosition, "", "",
                                     SimilarityKernel::kGaussian, sigma}}});
}

std::unique_ptr<Tracker> color_tracker(double histogram_sigma, double mean_sigma) {
  return std::make_unique<FeatureTracker>(
      "color", SimilarityConfig{{{"rs.annotation.ColorHistogram", DistanceKind::kHistogram, "/hist", "",
                                  SimilarityKernel::kGaussian, histogram_sigma},
                                 {"sherlog.annotation.MeanColor", DistanceKind::kEuclidean, "/color", "",
                                  SimilarityKernel::kGaussian, mean_sigma}}});
}

std::unique_ptr<Tracker> shape_tracker(double sigma) {
  return std::make_unique<FeatureTracker>(
      "shape", SimilarityConfig{{{"rs.annotation.PclFeature", DistanceKind::kHistogram, "/feature", "",
                                  SimilarityKernel::kGaussian, sigma}}});
}

std::vector<std::unique_ptr<Tracker>> default_trackers() {
  std::vector<std::unique_ptr<Tracker>> trackers;
  trackers.push_back(position_tracker());
  trackers.push_back(color_tracker());
  trackers.push_back(shape_tracker());
  return trackers;
}

}  // namespace sherlog
