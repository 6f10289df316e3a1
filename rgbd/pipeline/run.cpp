#include "rgbd/pipeline/run.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <mutex>
#include <new>
#include <opencv2/core.hpp>
#include <system_error>
#include <thread>

namespace sherlog::rgbd {
namespace {

// What the threads share; all of it under the lock, but for running annotators.
class FlowRun {
 public:
  FlowRun(const Annotators& annotators, const Flow& flow, const Analysis& given)
      : annotators_(annotators),
        flow_(flow),
        given_(given),
        states_(flow.order.size(), kWaits),
        additions_(flow.order.size()),
        runs_(flow.order.size()) {
    for (std::size_t i = 0; i < flow.order.size(); ++i) runs_[i].annotator = annotators[flow.order[i]]->name();
  }

  void work() {
    std::unique_lock lock(mutex_);
    while (finished_ < states_.size()) {
      const auto ready = next();
      if (!ready) {
        changed_.wait(lock);
        continue;
      }
      const std::size_t i = *ready;
      states_[i] = kRuns;
      runs_[i].problem = missing(i);
      if (runs_[i].problem.empty()) {
        const Analysis in = input(i);
        lock.unlock();
        AnnotatorRun run = runs_[i];
        Analysis out;
        run_one(i, in, out, run);
        lock.lock();
        runs_[i] = std::move(run);
        if (runs_[i].problem.empty()) additions_[i] = std::move(out);
      }
      states_[i] = kEnded;
      ++finished_;
      changed_.notify_all();
    }
  }

  // Memory is not an annotator's own problem: without it no result is what it should be.
  bool out_of_memory() const { return out_of_memory_; }
  std::vector<AnnotatorRun> take_runs() { return std::move(runs_); }
  const std::vector<Analysis>& additions() const { return additions_; }

 private:
  enum State : char { kWaits, kRuns, kEnded };
  static constexpr const char* kNoMemory = "out of memory";

  std::optional<std::size_t> next() const {
    for (std::size_t i = 0; i < states_.size(); ++i) {
      if (states_[i] != kWaits) continue;
      const auto has_ended = [&](const Flow::Input& input) { return states_[input.from] == kEnded; };
      if (std::ranges::all_of(flow_.inputs[i], has_ended)) return i;
    }
    return std::nullopt;
  }

  // Why it cannot run: a name of which no writer has a result. Empty: it can.
  std::string missing(std::size_t i) const {
    for (const std::string& name : annotators_[flow_.order[i]]->reads()) {
      bool is_there = given_.has(name);
      std::string who;
      for (const Flow::Input& input : flow_.inputs[i]) {
        if (std::ranges::find(input.names, name) == input.names.end()) continue;
        const AnnotatorRun& writer = runs_[input.from];
        is_there = is_there || (writer.problem.empty() && (is_type_name(name) || additions_[input.from].has(name)));
        who = writer.annotator;
      }
      if (!is_there) return fmt::format("'{}' is missing, which '{}' should have written", name, who);
    }
    return {};
  }

  Analysis input(std::size_t i) const {
    Analysis in = given_.part(annotators_[flow_.order[i]]->reads());
    for (const Flow::Input& input : flow_.inputs[i]) in.merge(additions_[input.from].part(input.names));
    return in;
  }

  void run_one(std::size_t i, const Analysis& in, Analysis& out, AnnotatorRun& run) {
    Annotator& annotator = *annotators_[flow_.order[i]];
    const auto start = std::chrono::steady_clock::now();
    run.ran = true;
    try {
      annotator.process(in, out);
    } catch (const std::bad_alloc&) {
      run.problem = kNoMemory, out_of_memory_ = true;
    } catch (const cv::Exception& error) {
      run.problem = error.what();
      if (error.code == cv::Error::StsNoMem) run.problem = kNoMemory, out_of_memory_ = true;
    } catch (const std::exception& error) {
      run.problem = error.what();
      if (run.problem.empty()) run.problem = "failed without a reason";
    } catch (...) {
      run.problem = "failed without a reason";
    }
    run.milliseconds = std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
    const auto beyond = out.beyond(annotator.writes());
    if (run.problem.empty() && !beyond.empty()) {
      run.problem = fmt::format("wrote '{}', which it does not declare", beyond.front());
    }
  }

  const Annotators& annotators_;
  const Flow& flow_;
  const Analysis& given_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::size_t finished_ = 0;
  std::atomic<bool> out_of_memory_ = false;
  std::vector<State> states_;
  std::vector<Analysis> additions_;
  std::vector<AnnotatorRun> runs_;
};

}  // namespace

std::vector<AnnotatorRun> run_flow(const Annotators& annotators, const Flow& flow, Analysis& analysis,
                                   std::uint32_t threads) {
  const Analysis given = analysis;
  FlowRun run(annotators, flow, given);
  const std::size_t most = threads == 0 ? std::max(1U, std::thread::hardware_concurrency()) : threads;
  {
    std::vector<std::jthread> helpers;
    try {
      for (std::size_t i = 1; i < std::min(most, flow.order.size()); ++i) helpers.emplace_back([&] { run.work(); });
    } catch (const std::system_error&) {
      // There is no room for another thread: fewer do.
    }
    run.work();
  }
  if (run.out_of_memory()) throw std::bad_alloc();
  for (const Analysis& addition : run.additions()) analysis.merge(addition);
  return run.take_runs();
}

void RunTimes::Sums::add(double value) {
  ++runs;
  const double difference = value - mean;
  mean += difference / static_cast<double>(runs);
  squares += difference * (value - mean);
}

RunTimes::Row RunTimes::Sums::row() const {
  const double deviation = runs < 2 ? 0 : std::sqrt(squares / static_cast<double>(runs - 1));
  return {annotator, runs, failures, mean, deviation};
}

void RunTimes::add(const std::vector<AnnotatorRun>& runs) {
  double sum = 0;
  for (const AnnotatorRun& run : runs) {
    auto found = std::ranges::find(sums_, run.annotator, &Sums::annotator);
    if (found == sums_.end()) found = sums_.insert(sums_.end(), Sums{run.annotator});
    if (run.ran) found->add(run.milliseconds);
    if (!run.problem.empty()) ++found->failures, ++total_.failures;
    sum += run.milliseconds;
  }
  total_.add(sum);
}

std::vector<RunTimes::Row> RunTimes::rows() const {
  std::vector<Row> rows;
  for (const Sums& sums : sums_) rows.push_back(sums.row());
  return rows;
}

RunTimes::Row RunTimes::total() const { return total_.row(); }

}  // namespace sherlog::rgbd
