#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "rtpm/base/priority.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/events/defaults.hpp"
#include "rtpm/gvd/device.hpp"
#include "rtpm/options/options.hpp"
#include "rtpm/options/server_options.hpp"

namespace rtpm::deviced {

/// The options of one hosted device.
struct DeviceSettings {
  std::string name{};       ///< The name in options; also the last component of the registry name.
  std::string driver{};     ///< One of drivers(), or the file of a plug-in.
  std::string arguments{};  ///< Passed to a real device's driver or a plug-in.
  std::string serial{};  ///< Serial number of a simulated device; by default derived from its name.
  std::string hand{};  ///< File with the recorded hand of the arm; if empty, PressingPath is used.
  bool is_free = false;      ///< The simulated arm moves without a hand.
  std::uint64_t seed = 1;    ///< Random seed of a simulated device.
  bool is_isolated = false;  ///< Runs the driver in a separate process.
  double rate_hz = 0;        ///< If 0, the driver's default rate.
  Priority priority = 30000;
  std::vector<int> cpus{};
  double force_max_newton = 0;  ///< If 0, the device's limit.
  Duration gone_after = gvd::CycleConfig{}.gone_after;
  Duration hold_max = std::chrono::milliseconds{100};
  Duration ramp = std::chrono::milliseconds{20};
  Duration soft_start = std::chrono::milliseconds{200};
  std::string watchdog = "ramp";  ///< The text of a policy, see gvd::to_string(WatchdogPolicy).
  double power_max_watt = 0;  ///< If 0, the device's default; the same holds for the members below.
  double velocity_max_m_per_s = 0;
  double force_continuous_newton = 0;
  double passivity_watt = 0;
};

/// The options of rtpm-deviced.
struct Configuration {
  bool lists_drivers = false;       ///< Prints the drivers and exits.
  bool probes = false;              ///< Prints the devices found on this machine and exits.
  std::string checked{};            ///< The file of a plug-in: checks its driver and exits.
  std::string checked_arguments{};  ///< The arguments for that driver.
  std::string folder = "lab";
  std::vector<std::string> names{};  ///< The names of the devices, in the order of configuration.
  std::vector<DeviceSettings> devices{};  ///< One entry per element of `names`.
  options::ServerSettings settings{};     ///< The options of the server.
  /// Folder for the devices' saved parameters; empty if they are not saved.
  std::string settings_folder{};
  /// Folder for saved emergency stops. After read_configuration(), empty if they are not saved.
  std::string stops_folder{};
  std::string flight_folder{};  ///< Folder for flight records; empty if none are written.
  std::string registry{};
  std::string events{events::kHubPath};  ///< The hub's name or URL.
  bool serves_events = false;            ///< This program hosts the hub.
  bool allows_takeover = false;          ///< Takes its registry names over from a running server.
  gvd::LeaseConfig lease{};
  Priority operator_priority = gvd::CycleConfig{}.operator_priority;

  /// The name in the registry.
  [[nodiscard]] std::string name_of(const DeviceSettings& device) const {
    return folder.empty() ? device.name : folder + "/" + device.name;
  }
};

/// The value of `stops_folder` that means: an emergency stop ends when this program ends.
inline constexpr const char* kNoStops = "none";
/// The value of `events` that means: push no events.
inline constexpr const char* kNoHub = "none";
/// The registry URL that means: serve without a registry.
inline constexpr const char* kNoRegistry = "none";

/// Reads file, environment and flags into `configuration`, like options::Options::parse().
[[nodiscard]] std::optional<int> read_configuration(int argc, const char* const* argv,
                                                    Configuration& configuration);

}  // namespace rtpm::deviced
