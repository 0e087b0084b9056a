#pragma once

#include "rtpm/base/priority.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/rt/pi_mutex.hpp"

namespace rtpm::rt {

/// A mutex with a priority ceiling: its holder runs at the ceiling at once, so that on one CPU no
/// thread that wants it ever waits behind another one, and two of them can't lock each other out
/// for good. It costs two system calls more than PiMutex, each time; worth it where
/// the wait itself is the harm, not only its length.
///
/// Below it is a PiMutex. POSIX's own (PTHREAD_PRIO_PROTECT) refuses threads that are time-shared
/// or above the ceiling; here the one is what the system may leave a program with, and the other a
/// priority that a caller may send. Both are served: without being raised, but with inheritance.
/// Works with std::lock_guard. Several are to be given back in the opposite order.
/// @threads  any
/// @realtime alloc-free; two syscalls at a level below the ceiling, else as PiMutex
/// @source   POSIX's PTHREAD_PRIO_PROTECT; the immediate ceiling protocol
class CeilingMutex {
 public:
  /// `ceiling`: the highest priority of those that take it.
  explicit CeilingMutex(Priority ceiling) noexcept : ceiling_(ceiling) {}
  CeilingMutex(const CeilingMutex&) = delete;
  CeilingMutex& operator=(const CeilingMutex&) = delete;

  void lock() noexcept;
  [[nodiscard]] bool try_lock() noexcept;
  /// As PiMutex::try_lock_until().
  [[nodiscard]] bool try_lock_until(MonotonicTime deadline) noexcept;
  void unlock() noexcept;
  [[nodiscard]] Priority ceiling() const noexcept { return ceiling_; }

 private:
  PiMutex mutex_;
  Priority ceiling_;
  int level_before_ = 0;  ///< Of the holder, if it was raised; else 0.
};

}  // namespace rtpm::rt
