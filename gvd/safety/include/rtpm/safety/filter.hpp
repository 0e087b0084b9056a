#pragma once

#include <cstdint>
#include <optional>

#include "rtpm/base/time.hpp"
#include "rtpm/driver/geometry.hpp"
#include "rtpm/driver/sample.hpp"
#include "rtpm/safety/config.hpp"
#include "rtpm/safety/limits.hpp"
#include "rtpm/safety/motion.hpp"
#include "rtpm/safety/passivity_guard.hpp"
#include "rtpm/safety/watchdog.hpp"

namespace rtpm::gvd {

/// A client's wrench and how long it is valid.
struct WrenchCommand {
  driver::Wrench wrench{};
  MonotonicTime received{};  ///< When it was received.
  /// When the command counts as lost, unless a newer one arrived; at most SafetyConfig::hold_max
  /// after `received`.
  MonotonicTime deadline{};
};

/// Counters of the filter.
struct SafetyCounters {
  /// Commands that expired without a newer one while a client could command.
  std::uint64_t lost_count = 0;
  std::uint64_t not_finite_count = 0;  ///< Faults latched because a command had a NaN or infinity.
  std::uint64_t tripped_count = 0;     ///< Faults latched because the device moved too fast.
  std::uint64_t clamped_count = 0;     ///< Cycles whose command was above a limit.
  std::uint64_t rate_limited_count = 0;   ///< Cycles whose command changed too fast.
  std::uint64_t wall_count = 0;           ///< Cycles with the device outside the workspace.
  std::uint64_t power_limited_count = 0;  ///< Cycles whose command would have given too much power.
  std::uint64_t braked_count = 0;         ///< Cycles braked by the passivity guard.
  /// Cycles whose force was reduced because the motors were hot.
  std::uint64_t heat_limited_count = 0;
};

/// The filter between clients' commands and actuators: a chain of mechanisms, each with its own
/// class. In every cycle:
///
/// - NotFiniteLatch, VelocityTrip: no force at once, and none until recover();
/// - a change of client: the force falls to zero within `ramp`, and stays zero for at least one
///   cycle before the next client's commands apply;
/// - Clamp, SoftStart, SoftWall, PowerLimit, PassivityGuard, HeatLimit, RateLimit shape a live
///   command, in this order; the result is within Clamp's limits;
/// - Watchdog: if no newer command arrives by a command's deadline, its policy removes the force.
///
/// The bound: if a command's deadline is t, the output is zero in every step at or after
/// Watchdog::zero_at(), by default t + ramp, whatever happens to client and link. If step() runs
/// once per period, the actuators are therefore without force by t + ramp + one period.
/// @ownership a value
/// @threads  one at a time
/// @realtime alloc-free; reads no clock
class SafetyFilter {
 public:
  /// `config` has passed check().
  explicit SafetyFilter(const SafetyConfig& config) noexcept : config_(config) {}

  /// One cycle at time `now`: filters the newest command, or none if no client may command. If time
  /// decreases, the previous time is used. `motion` is the last cycle's.
  [[nodiscard]] driver::Wrench step(MonotonicTime now, const std::optional<WrenchCommand>& offered,
                                    const Motion& motion = {}) noexcept;

  /// Clears the latched faults; the force returns by soft start.
  void recover() noexcept;
  /// Call it before commands of another client, or of none: the force first falls to zero as after
  /// a loss, then returns by soft start.
  void change_client() noexcept;
  /// Sets the force to zero at once, for a lost device; the force returns by soft start.
  void reset() noexcept;
  /// Replaces the limits, which have passed check(), from the next step on. The force moves to
  /// lower limits at the permitted rate.
  void configure(const SafetyConfig& config) noexcept { config_ = config; }

  /// The filter's faults after the last step.
  [[nodiscard]] driver::Faults faults() const noexcept { return faults_; }
  [[nodiscard]] const SafetyCounters& counters() const noexcept { return counters_; }
  /// Whether the last step had a live command.
  [[nodiscard]] bool is_following() const noexcept { return is_following_; }
  /// Share, 0 to 1, of the command that soft start or the ramp let through in the last step.
  [[nodiscard]] double gain() const noexcept { return soft_start_.share(); }
  /// Whether the last step's output was zero.
  [[nodiscard]] bool is_off() const noexcept { return output_ == driver::Wrench{}; }
  /// Whether the force stays off until recover().
  [[nodiscard]] bool is_latched() const noexcept { return not_finite_.is_set() || trip_.is_set(); }
  /// When the output will be zero without a newer command; in the past if it already is.
  [[nodiscard]] MonotonicTime zero_at() const noexcept { return watchdog_.zero_at(); }
  [[nodiscard]] const SafetyConfig& config() const noexcept { return config_; }
  [[nodiscard]] const PassivityGuard& passivity() const noexcept { return passivity_; }
  [[nodiscard]] const HeatLimit& heat() const noexcept { return heat_; }

 private:
  void latch(const std::optional<WrenchCommand>& offered, const Motion& motion) noexcept;
  void follow(const WrenchCommand& command, Duration elapsed, const Motion& motion) noexcept;
  /// Notes that a mechanism acted in this cycle.
  void note(bool has_acted, driver::Fault fault, std::uint64_t& count) noexcept;
  void go_off() noexcept;

  SafetyConfig config_;
  SafetyCounters counters_{};
  NotFiniteLatch not_finite_{};
  VelocityTrip trip_{};
  SoftStart soft_start_{};
  PassivityGuard passivity_{};
  HeatLimit heat_{};
  Watchdog watchdog_{};
  driver::Wrench output_{};
  driver::Faults faults_{};
  std::optional<MonotonicTime> last_step_{};
  bool is_following_ = false;        ///< The last step had a live command.
  bool is_changing_client_ = false;  ///< The previous client's force is not yet zero.
  bool is_lost_ = false;             ///< The last followed command expired.
};

}  // namespace rtpm::gvd
