#include "os/stop.hpp"

#include <poll.h>
#include <pthread.h>
#include <sys/signalfd.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <string>

#include "rtpm/rt/log.hpp"
#include "rtpm/rt/native_time.hpp"

namespace rtpm::program::os {
namespace {

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

StopSource open_stop_source() {
  sigset_t signals;
  sigemptyset(&signals);
  for (const int signal : stop_signals())
    sigaddset(&signals, signal);
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  const int source = signalfd(-1, &signals, SFD_CLOEXEC | SFD_NONBLOCK);
  if (source < 0) {
    rt::print_error({}, "the system gives no descriptor to wait for signals (" +
                            std::string(std::strerror(errno)) +
                            "): close files, or raise the limit of open files (ulimit -n)");
    std::exit(1);
  }
  return source;
}

void close_stop_source(StopSource source) noexcept {
  close(static_cast<int>(source));
}

// The data of the descriptor is never read: the signal stays pending.
bool await_stop(StopSource source, std::optional<Duration> patience) noexcept {
  pollfd wanted{.fd = static_cast<int>(source), .events = POLLIN, .revents = 0};
  timespec timeout{};
  if (patience) timeout = rt::to_timespec(*patience);
  return ppoll(&wanted, 1, patience ? &timeout : nullptr, nullptr) > 0;
}

}  // namespace rtpm::program::os
