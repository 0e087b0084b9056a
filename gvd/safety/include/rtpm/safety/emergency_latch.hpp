#pragma once

#include <atomic>

namespace rtpm::gvd {

/// An emergency stop: no force and no commands, until rearm().
/// @threads  any
/// @realtime alloc-free and without waiting
class EmergencyLatch {
 public:
  void stop() noexcept { is_set_.store(true, std::memory_order_release); }
  void rearm() noexcept { is_set_.store(false, std::memory_order_release); }
  [[nodiscard]] bool is_set() const noexcept { return is_set_.load(std::memory_order_acquire); }

 private:
  std::atomic<bool> is_set_{false};
};

}  // namespace rtpm::gvd
