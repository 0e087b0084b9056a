#include "rtpm/program/stop_signal.hpp"

#include <algorithm>
#include <chrono>
#include <cstdio>

#include "os/stop.hpp"

namespace rtpm::program {

std::vector<int> stop_signals() {
  return os::stop_signals();
}

StopSignal::StopSignal(LostOutput lost_output)
    : lost_output_(lost_output), source_(os::open_stop_source()) {}

StopSignal::~StopSignal() {
  os::close_stop_source(source_);
}

bool StopSignal::is_output_lost() const noexcept {
  return lost_output_ == LostOutput::kRequestsEnd && std::ferror(stdout) != 0;
}

bool StopSignal::is_requested() const noexcept {
  return is_output_lost() || os::await_stop(source_, Duration{0});
}

void StopSignal::wait() const noexcept {
  // Other signals, such as a debugger's, end the system call early.
  while (!os::await_stop(source_, std::nullopt)) {
  }
}

bool StopSignal::wait_for(Duration duration) const noexcept {
  if (is_output_lost()) return true;
  using Clock = std::chrono::steady_clock;
  const Clock::time_point begin = Clock::now();
  for (;;) {
    const Duration left = std::max(Duration{0}, duration - (Clock::now() - begin));
    if (os::await_stop(source_, left)) return true;
    if (left.count() == 0) return false;
  }
}

}  // namespace rtpm::program
