#pragma once

#include <string>

namespace rtpm::deviced {

/// Runs all of driver_host::driver_checks() on the plug-in in `file`, in real time, and prints each
/// check with its violations. Ends the program if the driver does not return.
/// @return the exit code: 0 if every check passes, 1 if not or if there is no driver
[[nodiscard]] int check_plugin(const std::string& file, const std::string& arguments);

}  // namespace rtpm::deviced
