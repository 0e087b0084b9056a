#pragma once

#include <span>
#include <string_view>
#include <vector>

#include "rtpm/driver/parameter.hpp"
#include "rtpm/safety/config.hpp"

namespace rtpm::gvd {

/// The group of the device server's own parameters; drivers must not use it.
inline constexpr std::string_view kSafetyGroup = "safety.";

/// The limits of the safety filter as parameters, with `configured` as defaults. A client can make
/// a device safer than its server's configuration, never less safe.
/// @realtime set-up only
[[nodiscard]] std::vector<driver::ParameterSpec> safety_parameters(const SafetyConfig& configured);

/// Applies those of `settings` that are safety_parameters() to `config`. Each has the right type.
/// @realtime set-up only
[[nodiscard]] SafetyConfig with_settings(SafetyConfig config,
                                         std::span<const driver::ParameterSetting> settings);

}  // namespace rtpm::gvd
