#pragma once

#include <memory>
#include <string>
#include <string_view>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/driver/driver.hpp"

/// Loads drivers that are built outside of RTPM.
namespace rtpm::driver_host {

/// Loads the plug-in in `file` and makes its driver. Nothing of it is called before its ABI is
/// known to be this program's; constructors of its static objects run on loading. Its exceptions
/// become errors, except in exchange() and deactivate(), which are noexcept. A bare name is a file
/// of the working folder.
/// @param device  the device that it is loaded for, which a crash report names: "lab/lever"
/// @ownership the driver and its calibrations keep the plug-in loaded
/// @realtime set-up only
/// @errors   no such file, or no shared library; the symbol is missing; another ABI; the plug-in
///           fails or throws; each names the file
[[nodiscard]] expected<std::unique_ptr<driver::Driver>, SetupError> load_plugin(
    const std::string& file, std::string_view arguments, std::string_view device = {});

}  // namespace rtpm::driver_host
