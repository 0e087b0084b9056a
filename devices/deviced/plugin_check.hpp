#pragma once

#include <string>

namespace rtpm::deviced {

/// Runs every check of driver_host::driver_checks() on the plug-in in `file`, in real time, and
/// prints each with its breaches. Ends the program if the driver does not return.
/// @return the exit code: 0 all promises are kept, 1 not all, or there is no driver
[[nodiscard]] int check_plugin(const std::string& file, const std::string& arguments);

}  // namespace rtpm::deviced
