#include <algorithm>
#include <chrono>

#include "inference/assignment.h"
#include "perception_bridge/baseline_matchers.h"
#include "perception_bridge/grades.h"

namespace sherlog {
namespace {

struct Similarities {
  std::vector<double> similar, proximity, combined;  // by new and old cluster
};

Similarities measure(const FourTablesTrial& trial, const BaselineOptions& options) {
  Similarities out;
  for (const Observation& now : trial.new_clusters) {
    for (const Observation& old : trial.old_clusters) {
      out.similar.push_back(printed_g(color_distance(old, now), options.sigma_color));
      out.proximity.push_back(printed_g(position_distance(old, now, trial.config), options.sigma_position));
      out.combined.push_back(out.similar.back() * out.proximity.back());
    }
  }
  return out;
}

// Table 1 read as thresholds: similar and close is stay, similar alone move, close alone newview.
MatcherAnswer explain(const FourTablesTrial& trial, const Similarities& s,
                      std::vector<std::optional<std::uint32_t>> association) {
  MatcherAnswer answer;
  for (const Observation& old : trial.old_clusters) {
    answer.resolution.explanation.push_back(old.out_of_view ? ClusterExplanation::kHidden
                                                            : ClusterExplanation::kDisappear);
  }
  for (std::size_t n = 0; n < association.size(); ++n) {
    if (!association[n]) continue;
    const std::size_t pair = n * trial.old_clusters.size() + *association[n];
    const bool similar = s.similar[pair] >= 0.5, close = s.proximity[pair] >= 0.5;
    answer.resolution.explanation[*association[n]] = similar == close ? ClusterExplanation::kStay
                                                     : similar        ? ClusterExplanation::kMove
                                                                      : ClusterExplanation::kNewview;
  }
  answer.resolution.association = std::move(association);
  return answer;
}

class SimpleMatcher : public Matcher {
 public:
  explicit SimpleMatcher(const BaselineOptions& options) : options_(options) {}

  MatcherAnswer resolve(const FourTablesTrial& trial) const override {
    const auto start = std::chrono::steady_clock::now();
    const Similarities s = measure(trial, options_);
    MatcherAnswer answer = explain(trial, s, associate(trial, s.combined));
    answer.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    return answer;
  }

 protected:
  virtual std::vector<std::optional<std::uint32_t>> associate(const FourTablesTrial& trial,
                                                              const std::vector<double>& combined) const = 0;
  BaselineOptions options_;
};

class NearestNeighbour : public SimpleMatcher {
 public:
  using SimpleMatcher::SimpleMatcher;
  std::string name() const override { return "nearest"; }

 protected:
  std::vector<std::optional<std::uint32_t>> associate(const FourTablesTrial& trial,
                                                      const std::vector<double>& combined) const override {
    const std::size_t old_clusters = trial.old_clusters.size();
    std::vector<std::optional<std::uint32_t>> association(trial.new_clusters.size());
    std::vector<std::optional<std::size_t>> holder(old_clusters);
    for (std::size_t n = 0; old_clusters > 0 && n < association.size(); ++n) {
      const auto row = combined.begin() + static_cast<std::ptrdiff_t>(n * old_clusters);
      const auto best = std::max_element(row, row + static_cast<std::ptrdiff_t>(old_clusters));
      const auto o = static_cast<std::uint32_t>(best - row);
      if (*best < options_.least_similarity) continue;
      if (holder[o]) {
        if (combined[*holder[o] * old_clusters + o] >= *best) continue;
        association[*holder[o]].reset();
      }
      holder[o] = n;
      association[n] = o;
    }
    return association;
  }
};

class Hungarian : public SimpleMatcher {
 public:
  using SimpleMatcher::SimpleMatcher;
  std::string name() const override { return "hungarian"; }

 protected:
  std::vector<std::optional<std::uint32_t>> associate(const FourTablesTrial& trial,
                                                      const std::vector<double>& combined) const override {
    std::vector<double> gains = combined;
    for (double& gain : gains) {
      if (gain < options_.least_similarity) gain = -1;
    }
    return best_assignment(gains, trial.new_clusters.size(), trial.old_clusters.size()).column_of;
  }
};

}  // namespace

std::unique_ptr<Matcher> nearest_neighbour_matcher(const BaselineOptions& options) {
  return std::make_unique<NearestNeighbour>(options);
}

std::unique_ptr<Matcher> hungarian_matcher(const BaselineOptions& options) {
  return std::make_unique<Hungarian>(options);
}

}  // namespace sherlog
