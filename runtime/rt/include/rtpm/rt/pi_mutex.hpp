#pragma once

#include <cstddef>

namespace rtpm::rt {

/// A mutex with priority inheritance, which Windows lacks: its holder runs at the priority of the
/// most urgent waiter, so no middle lane delays it meanwhile. Works with std::lock_guard.
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
  alignas(8) std::byte storage_[64];  ///< The system's mutex.
};

}  // namespace rtpm::rt
