#include "safety_parameters.hpp"

#include <algorithm>
#include <array>
#include <string>
#include <variant>

namespace rtpm::gvd {
namespace {

constexpr double kTimeMaxSeconds = 10;

/// Whether a client may lower a value or raise it.
enum class Safer : std::uint8_t { kLower, kHigher };

struct Limit {
  const char* name;
  const char* unit;
  const char* description;
  double SafetyConfig::*value;
  /// Share of the configured value that the limit keeps at least: a force that could not change
  /// could not fall either.
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
    Time{"soft_start_s", "Time from zero to full force.", &SafetyConfig::soft_start,
         Safer::kHigher},
};

double seconds(Duration duration) noexcept {
  return std::chrono::duration<double>(duration).count();
}

driver::ParameterSpec spec_of(const char* name, const char* unit, double configured,
                              const char* description) {
  driver::ParameterSpec spec;
  spec.name = std::string(kSafetyGroup) + name;
  spec.unit = unit;
  spec.default_value = configured;
  spec.description = description;
  return spec;
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
  return config;
}

}  // namespace rtpm::gvd
