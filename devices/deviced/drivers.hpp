#pragma once

#include <memory>
#include <string>
#include <vector>

#include "configuration.hpp"
#include "rtpm/base/setup_error.hpp"
#include "rtpm/driver/driver.hpp"

namespace rtpm::deviced {

/// The names of the simulated drivers: "arm", …; the first is the default.
[[nodiscard]] const std::vector<std::string>& simulated_drivers();

/// Makes the driver that the settings name: a simulated one, or a plug-in's.
/// @realtime set-up only
/// @errors   no such driver; a broken recording; as driver_host::load_plugin()
[[nodiscard]] expected<std::unique_ptr<driver::Driver>, SetupError> make_driver(
    const DeviceSettings& device);

}  // namespace rtpm::deviced
