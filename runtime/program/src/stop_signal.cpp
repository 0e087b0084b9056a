#include "rtpm/program/stop_signal.hpp"

#include <poll.h>
#include <pthread.h>
#include <sys/signalfd.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>

#include "rtpm/rt/log.hpp"
#include "rtpm/rt/native_time.hpp"

namespace rtpm::program {
namespace {

/// Whether the descriptor became readable within `timeout`; if null, waits for ever. The data is
/// never read: the signal stays pending, so every thread that asks sees it, now and later.
bool is_pending(int signals, const timespec* timeout) noexcept {
  pollfd wanted{.fd = signals, .events = POLLIN, .revents = 0};
  return ppoll(&wanted, 1, timeout, nullptr) > 0;
}

bool is_ignored(int signal) noexcept {
  struct sigaction action {};
  return sigaction(signal, nullptr, &action) == 0 && action.sa_handler == SIG_IGN;
}

}  // namespace

std::vector<int> stop_signals() {
  std::vector<int> signals{SIGINT, SIGTERM};
  for (const int signal : {SIGHUP, SIGQUIT}) {
    // The kernel also reports blocked signals that are ignored.
    if (!is_ignored(signal)) signals.push_back(signal);
  }
  return signals;
}

StopSignal::StopSignal(LostOutput lost_output) : lost_output_(lost_output) {
  sigset_t signals;
  sigemptyset(&signals);
  for (const int signal : stop_signals())
    sigaddset(&signals, signal);
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  signals_ = signalfd(-1, &signals, SFD_CLOEXEC | SFD_NONBLOCK);
  if (signals_ < 0) {
    rt::print_error({}, "the system gives no descriptor to wait for signals (" +
                            std::string(std::strerror(errno)) +
                            "): close files, or raise the limit of open files (ulimit -n)");
    std::exit(1);
  }
}

StopSignal::~StopSignal() {
  close(signals_);
}

bool StopSignal::is_output_lost() const noexcept {
  return lost_output_ == LostOutput::kRequestsEnd && std::ferror(stdout) != 0;
}

bool StopSignal::is_requested() const noexcept {
  constexpr timespec kNow{};
  return is_output_lost() || is_pending(signals_, &kNow);
}

void StopSignal::wait() const noexcept {
  // Other signals, such as a debugger's, end the system call early.
  while (!is_pending(signals_, nullptr)) {
  }
}

bool StopSignal::wait_for(Duration duration) const noexcept {
  if (is_output_lost()) return true;
  using Clock = std::chrono::steady_clock;
  const Clock::time_point begin = Clock::now();
  for (;;) {
    const Duration left = std::max(Duration{0}, duration - (Clock::now() - begin));
    const timespec timeout = rt::to_timespec(left);
    if (is_pending(signals_, &timeout)) return true;
    if (left.count() == 0) return false;
  }
}

}  // namespace rtpm::program
