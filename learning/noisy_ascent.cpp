#include "learning/noisy_ascent.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <deque>

namespace sherlog {
namespace {

using Vector = std::vector<double>;

constexpr std::size_t kPairs = 20;            // that L-BFGS remembers
constexpr double kLongestStep = 1.0;          // of a coordinate
constexpr int kMostTries = 10;                // of one line search
constexpr double kNoiseShare = 2.0;           // times d / n left to gain: then noise prevails
constexpr std::uint32_t kAveraged = 40;       // short steps of the second part, of which ...
constexpr std::uint32_t kForgotten = 8;       // ... the first are not averaged
constexpr double kSmallestExactGain = 1e-10;  // nats, where there is no noise

double dot(const Vector& a, const Vector& b) {
  double sum = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += a[i] * b[i];
  return sum;
}

double largest(const Vector& a) {
  double result = 0.0;
  for (const double value : a) result = std::max(result, std::abs(value));
  return result;
}

Vector moved(Vector x, const Vector& direction, double step) {
  for (std::size_t i = 0; i < x.size(); ++i) x[i] += step * direction[i];
  return x;
}

class Ascent {
 public:
  Ascent(Vector start, const SlopeFunction& evaluate, const NoisyAscentOptions& options)
      : evaluate_(evaluate), options_(options), x_(std::move(start)) {}

  NoisyAscentOutcome run() {
    if (evaluate(x_, here_)) {
      while (!climb() && !average()) {
      }
    }
    outcome_.x = std::move(x_);
    outcome_.slope_norm = here_.slope.empty() ? 0.0 : largest(here_.slope);
    return std::move(outcome_);
  }

 private:
  struct Pair {
    Vector step, change;  // of x; of the slope, downwards
    double product = 0.0;
  };

  bool evaluate(const Vector& x, SampledSlope& result) {
    if (outcome_.evaluations >= options_.max_evaluations) {
      outcome_.reason = fmt::format("the limit of {} iterations was reached", options_.max_evaluations);
      return false;
    }
    if (!evaluate_(x, outcome_.evaluations, result)) {
      outcome_.cut_short = true;
      outcome_.reason = "it was stopped";
      return false;
    }
    ++outcome_.evaluations;
    return true;
  }

  bool noisy() const { return std::isfinite(here_.draws); }
  // What noise alone lets slope' H^-1 slope be.
  double noise() const { return noisy() ? static_cast<double>(x_.size()) / here_.draws : 0.0; }

  // H^-1 slope by the two loops of L-BFGS.
  Vector ascent_direction() const {
    Vector q = here_.slope;
    Vector alpha(pairs_.size());
    for (std::size_t p = pairs_.size(); p-- > 0;) {
      alpha[p] = dot(pairs_[p].step, q) / pairs_[p].product;
      q = moved(std::move(q), pairs_[p].change, -alpha[p]);
    }
    // Where no pair speaks: as the caller guessed, or longer where a pair showed that to be timid. The usual scale, that of
    // the last pair, is the steepest direction's and would take all others for being done with.
    double scale = 1.0;
    for (const Pair& pair : pairs_) {
      double guessed = 0.0;
      for (std::size_t i = 0; i < x_.size(); ++i) guessed += pair.change[i] * pair.change[i] / here_.curvature[i];
      scale = std::max(scale, pair.product / guessed);
    }
    for (std::size_t i = 0; i < q.size(); ++i) q[i] *= scale / here_.curvature[i];
    for (std::size_t p = 0; p < pairs_.size(); ++p) {
      const double beta = dot(pairs_[p].change, q) / pairs_[p].product;
      q = moved(std::move(q), pairs_[p].step, alpha[p] - beta);
    }
    return q;
  }

