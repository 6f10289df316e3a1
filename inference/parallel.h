// One piece of work on several threads.
#pragma once

#include <cstdint>
#include <exception>
#include <mutex>
#include <system_error>
#include <thread>
#include <vector>

namespace sherlog {

// Runs `work()` on so many threads, the caller's among them, and returns when all have ended. The first exception that one of
// them meets (memory that ran out) is thrown again here. Where the machine gives fewer threads, fewer do the work: `work`
// takes its share from a common counter.
template <class Work>
void run_on_threads(std::size_t threads, const Work& work) {
  std::mutex mutex;
  std::exception_ptr first;
  const auto guarded = [&]() noexcept {
    try {
      work();
    } catch (...) {
      const std::lock_guard lock(mutex);
      if (!first) first = std::current_exception();
    }
  };
  {
    std::vector<std::jthread> helpers;
    helpers.reserve(threads);
    try {
      for (std::size_t t = 1; t < threads; ++t) helpers.emplace_back(guarded);
    } catch (const std::system_error&) {  // no more threads to be had
    }
    guarded();
  }
  if (first) std::rethrow_exception(first);
}

}  // namespace sherlog
