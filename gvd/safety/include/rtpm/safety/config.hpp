#pragma once

#include <chrono>
#include <cstdint>
#include <string_view>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/driver/descriptor.hpp"

namespace rtpm::gvd {

/// How the force ends when commands stop.
enum class WatchdogPolicy : std::uint8_t {
  kRamp = 0,  ///< The force falls linearly to zero within SafetyConfig::ramp.
  kHold = 1,  ///< The force stays for SafetyConfig::watchdog_span, then falls as with kRamp.
  /// The device brakes its motion for SafetyConfig::watchdog_span, then the force is off.
  kDamp = 2,
  kOff = 3,  ///< The force is off at once.
};
inline constexpr std::uint8_t kWatchdogPolicyCount = 4;
/// "ramp", "hold", "damp", "off".
[[nodiscard]] std::string_view to_string(WatchdogPolicy policy) noexcept;
/// The policy with this name; kOff for any other name.
[[nodiscard]] WatchdogPolicy watchdog_policy_of(std::string_view name) noexcept;

/// Limits of the safety filter, which can't be turned off as a whole. Where 0 means "no limit",
/// for_device() sets a limit.
/// @ownership a value
struct SafetyConfig {
  double force_newton_max = 0;                         ///< Maximum magnitude; 0 for no force.
  double torque_newton_metre_max = 0;                  ///< Maximum magnitude; 0 for no torque.
  double force_newton_per_s_max = 1000;                ///< Maximum rate of change.
  double torque_newton_metre_per_s_max = 50;           ///< Maximum rate of change.
  Duration hold_max = std::chrono::milliseconds{100};  ///< Maximum life of a command.
  Duration ramp = std::chrono::milliseconds{20};  ///< Time from full force to zero after a loss.
  Duration soft_start = std::chrono::milliseconds{200};  ///< Time from zero to full force.

  WatchdogPolicy watchdog = WatchdogPolicy::kRamp;
  Duration watchdog_span = std::chrono::milliseconds{100};  ///< How long kHold and kDamp last.
  double watchdog_newton_s_per_m = 0;                       ///< The damping of kDamp.

  double power_watt_max = 0;        ///< Maximum power to the user; 0 for no limit.
  double velocity_m_per_s_max = 0;  ///< Above it the force is off until recover(); 0 for no limit.
  driver::Workspace workspace{};    ///< Where the soft wall begins; no wall on an empty axis.
  double wall_newton_per_m = 0;     ///< Stiffness of the wall; 0 without a wall.
  double wall_newton_s_per_m = 0;   ///< Damping of the wall.
  /// The force that the motors withstand permanently; 0 for no limit.
  double force_newton_continuous = 0;
  /// How long the motors withstand force_newton_max.
  Duration heat_time = std::chrono::seconds{30};

  bool has_passivity_guard = false;
  /// Energy that the device may give before it has taken any.
  double passivity_reserve_joule = 0.05;
  double passivity_store_joule = 1;         ///< The most taken energy that is credited.
  double passivity_watt = 0.001;            ///< Power that refills the reserve.
  double passivity_newton_s_per_m_max = 0;  ///< The most damping that the guard adds.

  /// The defaults, with every mechanism on, as far as the device's description allows.
  [[nodiscard]] static SafetyConfig for_device(const driver::Descriptor& device) noexcept;
  /// How long the force may last after its command has ended.
  [[nodiscard]] Duration rest() const noexcept;
  /// Whether every value is valid.
  /// @realtime set-up only
  /// @errors   names a limit that is negative or not finite, or a time that is negative or above 10
  ///           s (heat_time: an hour)
  [[nodiscard]] expected<void, SetupError> check() const;
};

}  // namespace rtpm::gvd
