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
  std::string name{};        ///< Its name in options and, after the folder, at the registry.
  std::string driver{};      ///< One of drivers(), or a plug-in's file.
  std::string arguments{};   ///< Passed to a real device's driver or a plug-in.
  std::string serial{};      ///< A simulated device's; by default made of its name.
  std::string hand{};        ///< File of the arm's recorded hand; empty for PressingPath.
  bool is_free = false;      ///< No hand holds the arm.
  std::uint64_t seed = 1;    ///< The seed of a simulated device.
  bool is_isolated = false;  ///< Its driver runs in a process of its own.
  double rate_hz = 0;        ///< 0 for the driver's own rate.
  Priority priority = 30000;
  std::vector<int> cpus{};
  double force_max_newton = 0;  ///< 0 for the device's limit.
  Duration gone_after = gvd::CycleConfig{}.gone_after;
  Duration hold_max = std::chrono::milliseconds{100};
  Duration ramp = std::chrono::milliseconds{20};
  Duration soft_start = std::chrono::milliseconds{200};
  std::string watchdog = "ramp";  ///< A word of gvd::to_string(WatchdogPolicy).
  double power_max_watt = 0;      ///< Here and below, 0 for the device's default.
  double velocity_max_m_per_s = 0;
  double force_continuous_newton = 0;
  double passivity_watt = 0;
};

/// The options of rtpm-deviced.
struct Configuration {
  bool lists_drivers = false;       ///< Prints the drivers and ends.
  bool probes = false;              ///< Prints the devices at this machine and ends.
  std::string checked{};            ///< A plug-in's file: checks its driver and ends.
  std::string checked_arguments{};  ///< Passed to that driver.
  std::string folder = "lab";
  std::vector<std::string> names{};        ///< The devices' names, as configured.
  std::vector<DeviceSettings> devices{};   ///< One entry per name.
  options::ServerSettings settings{};      ///< The options of the server.
  std::string settings_folder{};           ///< Keeps the devices' parameters; empty if not saved.
  std::string stops_folder{};              ///< Keeps emergency stops; once read, empty if not kept.
  std::string flight_folder{};             ///< Takes flight records; empty if they are not written.
  std::string registry{};
  std::string events{events::kHubPath};  ///< The hub's name or URL.
  bool serves_events = false;            ///< This program runs the hub.
  bool allows_takeover = false;          ///< Takes its names over from a live server.
  gvd::LeaseConfig lease{};
  Priority operator_priority = gvd::CycleConfig{}.operator_priority;

  /// The name at the registry.
  [[nodiscard]] std::string name_of(const DeviceSettings& device) const {
    return folder.empty() ? device.name : folder + "/" + device.name;
  }
};

/// The folder that stands for "an emergency stop ends with this program".
inline constexpr const char* kNoStops = "none";
/// The hub that stands for "push no events".
inline constexpr const char* kNoHub = "none";
/// The registry's URL that stands for "serve without a registry".
inline constexpr const char* kNoRegistry = "none";

/// Reads file, environment and flags into `configuration`; as options::Options::parse().
[[nodiscard]] std::optional<int> read_configuration(int argc, const char* const* argv,
                                                    Configuration& configuration);

}  // namespace rtpm::deviced
