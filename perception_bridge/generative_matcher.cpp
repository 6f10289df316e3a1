#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <numbers>

#include "inference/matching_sum.h"
#include "perception_bridge/baseline_matchers.h"
#include "perception_bridge/object_fates.h"

namespace sherlog {
namespace {

constexpr double kFar = 8.0;    // sigmas beyond which a density is nothing
constexpr int kIntervals = 48;  // of Simpson's rule over at most 2 kFar sigmas
constexpr double kForced =
    100.0;  // nats; each new cluster is some object, so matchings that leave one alone weigh nothing
constexpr std::size_t kMostClusters = 20;

// One measured coordinate: Gaussian noise on a true value that is uniform in [0, size], and clamped to that range.
class Coordinate {
 public:
  Coordinate(double sigma, double size) : sigma_(sigma), size_(size) {}

  // Integral over true values x from low to high of p(a | x) p(b | x) / size; without b, of p(a | x) / size.
  double both(double a, double b, double low, double high) const {
    if (std::abs(a - b) > 2 * kFar * sigma_) return 0;
    return integrate(std::max({low, reach_low(a), reach_low(b)}), std::min({high, reach_high(a), reach_high(b)}),
                     [&](double x) { return density(a, x) * density(b, x); });
  }
  double one(double a, double low, double high) const {
    return integrate(std::max(low, reach_low(a)), std::min(high, reach_high(a)),
                     [&](double x) { return density(a, x); });
  }

 private:
  double reach_low(double a) const { return a - kFar * sigma_; }
  double reach_high(double a) const { return a + kFar * sigma_; }
  // A density inside, a probability at the ends; the same measure for all hypotheses, so they can be compared.
  double density(double measured, double x) const {
    if (measured <= 0) return 0.5 * std::erfc(x / (sigma_ * std::numbers::sqrt2));
    if (measured >= size_) return 0.5 * std::erfc((size_ - x) / (sigma_ * std::numbers::sqrt2));
    const double z = (measured - x) / sigma_;
    return std::exp(-0.5 * z * z) / (sigma_ * std::sqrt(2 * std::numbers::pi));
  }
  template <class F>
  double integrate(double low, double high, const F& f) const {
    if (!(high > low)) return 0;
    const double step = (high - low) / kIntervals;
    double sum = f(low) + f(high);
    for (int i = 1; i < kIntervals; ++i) sum += (i % 2 == 1 ? 4 : 2) * f(low + step * i);
    return sum * step / 3 / size_;
  }

  double sigma_, size_;
};

class GenerativeMatcher : public Matcher {
 public:
  explicit GenerativeMatcher(const FourTablesConfig& config)
      : config_(config),
        fates_(object_fates(config)),
        axes_{Coordinate(config.noise, config.table_width), Coordinate(config.noise, config.table_depth)},
        channel_(config.noise, 1.0) {}

  std::string name() const override { return "generative"; }

  MatcherAnswer resolve(const FourTablesTrial& trial) const override {
    const auto start = std::chrono::steady_clock::now();
    MatcherAnswer answer;
    if (trial.new_clusters.size() > kMostClusters) {
      answer.termination = Termination::kTooWide;
      answer.message = "the generative matcher sums over at most 20 new clusters";
      return answer;
    }
    answer.resolution = decide(believe(trial), trial);
    answer.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    return answer;
  }

 private:
  // Probability that an object which landed anywhere lies in the view.
  double share_of_view(const View& view) const {
    return (view.max[0] - view.min[0]) * (view.max[1] - view.min[1]) /
           (config_.table_width * config_.table_depth * config_.tables);
  }

