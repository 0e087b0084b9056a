#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "rtpm/base/hash.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/gvd/lease.hpp"

namespace rtpm::gvd {

/// Admits one caller per interval.
/// @ownership a value, not copied
/// @threads  step() from one, take() from any
/// @realtime alloc-free and without waiting
class RateGate {
 public:
  explicit RateGate(Duration interval) noexcept : interval_(interval) {}

  /// True for one caller, then false until step() sees that the interval has passed.
  [[nodiscard]] bool take() noexcept { return is_open_.exchange(false, std::memory_order_acq_rel); }
  void step(MonotonicTime now) noexcept;

 private:
  Duration interval_;
  std::atomic<bool> is_open_{true};
  std::optional<MonotonicTime> opens_{};
};

/// Creates a key for a device's leases from the system's random source.
/// @realtime set-up only
[[nodiscard]] SipKey random_lease_key();

/// The right to command a device, held by one client at a time. It ends when it is released or
/// taken over, or its holder is silent or idle for too long. An operator's lease, one that was
/// taken over, is never idle. An unguessable number identifies the holder.
/// @ownership a value, not copied
/// @threads  step() and revoke() from the device's thread, everything else from any
/// @realtime alloc-free, never waits, reads no clock
class Lease {
 public:
  /// The holder's number if there is no holder.
  static constexpr std::uint64_t kNobody = 0;
  /// How many of the newest leases state_of() remembers.
  static constexpr std::size_t kRememberedCount = 16;

  /// The random `key` generates the leases' numbers.
  Lease(const LeaseConfig& config, SipKey key) noexcept
      : config_(config),
        key_(key),
        acquire_gate_(config.acquire_interval),
        take_over_gate_(config.take_over_interval) {}

  /// Acquires the lease and returns its number; nullopt while it is held, or within
  /// acquire_interval of the last acquire().
  [[nodiscard]] std::optional<std::uint64_t> acquire() noexcept;
  /// Takes the lease, even if held, and returns its number; nullopt within take_over_interval of
  /// the last take_over().
  [[nodiscard]] std::optional<std::uint64_t> take_over() noexcept;
  /// True if `id` holds the lease; counts as a heartbeat from the next step on.
  bool renew(std::uint64_t id) noexcept;
  /// True if `id` holds the lease; counts as a heartbeat and as a use.
  bool use(std::uint64_t id) noexcept;
  /// Releases the lease; false if `id` does not hold it.
  bool release(std::uint64_t id) noexcept;

  /// Call once per cycle: ends an expired lease; returns the holder or kNobody.
  std::uint64_t step(MonotonicTime now) noexcept;
  /// Ends the lease of a lost or stopped device.
  void revoke() noexcept;

  [[nodiscard]] std::uint64_t holder() const noexcept {
    return holder_.load(std::memory_order_acquire);
  }
  /// State of the lease `id`.
  [[nodiscard]] LeaseState state_of(std::uint64_t id) const noexcept;
  /// A short number, unique among 65536 consecutive leases.
  [[nodiscard]] static constexpr std::uint16_t serial_of(std::uint64_t id) noexcept {
    return static_cast<std::uint16_t>(id);
  }
  [[nodiscard]] const LeaseConfig& config() const noexcept { return config_; }
  /// Leases ended by silence.
  [[nodiscard]] std::uint64_t expired_count() const noexcept {
    return expired_count_.load(std::memory_order_relaxed);
  }
  /// Leases ended by idleness.
  [[nodiscard]] std::uint64_t idle_count() const noexcept {
    return idle_count_.load(std::memory_order_relaxed);
  }
  /// Leases taken over.
  [[nodiscard]] std::uint64_t taken_over_count() const noexcept {
    return taken_over_count_.load(std::memory_order_relaxed);
  }

 private:
  struct Record {
    std::atomic<std::uint64_t> id{kNobody};
    std::atomic<LeaseState> state{LeaseState::kUnknown};
  };

  [[nodiscard]] std::uint64_t next_id() noexcept;
  /// Ends the lease of `id` with `state`; false if `id` does not hold it.
  bool end(std::uint64_t id, LeaseState state) noexcept;
  void remember(std::uint64_t id, LeaseState state) noexcept;

  LeaseConfig config_;
  SipKey key_;
  RateGate acquire_gate_;
  RateGate take_over_gate_;
  std::array<Record, kRememberedCount> records_{};
  std::atomic<std::uint64_t> serial_{0};
  std::atomic<std::uint64_t> holder_{kNobody};
  std::atomic<std::uint64_t> operator_{kNobody};  ///< The newest taken-over lease.
  std::atomic<std::uint64_t> renewed_count_{0};
  std::atomic<std::uint64_t> used_count_{0};
  std::atomic<std::uint64_t> expired_count_{0};
  std::atomic<std::uint64_t> idle_count_{0};
  std::atomic<std::uint64_t> taken_over_count_{0};
  // Used by the device's thread only, to detect a new holder, heartbeats and uses.
  std::uint64_t seen_holder_ = kNobody;
  std::uint64_t seen_renewed_count_ = 0;
  std::uint64_t seen_used_count_ = 0;
  MonotonicTime expires_{};
  MonotonicTime idles_{};
};

}  // namespace rtpm::gvd
