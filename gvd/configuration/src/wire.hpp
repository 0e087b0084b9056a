#pragma once

#include <configuration.rtpm.hpp>
#include <memory>
#include <string>
#include <vector>

#include "rtpm/configuration/calibration_status.hpp"
#include "rtpm/configuration/error.hpp"
#include "rtpm/driver/parameter.hpp"

/// Converts between driver types and schema types.
/// @realtime set-up only
namespace rtpm::gvd {

using WireSettings = std::vector<std::unique_ptr<configuration::SettingT>>;

[[nodiscard]] std::unique_ptr<configuration::ValueT> to_wire(const driver::ParameterValue& value);
/// An unknown type reads as an empty vector, which no parameter accepts.
[[nodiscard]] driver::ParameterValue from_wire(const configuration::ValueT& wire);

[[nodiscard]] WireSettings to_wire(const std::vector<driver::ParameterSetting>& settings);
[[nodiscard]] std::vector<driver::ParameterSetting> from_wire(const WireSettings& wire);

[[nodiscard]] std::unique_ptr<configuration::ParameterT> to_wire(
    const driver::ParameterSpec& spec, const driver::ParameterValue& value);
/// An unknown type reads as kText, an unknown mutability as kReadOnly.
[[nodiscard]] driver::ParameterSpec spec_from_wire(const configuration::ParameterT& wire);

/// The answer to a request; `error` is null on success.
[[nodiscard]] std::unique_ptr<configuration::AnswerT> to_wire(const ConfigurationError* error);
/// An unknown outcome reads as kCallFailed.
[[nodiscard]] ConfigurationError from_wire(const configuration::AnswerT& wire);

[[nodiscard]] configuration::CalibrationReplyT to_wire(const CalibrationStatus& status);
/// An unknown phase reads as kFailed.
[[nodiscard]] CalibrationStatus from_wire(const configuration::CalibrationReplyT& wire);

}  // namespace rtpm::gvd
