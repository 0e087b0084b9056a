#pragma once

#include <memory>
#include <string>
#include <string_view>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/driver/driver.hpp"

/// Loads drivers that are built outside of RTPM.
namespace rtpm::driver_host {

/// Loads the plug-in in `file` and makes its driver. Nothing of it runs before its ABI is known to
/// be this program's. What it throws outside of exchange() becomes an error.
/// @ownership the driver keeps the plug-in loaded
/// @realtime set-up only
/// @errors   no such file, or no shared library; the symbol is missing; another ABI; the plug-in
///           fails or throws; each names the file
[[nodiscard]] expected<std::unique_ptr<driver::Driver>, SetupError> load_plugin(
    const std::string& file, std::string_view arguments);

}  // namespace rtpm::driver_host
