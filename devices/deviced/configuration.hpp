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
  std::string name{};        ///< In options and, behind the folder, at the registry.
  std::string driver{};      ///< One of drivers(), or a plug-in's file.
  std::string arguments{};   ///< For a real device or a plug-in.
  std::string serial{};      ///< A simulated device's; empty: made of its name.
  std::string hand{};        ///< For the arm: a recorded hand; empty: PressingPath.
  bool is_free = false;      ///< For the arm: no hand.
  std::uint64_t seed = 1;    ///< A simulated device's.
  bool is_isolated = false;  ///< Its driver runs in a process of its own.
  double rate_hz = 0;        ///< 0: the driver's.
  Priority priority = 30000;
  std::vector<int> cpus{};
  double force_max_newton = 0;  ///< 0: the device's limit.
  Duration gone_after = gvd::CycleConfig{}.gone_after;
  Duration hold_max = std::chrono::milliseconds{100};
  Duration ramp = std::chrono::milliseconds{20};
  Duration soft_start = std::chrono::milliseconds{200};
  std::string watchdog = "ramp";  ///< As gvd::to_string(WatchdogPolicy).
  double power_max_watt = 0;      ///< Here and below, 0: the default for the device.
  double velocity_max_m_per_s = 0;
  double force_continuous_newton = 0;
  double passivity_watt = 0;
};

/// The options of rtpm-deviced.
struct Configuration {
  bool lists_drivers = false;       ///< Prints them and ends.
  bool probes = false;              ///< Prints the devices at this machine and ends.
  std::string checked{};            ///< A plug-in's file: checks its driver and ends.
  std::string checked_arguments{};  ///< For that driver.
  std::string folder = "lab";
  std::vector<std::string> names{"arm0"};  ///< The devices' names.
  std::vector<DeviceSettings> devices{};   ///< One per name.
  options::ServerSettings settings{};      ///< The server's.
  std::string settings_folder{};           ///< For the devices' parameters; empty: not saved.
  std::string stops_folder{};              ///< For emergency stops; after reading, empty: not kept.
  std::string flight_folder{};             ///< For flight records; empty: not written.
  std::string registry{};
  std::string events{events::kHubPath};  ///< The hub's name or URL.
  bool serves_events = false;            ///< The hub is this program's.
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
