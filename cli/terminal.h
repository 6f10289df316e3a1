// The terminal: whether there is one, colours, the progress bar, Ctrl-C.
//
// The first Ctrl-C sets a flag that long work reads through the Monitor, so that it hands over what it has; the second one ends
// the program at once.
#pragma once

#include <chrono>
#include <mutex>
#include <string>
#include <string_view>

#include "mln/monitor.h"

namespace sherlog::cli {

// Standard error is a terminal, and neither NO_COLOR nor TERM=dumb forbids colour.
bool colour_on_stderr();

// SIGINT and SIGTERM set the flag; SIGPIPE is ignored, so that a closed pipe is an error of write(); descriptors 0 to 2 are
// open afterwards, so that no file that is opened later takes the place of a closed standard output.
void install_signal_handlers();

// Draws a bar on standard error where that is a terminal and `enabled`; elsewhere it draws nothing.
class TerminalMonitor : public Monitor {
 public:
  explicit TerminalMonitor(bool enabled);
  ~TerminalMonitor() override;
  TerminalMonitor(const TerminalMonitor&) = delete;
  TerminalMonitor& operator=(const TerminalMonitor&) = delete;

  void progress(std::string_view stage, double done, double total) override;
  bool interrupted() const override;
  // Takes the bar away, so that text can be printed.
  void clear();

 private:
  using Clock = std::chrono::steady_clock;
  std::mutex mutex_;
  bool draws_;
  bool shown_ = false;
  Clock::time_point start_ = Clock::now();
  Clock::time_point last_drawn_ = Clock::now();
};

}  // namespace sherlog::cli
