#pragma once

#include <pthread.h>

namespace rtpm::rt {

/// A mutex with priority inheritance: its holder runs at the priority of the most urgent waiter, so
/// a middle lane can't delay a higher lane that waits for a lower one. Works with std::lock_guard.
/// @threads  any
/// @realtime alloc-free; no syscall if uncontended
class PiMutex {
 public:
  PiMutex() noexcept;
  PiMutex(const PiMutex&) = delete;
  PiMutex& operator=(const PiMutex&) = delete;
  ~PiMutex();
  void lock() noexcept;
  [[nodiscard]] bool try_lock() noexcept;
  void unlock() noexcept;

 private:
  pthread_mutex_t mutex_;
};

}  // namespace rtpm::rt
