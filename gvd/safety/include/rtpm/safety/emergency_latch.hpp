#pragma once

#include <atomic>
#include <cstdint>

namespace rtpm::gvd {

/// An emergency stop: no force and no commands, until rearm().
/// @threads  stop(), is_set() and number() from any, rearm() from one
/// @realtime alloc-free and without waiting
class EmergencyLatch {
 public:
  void stop() noexcept { number_.fetch_add(1, std::memory_order_acq_rel); }
  [[nodiscard]] bool is_set() const noexcept {
    return number() != rearmed_number_.load(std::memory_order_acquire);
  }
  /// Counts the stops.
  [[nodiscard]] std::uint32_t number() const noexcept {
    return number_.load(std::memory_order_acquire);
  }
  /// Ends the stop, unless it is newer than `number`: a request to rearm ends only stops from
  /// before it.
  /// @return whether no stop is in force now
  bool rearm(std::uint32_t number) noexcept {
    if (number == this->number()) rearmed_number_.store(number, std::memory_order_release);
    return !is_set();
  }

 private:
  std::atomic<std::uint32_t> number_{0};
  std::atomic<std::uint32_t> rearmed_number_{0};
};

}  // namespace rtpm::gvd
