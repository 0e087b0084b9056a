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

/// A driver that this program has without a plug-in.
struct DriverInfo {
  const char* name;     ///< The value of --device-NAME-driver.
  const char* devices;  ///< The devices it serves, for people.
  /// Null if this build was made without `package`, and so without the driver.
  expected<std::unique_ptr<driver::Driver>, SetupError> (*make)(const DeviceSettings&);
  std::vector<device_io::FoundDevice> (*probe)();  ///< Null if it has no hardware to probe.
  const char* package;  ///< The Debian package that its build needs; may be empty.
};

/// All drivers, also those left out of this build.
[[nodiscard]] std::span<const DriverInfo> drivers();

/// Their names, comma-separated.
[[nodiscard]] std::string driver_names();

/// Whether a driver has this name.
[[nodiscard]] bool is_driver(std::string_view name);

/// Makes the driver that the settings name, or a plug-in's.
/// @param name  the device's at the registry, for a crash in a plug-in
/// @realtime set-up only
/// @errors   no such driver; left out of this build; wrong arguments; a broken recording; as
///           driver_host::load_plugin()
[[nodiscard]] expected<std::unique_ptr<driver::Driver>, SetupError> make_driver(
    const DeviceSettings& device, std::string_view name = {});

}  // namespace rtpm::deviced
