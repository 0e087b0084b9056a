#pragma once

#include <cstdint>
#include <optional>

#include "rtpm/base/expected.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/driver/command.hpp"
#include "rtpm/driver/descriptor.hpp"
#include "rtpm/driver/sample.hpp"
#include "rtpm/rpc/error.hpp"

namespace rtpm::gvd {

/// What the safety filter allows. There is no way to turn the filter off.
struct SafetyConfig {
  double force_newton_max = 0;                ///< Length of the greatest force; 0: none at all.
  double torque_newton_metre_max = 0;         ///< Likewise of the torque.
  double force_newton_per_s_max = 1000;       ///< How fast the force may change.
  double torque_newton_metre_per_s_max = 50;  ///< How fast the torque may change.
  Duration hold_max = std::chrono::milliseconds{100};    ///< The longest life of one command.
  Duration ramp = std::chrono::milliseconds{20};         ///< From full force to none, once lost.
  Duration soft_start = std::chrono::milliseconds{200};  ///< From none to full force.

  /// The defaults with the device's own limits.
  [[nodiscard]] static SafetyConfig for_device(const driver::Limits& limits) noexcept;
  /// Whether every value can be used.
  /// @realtime set-up only
  /// @errors   a limit that is negative or not finite, a time that is negative or above 10 s: the
  ///           text names it
  [[nodiscard]] expected<void, rpc::SetupError> check() const;
};

/// A wrench with its life: what a client commands.
struct WrenchCommand {
  driver::Wrench wrench{};
  MonotonicTime received{};  ///< When it came.
  /// From then on it counts as lost unless a newer one came; SafetyConfig::hold_max after
  /// `received` at the latest.
  MonotonicTime deadline{};
};

/// What the filter did so far.
struct SafetyCounters {
  std::uint64_t lost_count = 0;        ///< Times that the commands stopped while force was wanted.
  std::uint64_t not_finite_count = 0;  ///< Times that a NaN or infinity latched the fault.
  std::uint64_t clamped_count = 0;     ///< Cycles whose command was above a limit.
  std::uint64_t rate_limited_count = 0;  ///< Cycles whose command rose too fast.
};

/// Stands between what clients command and what actuators do. In every cycle:
///
/// - a NaN or infinity: no force at once, and none until recover(), however good later commands
/// are;
/// - a wrench above a limit is shortened and keeps its direction;
/// - force and torque change no faster than their rates allow, by the time that really went by;
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
/// @realtime alloc-free. It reads no clock
class SafetyFilter {
 public:
  /// `config` has passed check().
  explicit SafetyFilter(const SafetyConfig& config) noexcept : config_(config) {}

  /// One cycle at time `now`: the newest command, or nothing if nobody may command (any more), to
  /// what is safe. A time before the last one counts as the last one.
  [[nodiscard]] driver::Wrench step(MonotonicTime now,
                                    const std::optional<WrenchCommand>& offered) noexcept;

  /// Ends the latched fault; the force comes back by soft start.
  void recover() noexcept;
  /// Another client's commands follow, or nobody's: the force falls to zero first, as when the
  /// commands are lost, and comes back by soft start.
  void change_client() noexcept;
  /// No force at once, as when the device was lost; the force comes back by soft start.
  void reset() noexcept;

  /// The filter's faults as of the last step.
  [[nodiscard]] driver::Faults faults() const noexcept { return faults_; }
  [[nodiscard]] const SafetyCounters& counters() const noexcept { return counters_; }
  /// Whether the last step's output was no force.
  [[nodiscard]] bool is_off() const noexcept { return output_ == driver::Wrench{}; }
  /// When the output will be zero if no newer command comes; in the past if it is.
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
  double gain_ = 0;                  ///< The share of the command that soft start lets through.
  bool is_following_ = false;        ///< The last step had a command that was alive.
  bool is_changing_client_ = false;  ///< What the former client commanded is not zero yet.
  bool is_lost_ = false;             ///< The last command that was followed ran out.
  bool is_latched_ = false;          ///< A command was not finite.
};

}  // namespace rtpm::gvd
