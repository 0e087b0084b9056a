#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "device_jobs.hpp"
#include "held_outputs.hpp"
#include "local_models.hpp"
#include "mailbox.hpp"

#include "rtpm/base/hash.hpp"
#include "rtpm/base/latest.hpp"
#include "rtpm/base/priority.hpp"
#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/driver/driver.hpp"
#include "rtpm/gvd/client_command.hpp"
#include "rtpm/gvd/command_lease.hpp"
#include "rtpm/gvd/device.hpp"
#include "rtpm/gvd/error.hpp"
#include "rtpm/gvd/setpoint_limiter.hpp"
#include "rtpm/safety/emergency_latch.hpp"
#include "rtpm/safety/filter.hpp"
#include "rtpm/safety/flight_recorder.hpp"

namespace rtpm::gvd {

/// State transitions that the lease's holder may request.
enum class Transition : std::uint8_t {
  kActivate,
  kDeactivate,
};
/// Latched states that the lease's holder may end.
enum class Release : std::uint8_t {
  kRecover,  ///< Releases a latched fault.
  kRearm,    ///< Releases an emergency stop.
};

/// Share of good cycles among the last 100.
/// @ownership a value
/// @realtime alloc-free
class SuccessRate {
 public:
  void record(bool is_good) noexcept;
  [[nodiscard]] float share() const noexcept;
  static constexpr std::uint32_t kWindow = 100;

 private:
  std::array<bool, kWindow> is_good_{};
  std::size_t count_ = 0;
  std::size_t good_count_ = 0;
};

/// A device's loop without thread or clock: the work of a cycle, and wait-free access for other
/// threads.
/// @ownership refers to its driver, which must outlive it
/// @threads  see the groups below
/// @realtime alloc-free and wait-free, except begin(), maintain() and end(), which are set-up
class DeviceCycle {
 public:
  DeviceCycle(driver::Driver& driver, CycleConfig config, SipKey lease_key);

  // Called by the device's thread.

  /// Configures and activates the device.
  /// @errors   those of the driver
  [[nodiscard]] expected<void, SetupError> begin(MonotonicTime now);
  /// Starts without the device, because begin() failed with `error`: reports that, and retries as
  /// for a lost device.
  void begin_without(MonotonicTime now, const SetupError& error);
  /// One cycle: filters the newest command, sends it to the device, and publishes the sample
  /// received. `missed_count` cycles were skipped before.
  /// @realtime no system call except the driver's
  void run(MonotonicTime now, std::uint32_t missed_count) noexcept;
  /// Whether maintain() has work.
  [[nodiscard]] bool needs_maintenance(MonotonicTime now) const noexcept;
  /// Runs a waiting job; activates, deactivates, or retries a lost device. May take seconds.
  void maintain(MonotonicTime now);
  /// Deactivates the device for good.
  void end(MonotonicTime now) noexcept;
  /// The limits in force: safety() or tighter. May also be called from a thread that performs a
  /// job.
  [[nodiscard]] const SafetyConfig& present_safety() const noexcept { return filter_.config(); }
  void set_present_safety(const SafetyConfig& safety) noexcept { filter_.configure(safety); }

  // Called by any thread.

  /// Stores `command`, received at `received`, for the next cycle.
  /// @errors   see the service's method `command` in device.fbs
  [[nodiscard]] expected<void, DeviceOutcome> submit(const ClientCommand& command,
                                                     MonotonicTime received) noexcept;
  /// Stores a request for the next cycle, valid if `lease` is still held then. Only the last one
  /// per cycle counts.
  /// @errors   kNotHolder
  [[nodiscard]] expected<void, DeviceOutcome> request(std::uint64_t lease,
                                                      Transition transition) noexcept;
  /// Stores a request to end a latched state for the next cycle.
  /// @errors   kNotHolder
  [[nodiscard]] expected<void, DeviceOutcome> request(std::uint64_t lease,
                                                      Release release) noexcept;
  /// Stores the lease's models for the next cycle; they replace the previous ones.
  /// @errors   see the service's method `set_models` in device.fbs
  [[nodiscard]] expected<void, ModelsRefusal> set_models(const ClientModels& models) noexcept;
  /// Stops the device: no force from the next cycle on, and no commands, until Release::kRearm.
  void emergency_stop() noexcept;
  [[nodiscard]] bool is_stopped() const noexcept { return emergency_.is_set(); }
  /// Takes the lease for a call of `priority`; returns its number. The force goes to zero before
  /// the new holder's commands apply.
  /// @errors   kBelowOperatorPriority · kTooSoon: the last take-over was less than
  ///           LeaseConfig::take_over_interval ago
  [[nodiscard]] expected<std::uint64_t, DeviceOutcome> take_over(Priority priority) noexcept;
  [[nodiscard]] Lease& lease() noexcept { return lease_; }
  /// The newest sample; nullopt before the first cycle.
  [[nodiscard]] std::optional<driver::Sample> newest() const noexcept { return published_.read(); }
  /// The newest sample at `now`. Sets kDeviceLate if an active device has not completed a cycle for
  /// more than twenty periods, such as in a driver that does not return; these cycles count as bad.
  [[nodiscard]] std::optional<driver::Sample> newest(MonotonicTime now) const noexcept;
  /// How long ago an active device completed its last cycle.
  [[nodiscard]] Duration silence(MonotonicTime now) const noexcept;
  [[nodiscard]] DeviceCounters counters() const noexcept;
  /// The limits that the server was started with.
  [[nodiscard]] const SafetyConfig& safety() const noexcept { return safety_; }
  /// The cycles around the newest fault.
  [[nodiscard]] const FlightRecorder& flight_recorder() const noexcept { return recorder_; }
  /// The jobs that run between two cycles of the device.
  [[nodiscard]] DeviceJobs& jobs() noexcept { return jobs_; }
  [[nodiscard]] const CycleConfig& config() const noexcept { return config_; }
  [[nodiscard]] driver::Lifecycle lifecycle() const noexcept {
    return lifecycle_.load(std::memory_order_acquire);
  }

