#pragma once

#include <cstddef>

#include "rtpm/base/time.hpp"

namespace rtpm::rt {

/// A count that one thread raises and another waits for, to wake a sleeping thread. Unlike a
/// condition variable it has no internal lock that could delay a more urgent thread.
/// @threads  any
/// @realtime alloc-free; post() makes one syscall if a thread waits, otherwise none
class Semaphore {
 public:
  Semaphore() noexcept;
  Semaphore(const Semaphore&) = delete;
  Semaphore& operator=(const Semaphore&) = delete;
  ~Semaphore();
  void post() noexcept;
  /// Waits until the count is above 0, and decrements it; false if it is still 0 at `deadline`.
  [[nodiscard]] bool wait_until(MonotonicTime deadline) noexcept;

 private:
  alignas(8) std::byte storage_[32];  ///< The system's semaphore.
};

}  // namespace rtpm::rt
