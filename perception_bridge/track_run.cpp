#include "perception_bridge/track_run.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <thread>

#include "inference/parallel.h"

namespace sherlog {
namespace {

constexpr std::uint64_t kBatch = 64;  // trials held at a time: stops are heeded between them

struct Answered {
  FourTablesTrial trial;
  std::vector<MatcherAnswer> answers;
};

}  // namespace

TrackRunResult run_trials(const TrackRun& run, std::span<const Matcher* const> matchers, const StopCondition& stop,
                          const std::function<void(const FourTablesTrial&, std::span<const MatcherAnswer>)>& collect,
                          const std::function<void(std::uint64_t)>& progress) {
  TrackRunResult result;
  const std::uint32_t threads = run.threads != 0 ? run.threads : std::max(1u, std::thread::hardware_concurrency());
  for (std::uint64_t first = 0; first < run.trials; first += kBatch) {
    const std::uint64_t count = std::min(kBatch, run.trials - first);
    std::vector<Answered> batch(count);
    std::atomic<std::uint64_t> next{0};
    std::atomic<bool> stopped{false};
    run_on_threads(std::min<std::uint64_t>(threads, count), [&] {
      for (std::uint64_t i = next++; i < count; i = next++) {
        if (stopped || stop.reached()) {
          stopped = true;
          return;
        }
        batch[i].trial = simulate_four_tables(run.config, run.seed, first + i);
        for (const Matcher* matcher : matchers) batch[i].answers.push_back(matcher->resolve(batch[i].trial));
      }
    });
    for (const Answered& answered : batch) {
      if (answered.answers.size() < matchers.size()) {  // its thread was stopped
        result.termination = stop.reason();
        result.message = fmt::format("stopped after {} of {} trials", result.trials, run.trials);
        return result;
      }
      for (std::size_t m = 0; m < matchers.size(); ++m) {
        const MatcherAnswer& answer = answered.answers[m];
        if (answer.termination == Termination::kCompleted) continue;
        result.termination = answer.termination;
        result.message = fmt::format("trial {}, {}: {}", answered.trial.number, matchers[m]->name(), answer.message);
        return result;
      }
      collect(answered.trial, answered.answers);
      ++result.trials;
    }
    if (progress) progress(result.trials);
  }
  return result;
}

}  // namespace sherlog
