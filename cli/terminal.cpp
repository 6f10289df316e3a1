#include "cli/terminal.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <ctime>

namespace sherlog::cli {
namespace {

volatile std::sig_atomic_t interrupt_requested = 0;
timespec first_interrupt = {};

// Asked a second time, it ends at once. What sends a signal to a process and to its group, as timeout(1) does, asks once.
extern "C" void on_interrupt(int) {
  timespec now = {};
  clock_gettime(CLOCK_MONOTONIC, &now);
  if (interrupt_requested == 0) {
    first_interrupt = now;
    interrupt_requested = 1;
    return;
  }
  const double seconds = static_cast<double>(now.tv_sec - first_interrupt.tv_sec) +
                         1e-9 * static_cast<double>(now.tv_nsec - first_interrupt.tv_nsec);
  if (seconds > 0.2) _exit(130);
}

}  // namespace

bool colour_on_stderr() {
  const char* no_color = std::getenv("NO_COLOR");
  const char* term = std::getenv("TERM");
  return isatty(STDERR_FILENO) == 1 && (no_color == nullptr || *no_color == '\0') &&
         (term == nullptr || std::string_view(term) != "dumb");
}

void install_signal_handlers() {
  for (int descriptor = 0; descriptor <= 2; ++descriptor) {
    if (fcntl(descriptor, F_GETFD) == -1 && errno == EBADF) {
      // Opened for the wrong direction on purpose: writing to a closed standard output stays an error.
      (void)open("/dev/null", descriptor == 0 ? O_WRONLY : O_RDONLY);
    }
  }
  struct sigaction action = {};
  action.sa_handler = on_interrupt;
  action.sa_flags = SA_RESTART;
  sigemptyset(&action.sa_mask);
  sigaddset(&action.sa_mask, SIGINT);  // one at a time
  sigaddset(&action.sa_mask, SIGTERM);
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);  // a batch system that ends a job gets what there is, too
  std::signal(SIGPIPE, SIG_IGN);
  std::signal(SIGXFSZ, SIG_IGN);  // a file that grows too large is an error of write()
}

TerminalMonitor::TerminalMonitor(bool enabled) : draws_(enabled && isatty(STDERR_FILENO) == 1) {}

TerminalMonitor::~TerminalMonitor() { clear(); }

bool TerminalMonitor::interrupted() const { return interrupt_requested != 0; }

void TerminalMonitor::progress(std::string_view stage, double done, double total) {
  if (!draws_) return;
  const std::unique_lock lock(mutex_, std::try_to_lock);
  if (!lock.owns_lock()) return;
  const auto now = Clock::now();
  constexpr auto kPatience = std::chrono::milliseconds(500);  // short work needs no bar
  constexpr auto kPeriod = std::chrono::milliseconds(100);
  if (now - start_ < kPatience || now - last_drawn_ < kPeriod) return;
  last_drawn_ = now;
  shown_ = true;
  const double seconds = std::chrono::duration<double>(now - start_).count();
  if (total > 0) {
    constexpr int kWidth = 30;
    const double part = std::clamp(done / total, 0.0, 1.0);
    const auto filled = static_cast<std::size_t>(part * kWidth);
    fmt::print(stderr, "\r\x1b[K{:<12} [{}{}] {:3.0f} %  {:.0f} s", stage, std::string(filled, '#'),
               std::string(kWidth - filled, ' '), 100 * part, seconds);
  } else {
    fmt::print(stderr, "\r\x1b[K{:<12} {:.0f} done  {:.0f} s", stage, done, seconds);
  }
  std::fflush(stderr);
}

void TerminalMonitor::clear() {
  const std::lock_guard lock(mutex_);
  if (shown_) std::fputs("\r\x1b[K", stderr);
  shown_ = false;
  std::fflush(stderr);
}

}  // namespace sherlog::cli
