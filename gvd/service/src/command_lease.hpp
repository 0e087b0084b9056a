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

/// Lets something happen at most once per interval.
/// @ownership a value, not copied
/// @threads  step() from one, take() from any
/// @realtime alloc-free and without waiting
class RateGate {
 public:
  explicit RateGate(Duration interval) noexcept : interval_(interval) {}

  /// True for one caller; then false until step() saw the interval go by.
  [[nodiscard]] bool take() noexcept { return is_open_.exchange(false, std::memory_order_acq_rel); }
  void step(MonotonicTime now) noexcept;

 private:
  Duration interval_;
  std::atomic<bool> is_open_{true};
  std::optional<MonotonicTime> opens_{};
};

/// The right to command a device, which one client has at a time. It ends when its holder gives it
/// back, is silent or idle for too long, or when it is taken over. Its holder is known by a number
/// that nobody else can guess.
/// @ownership a value, not copied
/// @threads  step() and revoke() from the device's thread, everything else from any
/// @realtime alloc-free, never waits, reads no clock
class Lease {
 public:
  /// The number that stands for "nobody".
  static constexpr std::uint64_t kNobody = 0;
  /// Of how many leases, the newest ones, state_of() knows how they ended.
  static constexpr std::size_t kRememberedCount = 16;

  /// `key` is drawn at random: it makes the numbers.
  Lease(const LeaseConfig& config, SipKey key) noexcept
      : config_(config),
        key_(key),
        acquire_gate_(config.acquire_interval),
        take_over_gate_(config.take_over_interval) {}

  /// Takes the lease: its number. Nothing while it is held, or within acquire_interval of the
  /// acquire() before.
  [[nodiscard]] std::optional<std::uint64_t> acquire() noexcept;
  /// Takes the lease whether it is held or not: its number. Nothing within take_over_interval of
  /// the take_over() before.
  [[nodiscard]] std::optional<std::uint64_t> take_over() noexcept;
  /// True if `id` holds the lease: a sign of life, from the next step on.
  bool renew(std::uint64_t id) noexcept;
  /// The same, and a use of the lease.
  bool use(std::uint64_t id) noexcept;
  /// Gives the lease back; false if `id` does not hold it.
  bool release(std::uint64_t id) noexcept;

  /// Ends a lease whose time is over; once per cycle. Returns who holds it, or kNobody.
  std::uint64_t step(MonotonicTime now) noexcept;
  /// Ends the lease because the device is lost or stops.
  void revoke() noexcept;

  [[nodiscard]] std::uint64_t holder() const noexcept {
    return holder_.load(std::memory_order_acquire);
  }
  /// How the lease `id` stands or ended.
  [[nodiscard]] LeaseState state_of(std::uint64_t id) const noexcept;
  /// A short number of the lease `id`, which differs between any 65536 leases in a row.
  [[nodiscard]] static constexpr std::uint16_t serial_of(std::uint64_t id) noexcept {
    return static_cast<std::uint16_t>(id);
  }
  [[nodiscard]] const LeaseConfig& config() const noexcept { return config_; }
  /// How often it ended because its holder was silent.
  [[nodiscard]] std::uint64_t expired_count() const noexcept {
    return expired_count_.load(std::memory_order_relaxed);
  }
  /// How often it ended because its holder was idle.
  [[nodiscard]] std::uint64_t idle_count() const noexcept {
    return idle_count_.load(std::memory_order_relaxed);
  }
  /// How often it was taken away from a holder.
  [[nodiscard]] std::uint64_t taken_over_count() const noexcept {
    return taken_over_count_.load(std::memory_order_relaxed);
  }

 private:
  struct Record {
    std::atomic<std::uint64_t> id{kNobody};
    std::atomic<LeaseState> state{LeaseState::kUnknown};
  };

  [[nodiscard]] std::uint64_t next_id() noexcept;
  /// Ends the lease of `id`, for the reason `state`; false if `id` does not hold it.
  bool end(std::uint64_t id, LeaseState state) noexcept;
  void remember(std::uint64_t id, LeaseState state) noexcept;

  LeaseConfig config_;
  SipKey key_;
  RateGate acquire_gate_;
  RateGate take_over_gate_;
  std::array<Record, kRememberedCount> records_{};
  std::atomic<std::uint64_t> serial_{0};
  std::atomic<std::uint64_t> holder_{kNobody};
  std::atomic<std::uint64_t> renewed_count_{0};
  std::atomic<std::uint64_t> used_count_{0};
  std::atomic<std::uint64_t> expired_count_{0};
  std::atomic<std::uint64_t> idle_count_{0};
  std::atomic<std::uint64_t> taken_over_count_{0};
  // The device thread's own view, by which it sees that the lease changed hands or was used.
  std::uint64_t seen_holder_ = kNobody;
  std::uint64_t seen_renewed_count_ = 0;
  std::uint64_t seen_used_count_ = 0;
  MonotonicTime expires_{};
  MonotonicTime idles_{};
};

}  // namespace rtpm::gvd
