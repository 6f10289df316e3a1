#include "perception_bridge/tracking_arbiter.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "inference/assignment.h"

namespace sherlog {

// What the trackers say together of each pair of a cluster and an object.
struct TrackingArbiter::Pairs {
  std::size_t objects = 0;
  std::vector<double> odds;  // by cluster and object, against the cluster being new
  std::vector<std::uint8_t> approved, denied;
  std::vector<std::uint32_t> votes;  // by cluster

  Pairs(std::size_t clusters, std::size_t object_count)
      : objects(object_count),
        odds(clusters * object_count, 1.0),
        approved(clusters * object_count),
        denied(clusters * object_count),
        votes(clusters) {}
  std::size_t at(std::size_t n, std::size_t o) const { return n * objects + o; }
  std::size_t clusters() const { return votes.size(); }

  // The best one-to-one assignment among the pairs that no tracker denies.
  std::vector<std::optional<std::size_t>> best() const {
    std::vector<double> gains;
    for (std::size_t i = 0; i < odds.size(); ++i) {
      const bool possible = approved[i] != 0 && denied[i] == 0;
      gains.push_back(possible ? std::log(odds[i]) : -std::numeric_limits<double>::infinity());
    }
    const Assignment assignment = best_assignment(gains, clusters(), objects);
    return {assignment.column_of.begin(), assignment.column_of.end()};
  }
  // Where every cluster could be any object or new, and every object any cluster or gone.
  double probability(std::size_t n, std::size_t o) const {
    double by_cluster = 1, by_object = 1;
    for (std::size_t other = 0; other < objects; ++other) by_cluster += odds[at(n, other)];
    for (std::size_t other = 0; other < clusters(); ++other) by_object += odds[at(other, o)];
    return odds[at(n, o)] / std::max(by_cluster, by_object);
  }
};

std::string validate(const ArbiterOptions& options) {
  if (!(options.sure > 0 && options.sure <= 1))
    return fmt::format("sure is {}, but must be above 0 and at most 1", options.sure);
  if (options.votes_needed < 1) return "votes_needed is 0, but must be at least 1";
  return {};
}

std::string_view to_string(Verdict verdict) {
  return verdict == Verdict::kAgreed ? "agreed" : verdict == Verdict::kContradicted ? "contradicted" : "unsure";
}

void Judgement::object_to(Verdict why, std::string sentence) {
  // The first contradiction, else the first doubt, stands for all.
  if (verdict == Verdict::kContradicted || verdict == why) return;
  verdict = why;
  reason = std::move(sentence);
}

TrackingArbiter::TrackingArbiter(std::vector<std::unique_ptr<Tracker>> trackers, ArbiterOptions options)
    : options_(options) {
  for (auto& tracker : trackers) voters_.push_back({std::move(tracker), {}});
}

TrackingArbiter::Pairs TrackingArbiter::collect(const Scene& scene, std::span<const std::string> objects,
                                                Judgement& judgement) const {
  Pairs pairs(scene.clusters.size(), objects.size());
  for (const Voter& voter : voters_) {
    std::map<Tracker::TrackId, std::size_t> object_of;
    for (std::size_t o = 0; o < objects.size(); ++o) {
      const auto track = voter.track_of.find(objects[o]);
      if (track != voter.track_of.end()) object_of.emplace(track->second, o);
    }
    const std::vector<Tracker::Ballot> ballots = voter.tracker->vote(scene);
    const double gate = voter.tracker->gate();
    for (std::size_t n = 0; n < scene.clusters.size(); ++n) {
      if (!ballots[n].votes) continue;
      ++pairs.votes[n];
      judgement.votes[n].emplace_back(voter.tracker->name(), ballots[n].choice);
      for (const auto& [track, fit] : ballots[n].fits) {
        const auto object = object_of.find(track);
        if (object == object_of.end()) continue;  // one that is no candidate any more
        const std::size_t pair = pairs.at(n, object->second);
        pairs.odds[pair] *= fit / gate;
        (fit >= gate ? pairs.approved : pairs.denied)[pair] = 1;
      }
    }
  }
  // A pair of which nobody says anything is no rival to others.
  for (std::size_t i = 0; i < pairs.odds.size(); ++i) {
    if (pairs.approved[i] == 0 && pairs.denied[i] == 0) pairs.odds[i] = 0;
  }
  return pairs;
}

Judgement TrackingArbiter::judge(const Scene& scene, std::span<const std::string> objects,
                                 const std::vector<bool>& out_of_view) const {
  const std::size_t clusters = scene.clusters.size();
  Judgement judgement;
  judgement.votes.resize(clusters);
  const Pairs pairs = collect(scene, objects, judgement);
  judgement.association = pairs.best();
  std::vector<bool> taken(objects.size(), false);
  for (const auto& object : judgement.association) {
    if (object) taken[*object] = true;
  }
  const bool all_taken = std::ranges::find(taken, false) == taken.end();
  for (std::size_t n = 0; n < clusters; ++n) {
    const std::string& cluster = scene.clusters[n].id;
    const auto match = judgement.association[n];
    double rivals = 0;  // to being new
    if (match && out_of_view[*match]) {
      judgement.object_to(
          Verdict::kContradicted,
          fmt::format("cluster '{}' seems to be '{}', whose place is out of view", cluster, objects[*match]));
    }
    for (std::size_t o = 0; o < objects.size() && !match; ++o) {
      if (taken[o]) continue;
      rivals += pairs.odds[pairs.at(n, o)];
      if (pairs.approved[pairs.at(n, o)] == 0) continue;
      judgement.object_to(Verdict::kContradicted,
                          fmt::format("some trackers take cluster '{}' for '{}', others do not", cluster, objects[o]));
    }
    const double probability = match ? pairs.probability(n, *match) : 1 / (1 + rivals);
    judgement.probability.push_back(probability);
    if (pairs.votes[n] < options_.votes_needed && (match || !all_taken)) {
      judgement.object_to(Verdict::kUnsure,
                          fmt::format("trackers that can say something about cluster '{}': {}, but {} are needed",
                                      cluster, pairs.votes[n], options_.votes_needed));
    } else if (probability < options_.sure) {
      judgement.object_to(
          Verdict::kUnsure,
          fmt::format("the best explanation of cluster '{}' has probability {:.3f} only", cluster, probability));
    }
  }
  return judgement;
}

void TrackingArbiter::settle(const Scene& scene, std::span<const std::string> objects_of_clusters, Verdict verdict) {
  ++counts_.scenes;
  if (verdict == Verdict::kContradicted) ++counts_.contradicted;
  if (verdict == Verdict::kUnsure) ++counts_.unsure;
  for (std::size_t n = 0; n < scene.clusters.size(); ++n) resume(objects_of_clusters[n], scene.clusters[n]);
}

void TrackingArbiter::resume(const std::string& object, const Cluster& cluster) {
  for (Voter& voter : voters_) {
    const auto known = voter.track_of.find(object);
    const auto track = known == voter.track_of.end() ? std::nullopt : std::optional(known->second);
    voter.track_of[object] = voter.tracker->follow(cluster, track);
  }
}

void TrackingArbiter::forget(const std::string& object) {
  for (Voter& voter : voters_) {
    const auto track = voter.track_of.find(object);
    if (track == voter.track_of.end()) continue;
    voter.tracker->drop(track->second);
    voter.track_of.erase(track);
  }
}

}  // namespace sherlog
