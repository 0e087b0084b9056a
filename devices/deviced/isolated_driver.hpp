#pragma once

#include <optional>
#include <string>
#include <vector>

#include "configuration.hpp"
#include "rtpm/rt/thread.hpp"

/// A device's driver in a process of its own, which runs this same program.
namespace rtpm::deviced {

/// The command of the process for `device`'s driver.
/// @param name    the device's at the registry, for its messages
/// @param thread  the thread that calls the driver there
[[nodiscard]] std::vector<std::string> isolated_command(const DeviceSettings& device,
                                                        const std::string& name,
                                                        const rt::ThreadConfig& thread);

/// The contents of isolated_command().
/// @ownership a value
struct IsolatedDriver {
  DeviceSettings device{};
  std::string name{};
  rt::ThreadConfig thread{};
};
/// Reads the arguments; nullopt if they are not an isolated_command().
[[nodiscard]] std::optional<IsolatedDriver> read_isolated_command(int argc,
                                                                  const char* const* argv);

/// Runs the driver that the arguments name, until the process that started this one ends it.
/// Returns nullopt if the arguments are not such a command.
/// @return the exit code
[[nodiscard]] std::optional<int> serve_isolated(int argc, const char* const* argv);

}  // namespace rtpm::deviced
