#include <sys/epoll.h>

#include <algorithm>
#include <ctime>

// Valgrind 3.19 does not know this system call, with which lanes wait. This one replaces it, to the
// millisecond: the accuracy of a lane's wake-up is not counted.
extern "C" int epoll_pwait2(int epoll, epoll_event* events, int event_count_max,
                            const timespec* timeout, const sigset_t* signals) {
  int timeout_ms = -1;
  if (timeout != nullptr) {
    constexpr long kNsPerMs = 1'000'000;
    const long rest_ms = (timeout->tv_nsec + kNsPerMs - 1) / kNsPerMs;
    timeout_ms = static_cast<int>(std::min<long>(timeout->tv_sec, 1000) * 1000 + rest_ms);
  }
  return ::epoll_pwait(epoll, events, event_count_max, timeout_ms, signals);
}
