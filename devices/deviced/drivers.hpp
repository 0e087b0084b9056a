#pragma once

#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "configuration.hpp"
#include "rtpm/base/setup_error.hpp"
#include "rtpm/device_io/found_device.hpp"
#include "rtpm/driver/driver.hpp"

namespace rtpm::deviced {

/// A built-in driver, which needs no plug-in.
struct DriverInfo {
  const char* name;     ///< The value of --device-NAME-driver.
  const char* devices;  ///< The supported devices, as text for users.
  /// Null if this build lacks the driver because `package` was not installed.
  expected<std::unique_ptr<driver::Driver>, SetupError> (*make)(const DeviceSettings&);
  std::vector<device_io::FoundDevice> (*probe)();  ///< Null if the driver has no hardware to probe.
  const char* package;  ///< The Debian package required to build it; may be empty.
};

/// All drivers, including those that this build lacks.
[[nodiscard]] std::span<const DriverInfo> drivers();

/// The names of all drivers, comma-separated.
[[nodiscard]] std::string driver_names();

/// Whether a driver with this name exists.
[[nodiscard]] bool is_driver(std::string_view name);

/// Creates the driver that the settings name, which may be a plug-in.
/// @param name  the device's registry name, for messages about a crash in a plug-in
/// @realtime set-up only
/// @errors   unknown driver; not in this build; wrong arguments; a damaged recording; those of
///           driver_host::load_plugin()
[[nodiscard]] expected<std::unique_ptr<driver::Driver>, SetupError> make_driver(
    const DeviceSettings& device, std::string_view name = {});

}  // namespace rtpm::deviced
