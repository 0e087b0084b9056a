#pragma once

#include <optional>
#include <string>
#include <vector>

#include "cli/context.hpp"
#include "cli/output.hpp"
#include "rtpm/configuration/client.hpp"

// Formats the parameters of a device for people and programs.
namespace rtpm::tool {

/// A table of all parameters: a header, then one row each.
[[nodiscard]] std::string table_of(const gvd::DeviceConfiguration& configuration);
/// The table as comments in a schema.
[[nodiscard]] std::string as_comment(const gvd::DeviceConfiguration& configuration);
[[nodiscard]] Json json_of(const gvd::DeviceConfiguration& configuration);

/// Lines of "name=value".
[[nodiscard]] std::string lines_of(const std::vector<driver::ParameterSetting>& settings);
/// {"name": value, …}.
[[nodiscard]] Json json_of(const std::vector<driver::ParameterSetting>& settings);

/// @errors   those of ConfigurationClient::open()
[[nodiscard]] expected<gvd::ConfigurationClient, SetupError> open_configuration(
    Context& context, const std::string& device);

/// The configuration of the object at `url`; nullopt if it has none.
/// @errors   the server's configuration does not answer
[[nodiscard]] expected<std::optional<gvd::DeviceConfiguration>, SetupError> configuration_of(
    Context& context, const std::string& url);

}  // namespace rtpm::tool
