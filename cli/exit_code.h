// What the program ends with, and how a termination of the library becomes that.
#pragma once

#include "mln/monitor.h"

namespace sherlog::cli {

inline constexpr int kDone = 0;  // warnings too
inline constexpr int kInternalError = 1;
inline constexpr int kBadInput = 2;      // usage, input, or a method that refuses this model
inline constexpr int kNoWorld = 3;       // or soft evidence that cannot be met
inline constexpr int kLimitReached = 4;  // time, memory, width: what was found so far is handed over
inline constexpr int kInterruptedExit = 130;

constexpr int exit_code(Termination termination) {
  switch (termination) {
    case Termination::kCompleted:
      return kDone;
    case Termination::kRefused:
      return kBadInput;
    case Termination::kNoPossibleWorld:
      return kNoWorld;
    case Termination::kTimeLimit:
    case Termination::kMemoryLimit:
    case Termination::kTooWide:
      return kLimitReached;
    case Termination::kInterrupted:
      return kInterruptedExit;
  }
  return kInternalError;
}

}  // namespace sherlog::cli