 private:
  struct HeldCommand {
    std::uint64_t lease = Lease::kNobody;
    driver::Setpoint setpoint{};
    WrenchCommand wrench{};  ///< The command's wrench; zero in other modes.
  };

  [[nodiscard]] const HeldCommand* command_of(MonotonicTime now, std::uint64_t holder) noexcept;
  /// The command combined with the holder's models, which need no command while the lease is held.
  [[nodiscard]] const HeldCommand* with_models(MonotonicTime now, std::uint64_t holder,
                                               const HeldCommand* newest) noexcept;
  [[nodiscard]] driver::Command filter(MonotonicTime now, const HeldCommand* newest,
                                       bool has_outputs) noexcept;
  void drop_commands() noexcept;
  [[nodiscard]] expected<void, DeviceOutcome> leave(std::atomic<std::uint64_t>& request,
                                                    std::uint64_t lease,
                                                    std::uint16_t what) noexcept;
  /// The fault of a cycle.
  enum class BadCycle : std::uint8_t { kNone, kGone, kLate, kCorrupt, kNotFinite, kUnknownStatus };
  [[nodiscard]] BadCycle exchange(MonotonicTime now, const driver::Command& command) noexcept;
  [[nodiscard]] BadCycle count_bad(MonotonicTime now, BadCycle bad) noexcept;
  [[nodiscard]] bool is_bad_for_too_long(MonotonicTime now) const noexcept;
  [[nodiscard]] expected<void, SetupError> open(MonotonicTime now);
  void lose(BadCycle why) noexcept;
  [[nodiscard]] std::string loss_text() const;
  void rest(MonotonicTime now) noexcept;
  void publish(MonotonicTime now) noexcept;
  void record_flight(MonotonicTime now) noexcept;
  void show_observer(MonotonicTime now) noexcept;
  [[nodiscard]] bool has_lease_report() const noexcept;
  void report_lease();
  void report(std::string_view text) const;

  driver::Driver& driver_;
  CycleConfig config_;
  Lease lease_;
  SetpointLimiter limiter_;
  SafetyConfig safety_;
  SafetyFilter filter_;
  FlightRecorder recorder_{};

  // Shared between threads.
  LocalModels models_;
  DeviceJobs jobs_{};
  Mailbox<HeldCommand> mailbox_{};
  /// The lease of a command that was not finite, since the last cycle: a newer command may have
  /// replaced it in the mailbox.
  std::atomic<std::uint64_t> not_finite_of_{Lease::kNobody};
  HeldOutputs outputs_{};
  Latest<driver::Sample> published_{};
  Latest<DeviceCounters> published_counters_{};
  std::atomic<MonotonicTime> published_at_{};
  /// A holder's requests, packed by request_of(), or 0. Each has a place of its own, as both that
  /// come within a cycle take place.
  std::atomic<std::uint64_t> transition_request_{0};
  std::atomic<std::uint64_t> recover_request_{0};
  std::atomic<std::uint64_t> rearm_request_{0};
  EmergencyLatch emergency_{};
  std::atomic<std::uint16_t> taken_over_at_priority_{0};
  std::atomic<driver::Lifecycle> lifecycle_{driver::Lifecycle::kUnconfigured};
  std::atomic<std::uint64_t> command_count_{0};
  std::atomic<std::uint64_t> foreign_command_count_{0};
  std::atomic<std::uint64_t> old_command_count_{0};
  std::atomic<std::uint64_t> hasty_command_count_{0};

  // Used by the device's thread only.
  driver::Sample sample_{};
  HeldCommand held_{};
  HeldCommand rendered_{};  ///< The held command with the models' forces.
  FlightRecord flight_{};   ///< The command of this cycle; publish() adds the rest.
  std::array<double, driver::kJointCountMax> efforts_{};  ///< The last efforts, after the limits.
  std::uint64_t last_holder_ = Lease::kNobody;
  std::uint64_t shown_holder_ = Lease::kNobody;  ///< The holder last reported to the observer.
  LeaseState shown_end_ = LeaseState::kUnknown;
  std::uint64_t shown_models_ = 0;  ///< LocalModels::revision() last reported to the observer.
  SuccessRate success_{};
  DeviceCounters counters_{};
  MonotonicTime opened_at_{};
  std::uint32_t bad_cycle_count_ = 0;  ///< The number of consecutive bad cycles.
  MonotonicTime bad_since_{};          ///< The time of the first bad cycle.
  BadCycle lost_by_ = BadCycle::kNone;
  /// The field that was not finite in the last kNotFinite sample.
  std::string_view not_finite_field_{};
  std::optional<Transition> wanted_{};  ///< Requested; the next maintain() carries it out.
  std::uint64_t reported_idle_count_ = 0;
  std::uint64_t reported_taken_over_count_ = 0;
  bool is_to_close_ = false;
  bool is_rearmed_ = false;  ///< Rearmed since the last maintain().
  MonotonicTime retry_at_{};
};

}  // namespace rtpm::gvd
