#pragma once

#include <sched.h>

#include <cstddef>

namespace rtpm::bench {

/// Moves the calling thread to other CPUs, and back at its end.   Threads: one.   Set-up only.
class Excursion {
 public:
  Excursion() noexcept { sched_getaffinity(0, sizeof home_, &home_); }
  Excursion(const Excursion&) = delete;
  Excursion& operator=(const Excursion&) = delete;
  ~Excursion() { sched_setaffinity(0, sizeof home_, &home_); }
  /// False if there is no such CPU, or it is not for this thread.
  [[nodiscard]] bool go_to(int cpu) noexcept {
    cpu_set_t there;
    CPU_ZERO(&there);
    CPU_SET(static_cast<std::size_t>(cpu), &there);
    return sched_setaffinity(0, sizeof there, &there) == 0;
  }

 private:
  cpu_set_t home_{};
};

}  // namespace rtpm::bench
