#include "rtpm/safety/config.hpp"

#include <array>
#include <cmath>
#include <string>

#include "vector.hpp"

namespace rtpm::gvd {
namespace {

constexpr Duration kTimeMax = std::chrono::seconds{10};
constexpr Duration kHeatTimeMax = std::chrono::hours{1};

// Factors that derive defaults from a device's description.
constexpr double kSpeedOfFullForce = 1;   ///< In m/s: full force at this speed is full power.
constexpr double kVelocityMax = 5;        ///< In m/s; faster than a hand moves a device.
constexpr double kWallShare = 0.25;       ///< Share of the maximum passive stiffness.
constexpr double kContinuousShare = 0.6;  ///< Share of the maximum force.
constexpr double kGuardShare = 3;         ///< Multiple of the mechanics' own damping.
constexpr double kGuardNewtonSPerM = 5;   ///< Used if the mechanics' damping is unknown.

expected<void, SetupError> check_limits(const SafetyConfig& config) {
  struct Limit {
    const char* name;
    double value;
  };
  const std::array limits{
      Limit{"force_newton_max", config.force_newton_max},
      Limit{"torque_newton_metre_max", config.torque_newton_metre_max},
      Limit{"force_newton_per_s_max", config.force_newton_per_s_max},
      Limit{"torque_newton_metre_per_s_max", config.torque_newton_metre_per_s_max},
      Limit{"watchdog_newton_s_per_m", config.watchdog_newton_s_per_m},
      Limit{"power_watt_max", config.power_watt_max},
      Limit{"velocity_m_per_s_max", config.velocity_m_per_s_max},
      Limit{"wall_newton_per_m", config.wall_newton_per_m},
      Limit{"wall_newton_s_per_m", config.wall_newton_s_per_m},
      Limit{"force_newton_continuous", config.force_newton_continuous},
      Limit{"passivity_reserve_joule", config.passivity_reserve_joule},
      Limit{"passivity_store_joule", config.passivity_store_joule},
      Limit{"passivity_watt", config.passivity_watt},
      Limit{"passivity_newton_s_per_m_max", config.passivity_newton_s_per_m_max}};
  for (const Limit& limit : limits) {
    if (std::isfinite(limit.value) && limit.value >= 0) continue;
    return setup_error(
        std::string("the safety limit ") + limit.name + " is " + std::to_string(limit.value), "",
        "choose a number, zero or above");
  }
  return {};
}

expected<void, SetupError> check_times(const SafetyConfig& config) {
  struct Time {
    const char* name;
    Duration value;
    Duration high;
  };
  const std::array times{Time{"hold_max", config.hold_max, kTimeMax},
                         Time{"ramp", config.ramp, kTimeMax},
                         Time{"soft_start", config.soft_start, kTimeMax},
                         Time{"watchdog_span", config.watchdog_span, kTimeMax},
                         Time{"heat_time", config.heat_time, kHeatTimeMax}};
  for (const Time& time : times) {
    if (time.value >= Duration{0} && time.value <= time.high) continue;
    return setup_error(std::string("the safety time ") + time.name + " is " +
                           std::to_string(seconds(time.value)) + " s",
                       "",
                       "choose 0 to " + std::to_string(time.high / std::chrono::seconds{1}) + " s");
  }
  return {};
}

}  // namespace

std::string_view to_string(WatchdogPolicy policy) noexcept {
  switch (policy) {
    case WatchdogPolicy::kRamp:
      return "ramp";
    case WatchdogPolicy::kHold:
      return "hold";
    case WatchdogPolicy::kDamp:
      return "damp";
    case WatchdogPolicy::kOff:
      break;
  }
  return "off";
}

WatchdogPolicy watchdog_policy_of(std::string_view name) noexcept {
  for (const WatchdogPolicy policy :
       {WatchdogPolicy::kRamp, WatchdogPolicy::kHold, WatchdogPolicy::kDamp}) {
    if (to_string(policy) == name) return policy;
  }
  return WatchdogPolicy::kOff;
}

SafetyConfig SafetyConfig::for_device(const driver::Descriptor& device) noexcept {
  const driver::Limits& limits = device.limits;
  const double own_damping = limits.damping_newton_s_per_m;
  SafetyConfig config;
  config.force_newton_max = limits.force_newton_max;
  config.torque_newton_metre_max = limits.torque_newton_metre_max;
  config.watchdog_newton_s_per_m = own_damping;
  config.power_watt_max = limits.force_newton_max * kSpeedOfFullForce;
  config.velocity_m_per_s_max = kVelocityMax;
  config.workspace = device.workspace;
  config.wall_newton_per_m = kWallShare * limits.stiffness_newton_per_m_max;
  config.wall_newton_s_per_m = own_damping;
  config.force_newton_continuous = kContinuousShare * limits.force_newton_max;
  config.has_passivity_guard = true;
  const driver::Vector3 extent = difference(device.workspace.high_m, device.workspace.low_m);
  config.passivity_store_joule = limits.force_newton_max * length(extent);
  config.passivity_newton_s_per_m_max =
      own_damping > 0 ? kGuardShare * own_damping : kGuardNewtonSPerM;
  return config;
}

Duration SafetyConfig::rest() const noexcept {
  switch (watchdog) {
    case WatchdogPolicy::kRamp:
      return ramp;
    case WatchdogPolicy::kHold:
      return watchdog_span + ramp;
    case WatchdogPolicy::kDamp:
      return watchdog_span;
    case WatchdogPolicy::kOff:
      break;
  }
  return Duration{0};
}

expected<void, SetupError> SafetyConfig::check() const {
  if (auto checked = check_limits(*this); !checked) return checked;
  if (auto checked = check_times(*this); !checked) return checked;
  if (static_cast<std::uint8_t>(watchdog) < kWatchdogPolicyCount) return {};
  return setup_error("the watchdog's policy does not exist", "", "choose ramp, hold, damp or off");
}

}  // namespace rtpm::gvd
