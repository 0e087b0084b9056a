#include "rtpm/safety/parameters.hpp"

#include <algorithm>
#include <array>
#include <string>
#include <variant>

#include "vector.hpp"

namespace rtpm::gvd {
namespace {

constexpr double kTimeMaxSeconds = 10;
constexpr const char* kWatchdog = "watchdog";
constexpr const char* kLowCorner = "workspace_low_m";
constexpr const char* kHighCorner = "workspace_high_m";

/// Whether lowering or raising a value is safer, and so allowed to clients.
enum class Safer : std::uint8_t { kLower, kHigher };

struct Limit {
  const char* name;
  const char* unit;
  const char* description;
  double SafetyConfig::*value;
  /// The minimum share of the configured value: with a rate limit of zero, the force could not fall
  /// either.
  double share_min;
};
constexpr std::array kLimits{
    Limit{"force_newton_max", "N", "Greatest force.", &SafetyConfig::force_newton_max, 0},
    Limit{"torque_newton_metre_max", "N m", "Greatest torque.",
          &SafetyConfig::torque_newton_metre_max, 0},
    Limit{"force_newton_per_s_max", "N/s", "Greatest rate of change of the force.",
          &SafetyConfig::force_newton_per_s_max, 0.1},
    Limit{"torque_newton_metre_per_s_max", "N m/s", "Greatest rate of change of the torque.",
          &SafetyConfig::torque_newton_metre_per_s_max, 0.1},
    Limit{"power_watt_max", "W", "Greatest power that the force gives.",
          &SafetyConfig::power_watt_max, 0.01},
    Limit{"velocity_m_per_s_max", "m/s", "Faster motion takes the force away until recovery.",
          &SafetyConfig::velocity_m_per_s_max, 0.01},
    Limit{"force_newton_continuous", "N", "Force that the motors can apply without end.",
          &SafetyConfig::force_newton_continuous, 0.1},
    Limit{"passivity_watt", "W", "Power that the passivity guard lets through for ever.",
          &SafetyConfig::passivity_watt, 0},
    Limit{"passivity_reserve_joule", "J", "Energy that may be given before it was taken.",
          &SafetyConfig::passivity_reserve_joule, 0},
};

struct Time {
  const char* name;
  const char* description;
  Duration SafetyConfig::*value;
  Safer safer;
};
constexpr std::array kTimes{
    Time{"hold_max_s", "Longest life of a command.", &SafetyConfig::hold_max, Safer::kLower},
    Time{"ramp_s", "Time from full force to zero when commands stop.", &SafetyConfig::ramp,
         Safer::kLower},
    Time{"heat_time_s", "Time that the motors endure the greatest force.", &SafetyConfig::heat_time,
         Safer::kLower},
    Time{"soft_start_s", "Time from zero to full force.", &SafetyConfig::soft_start,
         Safer::kHigher},
};

driver::ParameterSpec spec_of(const char* name, const char* unit, double configured,
                              const char* description) {
  driver::ParameterSpec spec;
  spec.name = std::string(kSafetyGroup) + name;
  spec.unit = unit;
  spec.default_value = configured;
  spec.description = description;
  return spec;
}

/// Allows only the configured policy, or "off": any other policy might prolong the force.
driver::ParameterSpec watchdog_spec(const SafetyConfig& configured) {
  driver::ParameterSpec spec;
  spec.name = std::string(kSafetyGroup) + kWatchdog;
  spec.type = driver::ParameterType::kChoice;
  spec.choices = {std::string(to_string(configured.watchdog))};
  if (configured.watchdog != WatchdogPolicy::kOff) spec.choices.emplace_back("off");
  spec.default_value = spec.choices.front();
  spec.description = "What happens to the force when commands stop.";
  return spec;
}

/// A corner of the workspace, which a client may shrink. The range is the same for all axes: from
/// the lowest to the highest coordinate of the configured workspace.
driver::ParameterSpec corner_spec(const char* name, const SafetyConfig& configured,
                                  const driver::Vector3& corner) {
  const driver::Vector3& low_m = configured.workspace.low_m;
  const driver::Vector3& high_m = configured.workspace.high_m;
  driver::ParameterSpec spec;
  spec.name = std::string(kSafetyGroup) + name;
  spec.type = driver::ParameterType::kVector;
  spec.unit = "m";
  spec.vector_size = 3;
  spec.low = std::min({low_m.x, low_m.y, low_m.z, 0.0});
  spec.high = std::max({high_m.x, high_m.y, high_m.z, 0.0});
  spec.default_value = std::vector<double>{corner.x, corner.y, corner.z};
  spec.description = "Corner of the box behind which the soft wall pushes back.";
  return spec;
}

driver::Vector3 vector_of(const driver::ParameterSetting& setting) {
  const auto& elements = std::get<std::vector<double>>(setting.value);
  return {elements[0], elements[1], elements[2]};
}

const driver::ParameterSetting* find(std::span<const driver::ParameterSetting> settings,
                                     const char* name) {
  const auto found = std::ranges::find(settings, std::string(kSafetyGroup) + name,
                                       &driver::ParameterSetting::name);
  return found == settings.end() ? nullptr : &*found;
}

}  // namespace

std::vector<driver::ParameterSpec> safety_parameters(const SafetyConfig& configured) {
  std::vector<driver::ParameterSpec> specs;
  for (const Limit& limit : kLimits) {
    const double high = configured.*limit.value;
    auto& spec = specs.emplace_back(spec_of(limit.name, limit.unit, high, limit.description));
    spec.low = limit.share_min * high;
    spec.high = high;
  }
  for (const Time& time : kTimes) {
    const double value = seconds(configured.*time.value);
    auto& spec = specs.emplace_back(spec_of(time.name, "s", value, time.description));
    spec.low = time.safer == Safer::kLower ? 0 : value;
    spec.high = time.safer == Safer::kLower ? value : kTimeMaxSeconds;
  }
  specs.push_back(watchdog_spec(configured));
  specs.push_back(corner_spec(kLowCorner, configured, configured.workspace.low_m));
  specs.push_back(corner_spec(kHighCorner, configured, configured.workspace.high_m));
  return specs;
}

SafetyConfig with_settings(SafetyConfig config,
                           std::span<const driver::ParameterSetting> settings) {
  for (const Limit& limit : kLimits) {
    const auto* const setting = find(settings, limit.name);
    if (setting != nullptr) config.*limit.value = std::get<double>(setting->value);
  }
  for (const Time& time : kTimes) {
    const auto* const setting = find(settings, time.name);
    if (setting == nullptr) continue;
    const std::chrono::duration<double> value{std::get<double>(setting->value)};
    config.*time.value = std::chrono::round<Duration>(value);
  }
  if (const auto* const setting = find(settings, kWatchdog)) {
    config.watchdog = watchdog_policy_of(std::get<std::string>(setting->value));
  }
  if (const auto* const setting = find(settings, kLowCorner)) {
    config.workspace.low_m = vector_of(*setting);
  }
  if (const auto* const setting = find(settings, kHighCorner)) {
    config.workspace.high_m = vector_of(*setting);
  }
  return config;
}

}  // namespace rtpm::gvd