  // Density of seeing n where its object may be anywhere, of any colour.
  double anywhere(const Observation& n, const View& view) const {
    double p = 1.0 / config_.tables;
    for (std::size_t a = 0; a < 2; ++a) p *= axes_[a].one(n.position[a], view.min[a], view.max[a]);
    return p;
  }
  double any_color(const Observation& n) const {
    double p = 1;
    for (double channel : n.color) p *= channel_.one(channel, 0, 1);
    return p;
  }
  // ... given the old observation of the same object in the same place, or of the same colour.
  double same_place(const Observation& o, const Observation& n, const View& view) const {
    if (o.table != view.table) return 0;
    double p = 1;
    for (std::size_t a = 0; a < 2 && p > 0; ++a) {
      p *= axes_[a].both(o.position[a], n.position[a], view.min[a], view.max[a]) / old_density_at(o, a);
    }
    return p;
  }
  double same_color(const Observation& o, const Observation& n) const {
    double p = 1;
    for (std::size_t c = 0; c < o.color.size() && p > 0; ++c) {
      p *= channel_.both(o.color[c], n.color[c], 0, 1) / channel_.one(o.color[c], 0, 1);
    }
    return p;
  }
  double old_density_at(const Observation& o, std::size_t axis) const {
    return axes_[axis].one(o.position[axis], 0, axis == 0 ? config_.table_width : config_.table_depth);
  }
  double out_of_sight(const Observation& o, const View& view) const {
    if (o.table != view.table) return 1;
    double inside = 1;
    for (std::size_t a = 0; a < 2; ++a) {
      inside *= axes_[a].one(o.position[a], view.min[a], view.max[a]) / old_density_at(o, a);
    }
    return std::max(0.0, 1 - inside);
  }

  IdentityBelief believe(const FourTablesTrial& trial) const {
    const std::size_t old_clusters = trial.old_clusters.size(), new_clusters = trial.new_clusters.size();
    const std::size_t unknown = std::max<std::size_t>(config_.objects, old_clusters) - old_clusters;
    const double in_view = share_of_view(trial.view);
    IdentityBelief belief(old_clusters, new_clusters);
    if (old_clusters == 0 || new_clusters == 0) return belief;
    std::vector<double> log_weights;
    for (std::size_t o = 0; o < old_clusters; ++o) {
      const Observation& old = trial.old_clusters[o];
      const double unmoved = fates_.untouched + fates_.changed, moved = fates_.moved + fates_.moved_and_changed;
      const double unseen =
          std::max(1e-30, fates_.gone + unmoved * out_of_sight(old, trial.view) + moved * (1 - in_view));
      for (std::size_t n = 0; n < new_clusters; ++n) {
        const Observation& now = trial.new_clusters[n];
        const double place = same_place(old, now, trial.view), color = same_color(old, now);
        const double any = anywhere(now, trial.view), any_hue = any_color(now);
        auto& pair = belief.pair(o, n);  // weights now, probabilities below
        pair = {fates_.untouched * place * color, (fates_.moved * color + fates_.moved_and_changed * any_hue) * any,
                fates_.changed * place * any_hue};
        log_weights.push_back(std::log(belief.same(o, n)) - std::log(unseen) + kForced);
      }
    }
    for (std::size_t u = 0; u < unknown; ++u) {
      for (const Observation& now : trial.new_clusters) {
        const double weight = fates_.put * anywhere(now, trial.view) * any_color(now) / (1 - fates_.put * in_view);
        log_weights.push_back(std::log(weight) + kForced);
      }
    }
    Monitor quiet;
    const MatchingSum sum = matching_sum(log_weights, old_clusters + unknown, new_clusters, StopCondition(quiet));
    for (std::size_t o = 0; o < old_clusters; ++o) {
      for (std::size_t n = 0; n < new_clusters; ++n) {
        const double weight = belief.same(o, n);
        const double probability = sum.paired[o * new_clusters + n];
        for (double& part : belief.pair(o, n)) part = weight > 0 ? part / weight * probability : 0;
      }
    }
    return belief;
  }

  FourTablesConfig config_;
  ObjectFates fates_;
  std::array<Coordinate, 2> axes_;
  Coordinate channel_;
};

}  // namespace

std::unique_ptr<Matcher> generative_matcher(const FourTablesConfig& config) {
  return std::make_unique<GenerativeMatcher>(config);
}

}  // namespace sherlog