  void remember(const Vector& direction, double step, const SampledSlope& there) {
    Pair pair{Vector(x_.size()), Vector(x_.size()), 0.0};
    for (std::size_t i = 0; i < x_.size(); ++i) {
      pair.step[i] = step * direction[i];
      pair.change[i] = here_.slope[i] - there.slope[i];
    }
    pair.product = dot(pair.step, pair.change);
    // The noise of the product has a variance of 2 product / n: it should stand out by two of its roots.
    if (!(pair.product > (noisy() ? 8.0 / here_.draws : 1e-14))) return;
    pairs_.push_back(std::move(pair));
    if (pairs_.size() > kPairs) pairs_.pop_front();
  }

  // The first part. True: all is said; false: noise prevails here.
  bool climb() {
    while (true) {
      if (largest(here_.slope) <= options_.slope_tolerance) {
        outcome_.converged = true;
        outcome_.reason = fmt::format("the gradient is below {:g}", options_.slope_tolerance);
        return true;
      }
      const Vector direction = ascent_direction();
      const double left = dot(direction, here_.slope);
      if (noisy() && left <= kNoiseShare * noise()) return false;
      if (!noisy() && !pairs_.empty() && left <= 2 * kSmallestExactGain) {
        outcome_.converged = true;
        outcome_.reason = fmt::format("there is less than {:g} to gain", kSmallestExactGain);
        return true;
      }
      const Search found = search(direction, left);
      if (found == Search::kEnded) return true;
      if (found == Search::kNothing) {
        if (!pairs_.empty()) {
          pairs_.clear();  // the direction may have been at fault
        } else if (noisy()) {
          return false;
        } else {
          outcome_.reason = "no step goes up any more";
          return true;
        }
      }
    }
  }

  enum class Search : std::uint8_t { kMoved, kNothing, kEnded };

  Search search(const Vector& direction, double left) {
    if (!(left > 0.0)) return Search::kNothing;
    const double noise = noisy() ? std::sqrt(left / here_.draws) : 0.0;  // of a slope along the direction
    double step = std::min(1.0, kLongestStep / largest(direction));
    for (int attempt = 0; attempt < kMostTries; ++attempt) {
      const Vector there = moved(x_, direction, step);
      SampledSlope slope;
      if (!evaluate(there, slope)) return Search::kEnded;
      const double along = dot(slope.slope, direction);
      if (along >= -0.5 * left - 2.0 * noise) {
        remember(direction, step, slope);
        x_ = there;
        here_ = std::move(slope);
        return Search::kMoved;
      }
      step *= std::clamp(left / (left - along), 0.05, 0.5);
    }
    return Search::kNothing;
  }

  // The second part. True: all is said; false: there is more to gain than it seemed.
  bool average() {
    Vector sum(x_.size(), 0.0), point = x_;
    double count = 0.0;
    for (std::uint32_t t = 0; t < kAveraged; ++t) {
      const Vector direction = ascent_direction();
      const double rate = 0.5 / (1.0 + t / 20.0);
      point =
          moved(std::move(point), direction, std::min(rate, 0.5 * kLongestStep / std::max(1e-300, largest(direction))));
      if (t >= kForgotten) {
        sum = moved(std::move(sum), point, 1.0);
        count += 1.0;
        x_ = moved(Vector(x_.size(), 0.0), sum, 1.0 / count);
      }
      if (!evaluate(point, here_)) return true;
    }
    if (!evaluate(x_, here_)) return true;
    if (dot(ascent_direction(), here_.slope) > 2.0 * kNoiseShare * noise()) return false;
    outcome_.converged = true;
    outcome_.reason = fmt::format("what is left to gain is sampling error, about {:.2g} an iteration", 0.5 * noise());
    return true;
  }

  const SlopeFunction& evaluate_;
  NoisyAscentOptions options_;
  Vector x_;
  SampledSlope here_;  // at x_; in the second part at the latest point
  std::deque<Pair> pairs_;
  NoisyAscentOutcome outcome_;
};

}  // namespace

NoisyAscentOutcome noisy_ascent(std::vector<double> start, const SlopeFunction& evaluate,
                                const NoisyAscentOptions& options) {
  return Ascent(std::move(start), evaluate, options).run();
}

}  // namespace sherlog
