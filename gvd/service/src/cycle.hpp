#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include "command_lease.hpp"
#include "mailbox.hpp"

#include "rtpm/base/expected.hpp"
#include "rtpm/base/hash.hpp"
#include "rtpm/base/latest.hpp"
#include "rtpm/base/priority.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/driver/driver.hpp"
#include "rtpm/gvd/device.hpp"
#include "rtpm/gvd/safety.hpp"
#include "rtpm/rpc/error.hpp"

namespace rtpm::gvd {

/// A command as a client states it.
struct ForceCommand {
  std::uint64_t lease = Lease::kNobody;
  std::uint32_t sequence = 0;
  Duration hold{0};  ///< Shortened to SafetyConfig::hold_max.
  driver::Wrench wrench{};
};

/// What the holder of the lease may ask of a device.
enum class Transition : std::uint8_t {
  kActivate,
  kDeactivate,
};

/// The share of good ones among the last 100 cycles.
/// @ownership a value
/// @realtime alloc-free
class SuccessRate {
 public:
  void record(bool is_good) noexcept;
  [[nodiscard]] float share() const noexcept;

 private:
  static constexpr std::size_t kWindow = 100;
  std::array<bool, kWindow> is_good_{};
  std::size_t count_ = 0;
  std::size_t good_count_ = 0;
};

/// One device's loop without its thread and clock: what happens in a cycle, and how the threads of
/// the world outside reach it without ever waiting for it.
/// @ownership refers to its driver, which must outlive it
/// @threads  what stands under "device's thread" from one thread; the rest from any
class DeviceCycle {
 public:
  DeviceCycle(driver::Driver& driver, CycleConfig config, SipKey lease_key);

  // The device's thread.

  /// Configures and activates the device.
  /// @realtime set-up only
  /// @errors   as the driver's
  [[nodiscard]] expected<void, driver::DriverError> begin(MonotonicTime now);
  /// One cycle: takes the newest command through the safety filter to the device and publishes its
  /// sample. `missed_count` cycles were left out before this one.
  /// @realtime alloc-free, no syscall of its own; the driver's exchange() does what it does
  void run(MonotonicTime now, std::uint32_t missed_count) noexcept;
  /// True when the device is to change its state, which maintain() then does.
  /// @realtime alloc-free
  [[nodiscard]] bool needs_maintenance(MonotonicTime now) const noexcept;
  /// Activates, deactivates, or tries again to reach a lost device; may take seconds.   Set-up
  /// only.
  void maintain(MonotonicTime now);
  /// Deactivates the device for good: no force.
  /// @realtime set-up only
  void end(MonotonicTime now) noexcept;

  // Any thread.

  /// Leaves `command`, which came at `received`, for the next cycle.
  /// @realtime alloc-free, no wait
  /// @errors   as the service's method `command` says in device.fbs
  [[nodiscard]] rpc::Result<void> submit(const ForceCommand& command,
                                         MonotonicTime received) noexcept;
  /// Leaves a request for the next cycle, which counts if `lease` is still held then. The last of
  /// several in one cycle counts.
  /// @realtime alloc-free, no wait
  /// @errors   kNotLeaseHolder
  [[nodiscard]] rpc::Result<void> request(std::uint64_t lease, Transition transition) noexcept;
  /// Leaves the request to end a latched fault, likewise.
  /// @realtime alloc-free, no wait
  /// @errors   kNotLeaseHolder
  [[nodiscard]] rpc::Result<void> request_recovery(std::uint64_t lease) noexcept;
  /// Takes the lease from its holder, if there is one, for a call of `priority`: the new lease's
  /// number. The force goes to zero before a command of the new holder counts.
  /// @realtime alloc-free, no wait
  /// @errors   kNotLeaseHolder: the priority is below CycleConfig::operator_priority · kOverload:
  ///           the last take-over was less than LeaseConfig::take_over_interval ago
  [[nodiscard]] rpc::Result<std::uint64_t> take_over(Priority priority) noexcept;
  [[nodiscard]] Lease& lease() noexcept { return lease_; }
  /// The newest sample; nothing before the first cycle.
  /// @realtime alloc-free
  [[nodiscard]] std::optional<driver::Sample> newest() const noexcept { return published_.read(); }
  [[nodiscard]] DeviceCounters counters() const noexcept;
  [[nodiscard]] const SafetyConfig& safety() const noexcept { return filter_.config(); }
  [[nodiscard]] const CycleConfig& config() const noexcept { return config_; }
  [[nodiscard]] driver::Lifecycle lifecycle() const noexcept {
    return lifecycle_.load(std::memory_order_acquire);
  }

 private:
  struct HeldCommand {
    std::uint64_t lease = Lease::kNobody;
    std::uint32_t sequence = 0;
    WrenchCommand command{};
  };

  [[nodiscard]] std::optional<WrenchCommand> command_of(std::uint64_t holder) noexcept;
  [[nodiscard]] rpc::Result<void> leave(std::atomic<std::uint32_t>& request, std::uint64_t lease,
                                        std::uint16_t what) noexcept;
  [[nodiscard]] driver::ExchangeStatus exchange(const driver::Command& command) noexcept;
  [[nodiscard]] expected<void, driver::DriverError> open();
  void lose() noexcept;
  void rest(MonotonicTime now) noexcept;
  void publish() noexcept;
  [[nodiscard]] bool has_lease_report() const noexcept;
  void report_lease();
  void report(std::string_view text) const;

  driver::Driver& driver_;
  CycleConfig config_;
  Lease lease_;
  SafetyFilter filter_;

  // Between the threads.
  Mailbox<HeldCommand> mailbox_{};
  Latest<driver::Sample> published_{};
  Latest<DeviceCounters> published_counters_{};
  /// What a holder requests, with the serial of its lease, as request_of() packs them; 0: nothing.
  std::atomic<std::uint32_t> transition_request_{0};
  std::atomic<std::uint32_t> recovery_request_{0};
  std::atomic<std::uint16_t> taken_over_at_priority_{0};
  std::atomic<driver::Lifecycle> lifecycle_{driver::Lifecycle::kUnconfigured};
  std::atomic<std::uint64_t> command_count_{0};
  std::atomic<std::uint64_t> foreign_command_count_{0};
  std::atomic<std::uint64_t> old_command_count_{0};
  std::atomic<std::uint64_t> hasty_command_count_{0};

  // The device's thread's own.
  driver::Sample sample_{};
  HeldCommand held_{};
  std::uint64_t last_holder_ = Lease::kNobody;
  SuccessRate success_{};
  DeviceCounters counters_{};
  std::uint32_t bad_cycle_count_ = 0;
  std::optional<Transition> wanted_{};  ///< For the next maintain().
  std::uint64_t reported_idle_count_ = 0;
  std::uint64_t reported_taken_over_count_ = 0;
  bool is_to_close_ = false;
  MonotonicTime retry_at_{};
};

}  // namespace rtpm::gvd
