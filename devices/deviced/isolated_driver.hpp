#pragma once

#include <optional>
#include <string>
#include <vector>

#include "configuration.hpp"
#include "rtpm/rt/thread.hpp"

/// Runs a device's driver in a separate process with this same program.
namespace rtpm::deviced {

/// The command line of the process that runs `device`'s driver.
/// @param name    the device's registry name, for messages
/// @param thread  the thread that calls the driver in that process
[[nodiscard]] std::vector<std::string> isolated_command(const DeviceSettings& device,
                                                        const std::string& name,
                                                        const rt::ThreadConfig& thread);

/// The parsed arguments of isolated_command().
/// @ownership a value
struct IsolatedDriver {
  DeviceSettings device{};
  std::string name{};
  rt::ThreadConfig thread{};
};
/// Parses the arguments; nullopt if they are not from isolated_command().
[[nodiscard]] std::optional<IsolatedDriver> read_isolated_command(int argc,
                                                                  const char* const* argv);

/// Runs the driver that the arguments name, until the parent process ends it. Returns nullopt if
/// the arguments are not such a command.
/// @return the exit code
[[nodiscard]] std::optional<int> serve_isolated(int argc, const char* const* argv);

}  // namespace rtpm::deviced
