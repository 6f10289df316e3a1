// Many trials through some matchers, on several threads, in order.
#pragma once

#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "mln/monitor.h"
#include "perception_bridge/identity_belief.h"

namespace sherlog {

struct TrackRun {
  FourTablesConfig config;
  std::uint64_t seed = 1;
  std::uint64_t trials = 1000;
  std::uint32_t threads = 0;  // 0: as many as the machine has; what is collected does not depend on it
};

struct TrackRunResult {
  Termination termination = Termination::kCompleted;
  std::string message;
  std::uint64_t trials = 0;  // collected
};

// `collect` is called on this thread with trial 0, 1, 2, ... and the matchers' answers, in their order. A trial that some matcher
// could not answer ends the run; so does `stop`. `progress`: trials done so far, from time to time.
TrackRunResult run_trials(const TrackRun& run, std::span<const Matcher* const> matchers, const StopCondition& stop,
                          const std::function<void(const FourTablesTrial&, std::span<const MatcherAnswer>)>& collect,
                          const std::function<void(std::uint64_t)>& progress = {});

}  // namespace sherlog
