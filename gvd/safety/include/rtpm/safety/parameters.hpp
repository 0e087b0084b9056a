#pragma once

#include <span>
#include <string_view>
#include <vector>

#include "rtpm/driver/parameter.hpp"
#include "rtpm/safety/config.hpp"

namespace rtpm::gvd {

/// The group of the device server's own parameters; a driver has none in it.
inline constexpr std::string_view kSafetyGroup = "safety.";

/// The limits of the safety filter as parameters, with `configured` as defaults. A client makes a
/// device safer than its server was started, never less safe.
/// @realtime set-up only
[[nodiscard]] std::vector<driver::ParameterSpec> safety_parameters(const SafetyConfig& configured);

/// `config` with those of `settings` that are safety_parameters(); each is of its type.
/// @realtime set-up only
[[nodiscard]] SafetyConfig with_settings(SafetyConfig config,
                                         std::span<const driver::ParameterSetting> settings);

}  // namespace rtpm::gvd
