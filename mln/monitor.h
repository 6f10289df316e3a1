// How long work talks to the outside and is stopped from there. The library itself never prints and installs no signal
// handlers: a front end derives from Monitor.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <limits>
#include <string_view>

namespace sherlog {

// Called from worker threads, possibly at the same time. The base class does nothing.
class Monitor {
 public:
  virtual ~Monitor() = default;
  // `done` of `total` units of `stage` ("grounding", "sampling", ...) are finished; total 0: unknown. Called a few times a second
  // at most by well-behaved work (see Stopwatch in the caller), from whichever thread.
  virtual void progress(std::string_view stage, double done, double total) { (void)stage, (void)done, (void)total; }
  // True once the user wants an end: work stops at the next check and hands over what it has. Cheap.
  virtual bool interrupted() const { return false; }
};

// What ended a piece of work.
enum class Termination : std::uint8_t {
  kCompleted,
  kTimeLimit,
  kMemoryLimit,
  kTooWide,
  kInterrupted,
  kNoPossibleWorld,  // or soft evidence that cannot be met
  kRefused,          // the method cannot do this model; the message says what can
};

// "completed", "time_limit", ...: as the JSON output spells it.
std::string_view to_string(Termination termination);

// A deadline and a Monitor in one question. Copyable; safe to ask from several threads.
class StopCondition {
 public:
  using Clock = std::chrono::steady_clock;

  explicit StopCondition(Monitor& monitor, double max_seconds = std::numeric_limits<double>::infinity())
      : monitor_(&monitor), start_(Clock::now()), max_seconds_(max_seconds) {}

  bool interrupted() const { return monitor_->interrupted(); }
  bool out_of_time() const { return seconds() > max_seconds_; }
  // Reads the clock: ask it every few thousand steps, not in the innermost loop.
  bool reached() const { return interrupted() || out_of_time(); }
  // kInterrupted or kTimeLimit; kCompleted where neither holds.
  Termination reason() const {
    if (interrupted()) return Termination::kInterrupted;
    return out_of_time() ? Termination::kTimeLimit : Termination::kCompleted;
  }
  double seconds() const { return std::chrono::duration<double>(Clock::now() - start_).count(); }
  double max_seconds() const { return max_seconds_; }
  Monitor& monitor() const { return *monitor_; }

 private:
  Monitor* monitor_;
  Clock::time_point start_;
  double max_seconds_;
};

}  // namespace sherlog
