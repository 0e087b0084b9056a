#pragma once

#include <memory>
#include <string>
#include <string_view>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/driver/driver.hpp"

/// Loads drivers that are built outside RTPM.
namespace rtpm::driver_host {

/// Loads the plug-in in `file` and creates its driver. Calls nothing in the plug-in before its ABI
/// is checked, but loading runs the constructors of its static objects. Exceptions of the plug-in
/// become errors, except in exchange() and deactivate(), which are noexcept. A bare name means a
/// file in the working folder.
/// @param device  the device that the plug-in drives, named in a crash report: "lab/lever"
/// @ownership the driver and its calibrations keep the plug-in loaded
/// @realtime set-up only
/// @errors   no such file, or no shared library; the symbol is missing; another ABI; the plug-in
///           fails or throws; each names the file
[[nodiscard]] expected<std::unique_ptr<driver::Driver>, SetupError> load_plugin(
    const std::string& file, std::string_view arguments, std::string_view device = {});

}  // namespace rtpm::driver_host
