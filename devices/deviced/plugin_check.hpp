#pragma once

#include <string>

namespace rtpm::deviced {

/// Runs every check of driver_host::driver_checks() on the plug-in in `file`, in real time, and
/// prints each with its breaches. Ends the program if the driver does not return.
/// @return the exit code: 0 if all promises are kept, 1 if not, or if there is no driver
[[nodiscard]] int check_plugin(const std::string& file, const std::string& arguments);

}  // namespace rtpm::deviced
