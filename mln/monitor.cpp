#include "mln/monitor.h"

namespace sherlog {

std::string_view to_string(Termination termination) {
  switch (termination) {
    case Termination::kCompleted:
      return "completed";
    case Termination::kTimeLimit:
      return "time_limit";
    case Termination::kMemoryLimit:
      return "memory_limit";
    case Termination::kTooWide:
      return "too_wide";
    case Termination::kInterrupted:
      return "interrupted";
    case Termination::kNoPossibleWorld:
      return "no_possible_world";
    case Termination::kRefused:
      return "refused";
  }
  return "unknown";
}

}  // namespace sherlog
