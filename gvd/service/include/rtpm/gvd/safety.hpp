#pragma once

#include <cstdint>
#include <optional>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/driver/command.hpp"
#include "rtpm/driver/descriptor.hpp"
#include "rtpm/driver/sample.hpp"
#include "rtpm/rpc/error.hpp"

namespace rtpm::gvd {

/// Limits of the safety filter, which can't be turned off.
struct SafetyConfig {
  double force_newton_max = 0;                           ///< Maximum magnitude; 0: no force.
  double torque_newton_metre_max = 0;                    ///< Likewise.
  double force_newton_per_s_max = 1000;                  ///< Maximum rate of change.
  double torque_newton_metre_per_s_max = 50;             ///< Likewise.
  Duration hold_max = std::chrono::milliseconds{100};    ///< Maximum life of a command.
  Duration ramp = std::chrono::milliseconds{20};         ///< From full force to zero, after a loss.
  Duration soft_start = std::chrono::milliseconds{200};  ///< From zero to full force.

  /// The defaults with the device's own limits.
  [[nodiscard]] static SafetyConfig for_device(const driver::Limits& limits) noexcept;
  /// Whether every value is valid.
  /// @realtime set-up only
  /// @errors   names a limit that is negative or not finite, or a time that is negative or above 10
  ///           s
  [[nodiscard]] expected<void, SetupError> check() const;
};

/// A client's command: a wrench and its life.
struct WrenchCommand {
  driver::Wrench wrench{};
  MonotonicTime received{};  ///< Time of receipt.
  /// Lost from then on unless a newer one came; at most SafetyConfig::hold_max after `received`.
  MonotonicTime deadline{};
};

/// Counters of the filter.
struct SafetyCounters {
  std::uint64_t lost_count = 0;          ///< Commands stopped while a force was applied.
  std::uint64_t not_finite_count = 0;    ///< Faults latched by a NaN or infinity.
  std::uint64_t clamped_count = 0;       ///< Cycles with a command above a limit.
  std::uint64_t rate_limited_count = 0;  ///< Cycles with a command that rose too fast.
};

/// The filter between clients' commands and actuators. In every cycle:
///
/// - a NaN or infinity: no force at once, and none until recover(), however good later commands
/// are;
/// - a wrench above a limit is shortened and keeps its direction;
/// - force and torque are rate-limited by the elapsed time;
/// - a change of client: the force falls to zero within `ramp` and is zero for one cycle at least
///   before the next client's commands count;
/// - soft start: after start, loss, recovery and a change of client the share of the command that
///   is applied rises from nothing to all over `soft_start`;
/// - the watchdog: at a command's deadline without a newer one, the force falls in a straight line
///   to zero within `ramp`, then is off.
///
/// The bound: with a command's deadline at t, the output is zero in every step at or after
/// t + ramp, whatever happened to client and link. Where step() runs once per period the actuators
/// are therefore without force at t + ramp + one period at the latest.
/// @ownership a value
/// @threads  one at a time
/// @realtime alloc-free; reads no clock
class SafetyFilter {
 public:
  /// `config` has passed check().
  explicit SafetyFilter(const SafetyConfig& config) noexcept : config_(config) {}

  /// One cycle at time `now`: filters the newest command, or none if no client may command. A
  /// decreasing time counts as the last one.
  [[nodiscard]] driver::Wrench step(MonotonicTime now,
                                    const std::optional<WrenchCommand>& offered) noexcept;

  /// Replaces the limits from the next step on; a force above a lowered limit falls to it at the
  /// greatest rate. `config` has passed check().
  void configure(const SafetyConfig& config) noexcept { config_ = config; }
  /// Ends the latched fault; the force returns by soft start.
  void recover() noexcept;
  /// Call before another client's commands, or none: the force first falls to zero as after a loss,
  /// then returns by soft start.
  void change_client() noexcept;
  /// Zero force at once, for a lost device; the force returns by soft start.
  void reset() noexcept;

  /// The filter's faults as of the last step.
  [[nodiscard]] driver::Faults faults() const noexcept { return faults_; }
  [[nodiscard]] const SafetyCounters& counters() const noexcept { return counters_; }
  /// Whether the last step had a live command.
  [[nodiscard]] bool is_following() const noexcept { return is_following_; }
  /// Share, 0 to 1, of the command that soft start or the ramp admitted in the last step.
  [[nodiscard]] double gain() const noexcept { return gain_; }
  /// Whether the last step's output was zero.
  [[nodiscard]] bool is_off() const noexcept { return output_ == driver::Wrench{}; }
  /// When the output will be zero without a newer command; in the past if it is.
  [[nodiscard]] MonotonicTime zero_at() const noexcept { return zero_at_; }
  [[nodiscard]] const SafetyConfig& config() const noexcept { return config_; }

 private:
  void follow(const WrenchCommand& command, Duration elapsed) noexcept;
  void ramp_down(MonotonicTime now, Duration elapsed) noexcept;
  void go_off() noexcept;

  SafetyConfig config_;
  SafetyCounters counters_{};
  driver::Wrench output_{};
  driver::Faults faults_{};
  std::optional<MonotonicTime> last_step_{};
  MonotonicTime zero_at_{};
  double gain_ = 0;                  ///< Share of the command admitted by soft start.
  bool is_following_ = false;        ///< The last step had a live command.
  bool is_changing_client_ = false;  ///< The former client's force is not zero yet.
  bool is_lost_ = false;             ///< The last followed command expired.
  bool is_latched_ = false;          ///< A command was not finite.
};

}  // namespace rtpm::gvd
