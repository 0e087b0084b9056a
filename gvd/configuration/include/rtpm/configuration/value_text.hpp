#pragma once

#include <string>
#include <string_view>

#include "rtpm/base/expected.hpp"
#include "rtpm/configuration/error.hpp"
#include "rtpm/driver/parameter.hpp"

namespace rtpm::gvd {

/// A value as people type it: "true", "12", "0.05", "fast", "1,0,-2.5". parse_value() reads it back
/// exactly.
/// @realtime set-up only
[[nodiscard]] std::string to_text(const driver::ParameterValue& value);

/// Reads a value of `spec`'s type, without checking its range.
/// @realtime set-up only
/// @errors   kWrongType
[[nodiscard]] expected<driver::ParameterValue, ConfigurationError> parse_value(
    const driver::ParameterSpec& spec, std::string_view text);

/// The values that `spec` accepts: "0 to 9", "at least 0", "slow | fast",
/// "3 of -1 to 1". Empty if it accepts any value of its type.
/// @realtime set-up only
[[nodiscard]] std::string range_text(const driver::ParameterSpec& spec);

}  // namespace rtpm::gvd
