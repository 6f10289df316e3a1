#include "inference/bounded_sum.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "inference/bounded_problem.h"
#include "inference/bounded_search.h"

namespace sherlog {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
// Where the root's bound is so much above the best world (nats), small terms would be lost to underflow; and no search
// would end.
constexpr double kHopelessLog = 500.0;

// The thresholds of one search after the other. Gap and steps are close to powers of the threshold over some orders of
// magnitude, the gap's exponent growing slowly, so the last two searches tell the next threshold; each asks for much more
// work than the one before, so all together cost little more than the last. Where that would visit a good part of all
// assignments, nothing is dropped at all.
class Schedule {
 public:
  Schedule(const BoundedSumOptions& options, double full_steps)
      : options_(options),
        full_steps_(full_steps),
        threshold_(options.first_threshold > 0.0 ? options.first_threshold : kFirstThreshold),
        last_expected_(options.first_threshold > 0.0) {}

  double threshold() const { return threshold_; }
  // The next search is likely to reach the gap; one before may leave marginals out.
  bool last_expected() const { return last_expected_; }

  // Steps for the next search, 0: it is not worth a try.
  std::uint64_t allowed(std::uint64_t used) const {
    if (used >= options_.max_steps) return 0;
    const std::uint64_t left = options_.max_steps - used;
    if (needed_ > kOptimism * static_cast<double>(left)) return 0;
    // Where the first and easiest search takes long there is no hope.
    const bool may_be_hopeless = full_steps_ > static_cast<double>(left);
    return searches_ == 0 && options_.first_threshold <= 0.0 && may_be_hopeless ? std::min(left, options_.max_steps / 8)
                                                                                : left;
  }

  // What the last search found and took.
  void note(double gap, double steps) {
    ++searches_;
    if (gap <= options_.relative_gap) {
      last_expected_ = true;
      return;
    }
    const double log_gap = std::log(gap), log_threshold = std::log(threshold_), log_steps = std::log(steps + 1.0);
    double exponent = kUsualExponent, growth = kUsualGrowth;
    if (searches_ > 1 && last_log_gap_ > log_gap) {
      exponent = std::clamp((last_log_gap_ - log_gap) / (last_log_threshold_ - log_threshold), 0.3, 1.0);
      growth = std::clamp((log_steps - last_log_steps_) / (last_log_threshold_ - log_threshold), 0.0, 1.0);
    }
    const double wanted = (std::log(0.8 * options_.relative_gap) - log_gap) / exponent;
    const double step = std::max(wanted, -kLongestStep);
    last_expected_ = step == wanted;
    if (searches_ > 1) needed_ = std::min(full_steps_, steps * std::exp(-growth * wanted));
    last_log_gap_ = log_gap;
    last_log_threshold_ = log_threshold;
    last_log_steps_ = log_steps;
    threshold_ *= std::exp(step);
    if (needed_ > kGoodPart * full_steps_) {
      threshold_ = kNothingDropped;
      last_expected_ = true;
      needed_ = full_steps_;
    }
  }

 private:
  static constexpr double kFirstThreshold = 1e-3;
  static constexpr double kUsualExponent = 0.65, kUsualGrowth = 0.3;
  static constexpr double kLongestStep = 7.0;  // three orders of magnitude; the exponents are not to be trusted further
  static constexpr double kGoodPart = 0.9;
  static constexpr double kNothingDropped = 1e-280;
  static constexpr double kOptimism = 4.0;  // more steps than this times those left: not tried

  const BoundedSumOptions& options_;
  double full_steps_;
  double threshold_;
  bool last_expected_;
  int searches_ = 0;
  double last_log_gap_ = 0.0, last_log_threshold_ = 0.0, last_log_steps_ = 0.0, needed_ = 0.0;
};

void read_marginals(const BoundedProblem& problem, const BoundedSearch& search,
                    std::span<const std::uint32_t> cardinalities, std::span<const std::vector<std::uint32_t>> scopes,
                    BoundedSumResult& result) {
  result.marginals.resize(cardinalities.size());
  for (std::size_t p = 0; p < problem.order.size(); ++p) {
    if (problem.order[p] == BoundedProblem::kNone) continue;
    auto& marginal = result.marginals[problem.order[p]];
    for (std::size_t v = 0; v < problem.size[p]; ++v) marginal.push_back(search.mass(p, v) / search.total());
  }
  result.table_marginals.resize(scopes.size());
  for (std::size_t t = 0; t < scopes.size(); ++t) {
    if (scopes[t].size() == 1) result.table_marginals[t] = result.marginals[scopes[t][0]];
  }
  for (const auto& factor : problem.factors) {
    auto& marginal = result.table_marginals[factor.table];
    each_ratio(factor, cardinalities, scopes[factor.table],
               [&](std::size_t, std::size_t at) { marginal.push_back(search.belief(at) / search.total()); });
  }
}

}  // namespace

BoundedSumResult bounded_sum(std::span<const std::uint32_t> cardinalities,
                             std::span<const std::vector<std::uint32_t>> scopes, const LogTables& tables,
                             const BoundedSumOptions& options, const StopCondition& stop) {
  BoundedSumResult result;
  result.log_partition = -kInfinity;
  const BoundedProblem problem = make_bounded_problem(cardinalities, scopes, tables);
  if (problem.impossible) return result;
  BoundedSearch search(problem, stop, options.max_steps);
  const double found = search.find_some();
  const auto finish = [&](Termination termination) {
    result.termination = termination;
    result.nodes = search.nodes();
    result.steps = search.steps();
  };
  if (search.stopped()) {
    finish(search.termination());
    return result;
  }
  if (found < -kHopelessLog) {
    // Nothing is possible, or, where products may have become zero on the way, that cannot be told.
    finish(found == -kInfinity && !problem.may_underflow ? Termination::kCompleted : Termination::kTooWide);
    return result;
  }
  // From here on sums are in units of what the best world found, so none is below 1.
  Schedule schedule(options, search.full_steps());
  while (true) {
    const bool last = schedule.last_expected();
    const std::uint64_t before = search.steps();
    const std::uint64_t allowed = schedule.allowed(before);
    if (allowed == 0 || !search.run(std::exp(-found), schedule.threshold(), allowed, last && options.with_marginals)) {
      finish(allowed == 0 ? Termination::kTooWide : search.termination());
      return result;
    }
    ++result.searches;
    result.threshold = schedule.threshold();
    result.log_partition = problem.log_scale + found + std::log(search.total());
    result.relative_gap = search.dropped() / search.total();
    const bool close = result.relative_gap <= options.relative_gap;
    if (close && (last || !options.with_marginals)) break;
    schedule.note(result.relative_gap, static_cast<double>(search.steps() - before));
  }
  finish(Termination::kCompleted);
  if (options.with_marginals) read_marginals(problem, search, cardinalities, scopes, result);
  return result;
}

}  // namespace sherlog
