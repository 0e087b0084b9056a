#pragma once

#include <atomic>
#include <cstdint>
#include <optional>

#include "rtpm/base/hash.hpp"
#include "rtpm/base/time.hpp"

namespace rtpm::gvd {

/// The right to command a device, which one client has at a time and loses when it is silent for
/// too long. Its holder is known by a number that nobody else can guess.
/// Ownership: a value, not copied.
/// Threads: step() and revoke() from the device's thread, everything else from any.   RT:
/// alloc-free and without waiting. It reads no clock.
class Lease {
 public:
  /// The number that stands for "nobody".
  static constexpr std::uint64_t kNobody = 0;

  /// A lease lasts `duration` from when it was acquired or last used. `key` is drawn at random: it
  /// makes the numbers.
  Lease(Duration duration, SipKey key) noexcept : duration_(duration), key_(key) {}

  /// Takes the lease: its number, or nothing while somebody else has it.
  [[nodiscard]] std::optional<std::uint64_t> acquire() noexcept;
  /// True if `id` holds the lease; it then lasts anew from the next step on.
  bool renew(std::uint64_t id) noexcept;
  /// Gives the lease back; false if `id` does not hold it.
  bool release(std::uint64_t id) noexcept;

  /// Lets a lease end whose time is over; once per cycle. Returns who holds it, or kNobody.
  std::uint64_t step(MonotonicTime now) noexcept;
  /// Takes it away from whoever has it.
  void revoke() noexcept;

  [[nodiscard]] std::uint64_t holder() const noexcept {
    return holder_.load(std::memory_order_acquire);
  }
  [[nodiscard]] Duration duration() const noexcept { return duration_; }
  /// How often it ended because its holder was silent.
  [[nodiscard]] std::uint64_t expired_count() const noexcept {
    return expired_count_.load(std::memory_order_relaxed);
  }

 private:
  Duration duration_;
  SipKey key_;
  std::atomic<std::uint64_t> serial_{0};
  std::atomic<std::uint64_t> holder_{kNobody};
  std::atomic<std::uint64_t> renewed_count_{0};
  std::atomic<std::uint64_t> expired_count_{0};
  // The device thread's own view, by which it sees that the lease changed hands or was renewed.
  std::uint64_t seen_holder_ = kNobody;
  std::uint64_t seen_renewed_count_ = 0;
  MonotonicTime expires_{};
};

}  // namespace rtpm::gvd
