#include "rtpm/options/stop_signal.hpp"

#include <poll.h>
#include <pthread.h>
#include <sys/signalfd.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <string>

#include "rtpm/rt/log.hpp"
#include "rtpm/rt/native_time.hpp"

namespace rtpm::options {
namespace {

/// Whether the descriptor became readable within `timeout`; none: wait for ever. What is readable
/// is never read: the signal stays pending, and so every thread that asks sees it, now and later.
bool is_pending(int signals, const timespec* timeout) noexcept {
  pollfd wanted{.fd = signals, .events = POLLIN, .revents = 0};
  return ppoll(&wanted, 1, timeout, nullptr) > 0;
}

}  // namespace

StopSignal::StopSignal() {
  sigset_t stop_signals;
  sigemptyset(&stop_signals);
  sigaddset(&stop_signals, SIGINT);
  sigaddset(&stop_signals, SIGTERM);
  pthread_sigmask(SIG_BLOCK, &stop_signals, nullptr);
  signals_ = signalfd(-1, &stop_signals, SFD_CLOEXEC | SFD_NONBLOCK);
  if (signals_ < 0) {
    rt::print_error({}, "the system gives no descriptor to wait for SIGINT and SIGTERM (" +
                            std::string(std::strerror(errno)) +
                            "): close files, or raise the limit of open files (ulimit -n)");
    std::exit(1);
  }
}

StopSignal::~StopSignal() {
  close(signals_);
}

bool StopSignal::is_requested() const noexcept {
  constexpr timespec kNow{};
  return is_pending(signals_, &kNow);
}

void StopSignal::wait() const noexcept {
  // Other signals, such as a debugger's, end the system call early.
  while (!is_pending(signals_, nullptr)) {
  }
}

bool StopSignal::wait_for(Duration duration) const noexcept {
  using Clock = std::chrono::steady_clock;
  const Clock::time_point begin = Clock::now();
  for (;;) {
    const Duration left = std::max(Duration{0}, duration - (Clock::now() - begin));
    const timespec timeout = rt::to_timespec(left);
    if (is_pending(signals_, &timeout)) return true;
    if (left.count() == 0) return false;
  }
}

}  // namespace rtpm::options
