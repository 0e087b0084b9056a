#include "configuration.hpp"

#include <algorithm>
#include <vector>

#include "drivers.hpp"
#include "flight_format.hpp"
#include "rtpm/names/defaults.hpp"
#include "rtpm/program/state_folder.hpp"
#include "rtpm/rt/log.hpp"

namespace rtpm::deviced {
namespace {

/// The size limit of one component of a registry name.
constexpr std::size_t kDeviceNameSizeMax = 64;

/// Returns "arm" for "arm0" if a driver has that name; otherwise an empty string.
std::string driver_named_like(const std::string& name) {
  const std::string word = name.substr(0, name.find_last_not_of("0123456789") + 1);
  return is_driver(word) ? word : "";
}

void add_device(options::Options options, DeviceSettings& device) {
  options.add("driver", device.driver,
              "One of --list-drivers, or the file of a plug-in; not needed where the name is a "
              "driver's and digits");
  options.add("arguments", device.arguments,
              "real devices, plug-ins: what the driver is told, in its own words");
  options.add("serial", device.serial, "simulated: its serial number; empty: made of its name");
  options.add("seed", device.seed, "simulated: fixes whatever looks random");
  options.add("hand", device.hand,
              "arm: a recorded hand, a CSV file of t_s,x_m,y_m,z_m, played there and back");
  options.add("free", device.is_free, "arm: no hand holds it");
  options.add("isolated", device.is_isolated,
              "Run the driver in a process of its own: its crash or hang costs this device only");
  options.add("rate", device.rate_hz, "Cycles per second, in Hz; 0: the driver's own", {0, 50000});
  options.add("priority", device.priority, "Of its own thread, above every caller's");
  options.add("cpus", device.cpus, "The CPUs its thread may run on; none: all");
  constexpr options::Range<Duration> kUpTo10s{Duration{0}, std::chrono::seconds{10}};
  options.add("force-max", device.force_max_newton,
              "Greatest force in newton; 0: all that the device gives", {0, 1000});
  options.add("gone-after", device.gone_after,
              "How long its data may be late or unreadable before it counts as gone",
              {std::chrono::milliseconds{1}, std::chrono::seconds{60}});
  options.add("hold-max", device.hold_max, "Longest life of one command", kUpTo10s);
  options.add("ramp", device.ramp, "From full force to none when commands stop", kUpTo10s);
  options.add("soft-start", device.soft_start, "From none to full force", kUpTo10s);
  options.add_choice("watchdog", device.watchdog, {"ramp", "hold", "damp", "off"},
                     "What happens to the force when commands stop");
  options.add("power-max", device.power_max_watt,
              "Greatest power that the force gives, in watt; 0: full force at 1 m/s", {0, 1e6});
  options.add("velocity-max", device.velocity_max_m_per_s,
              "Faster motion takes the force away, in m/s; 0: 5 m/s", {0, 1000});
  options.add("force-continuous", device.force_continuous_newton,
              "Force that the motors can apply without end, in newton; 0: 0.6 of the greatest",
              {0, 1000});
  options.add("passivity-watt", device.passivity_watt,
              "Power that the passivity guard lets through for ever; 0: 0.001 W", {0, 1000});
}

void add_devices(options::Options& options, Configuration& configuration) {
  options.add("list-drivers", configuration.lists_drivers, "List the drivers, and end");
  options.add("probe", configuration.probes,
              "List the devices at this machine, with the driver and the rights of each, and end");
  options.add(
      "check", configuration.checked,
      "Check the plug-in in this file against what is promised of every driver, and end; it "
      "commands the greatest forces, so hands off the device");
  options.rare().add("check-arguments", configuration.checked_arguments,
                     "What the checked driver is told, in its own words");
  options.add("folder", configuration.folder, "The devices' names at the registry are FOLDER/NAME");
  options.add_group(
      "devices", "device", configuration.names,
      "The names of the devices, each with options --device-NAME-… or in "
      "[device.NAME]; without: arm0",
      kDeviceNameSizeMax, [&options, &configuration](const std::vector<std::string>& configured) {
        const auto names = configured.empty() ? std::vector{std::string("arm0")} : configured;
        for (const std::string& name : names) {
          DeviceSettings device;
          device.name = name;
          device.driver = driver_named_like(name);
          configuration.devices.push_back(device);
        }
        for (DeviceSettings& device : configuration.devices)
          add_device(options.of_member("device", device.name), device);
      });
}

/// Two lanes: one for the periodic calls of haptic loops, which never queue behind other calls; one
/// for all other calls (displays, tools, set-up), which blocks and costs nothing while it is idle.
std::vector<rpc::LaneConfig> default_lanes() {
  constexpr Priority kHigh{16384};
  return {{.name = "lane-rest", .wait = {.strategy = rt::WaitStrategy::kBlock}},
          {.name = "lane-haptic",
           .low = kHigh,
           .priority = kHigh,
           .wait = {.strategy = rt::WaitStrategy::kPeriodic}}};
}

void add_service(options::Options& options, Configuration& configuration) {
  configuration.settings.server.lanes = default_lanes();
  options::add_server(options, configuration.settings);
  options::add_caller(options, configuration.settings);
  options.add_registry(configuration.registry);
  options.add("events", configuration.events,
              "The hub that gets the devices' events, by name or URL; 'none': no events");
  options.add("serve-events", configuration.serves_events,
              "Serve that hub in this program, instead of rtpm-eventd, and bind its name");
  options.add(
      "settings", configuration.settings_folder,
      "The folder of the devices' saved parameters; empty: they are neither saved nor read");
  options.add("stops", configuration.stops_folder,
              "The folder where emergency stops are kept until they are rearmed; empty: "
              "~/.local/state/rtpm/stops; 'none': they end with this program");
  options.add("flight-records", configuration.flight_folder,
              "The folder where each fault leaves " + std::string(flight_file_kind()) +
                  ", at most 16 per device; empty: none");
  options.add("allow-takeover", configuration.allows_takeover,
              "Take the names from another server that holds them, at the start");
  options::Options rare = options.rare();
  constexpr options::Range<Duration> kLease{std::chrono::milliseconds{10}, std::chrono::hours{1}};
  rare.add("lease", configuration.lease.silence_max,
           "How long a silent client keeps the right to command", kLease);
  rare.add("lease-idle", configuration.lease.idle_max,
           "How long a client keeps the right to command that only renews it", kLease);
  rare.add("operator-priority", configuration.operator_priority,
           "From which priority on a call may take the right to command over");
}

void find_stops_folder(Configuration& configuration) {
  if (configuration.stops_folder == kNoStops) {
    configuration.stops_folder.clear();
    return;
  }
  if (!configuration.stops_folder.empty()) return;
  if (const std::string folder = program::state_folder(); !folder.empty()) {
    configuration.stops_folder = folder + "/stops";
    return;
  }
  rt::print_error("rtpm-deviced",
                  SetupError{.what = "emergency stops end with this program",
                             .why = "the environment names no folder for the user's files",
                             .remedy = "name the folder that keeps them, --stops"}
                      .text());
}

/// The lowest priority in the most urgent lane.
Priority highest_low(const Configuration& configuration) {
  Priority highest = Priority::kLowest;
  for (const rpc::LaneConfig& lane : configuration.settings.server.lanes)
    highest = std::max(highest, lane.low);
  return highest;
}

std::optional<int> check(const options::Options& options, const Configuration& configuration) {
  if (configuration.serves_events &&
      (configuration.events == kNoHub || configuration.events.starts_with("rtpm://"))) {
    return options.usage_error("--serve-events needs --events with the name that its hub gets");
  }
  for (const DeviceSettings& device : configuration.devices) {
    const std::string key = "--device-" + device.name;
    if (device.driver.empty()) {
      return options.usage_error("the device " + device.name + " has no driver; name one with " +
                                 key + "-driver: one of " + driver_names() +
                                 ", or the file of a plug-in");
    }
    if (device.priority <= highest_low(configuration)) {
      return options.usage_error(
          key +
          "-priority is not above where the most urgent lane begins, so callers could delay the "
          "device; raise it, or lower that lane's --lane-NAME-low");
    }
    if (device.is_free && !device.hand.empty()) {
      return options.usage_error(key + "-free and " + key +
                                 "-hand contradict each other; give one of them");
    }
  }
  return std::nullopt;
}

}  // namespace

std::optional<int> read_configuration(int argc, const char* const* argv,
                                      Configuration& configuration) {
  configuration.registry = names::kThisHost;
  options::Options options("rtpm-deviced",
                           "hosts devices: runs their drivers and serves them under names");
  add_devices(options, configuration);
  add_service(options, configuration);
  if (const auto exit_code = options.parse(argc, argv)) return exit_code;
  if (const auto exit_code = check(options, configuration)) return exit_code;
  find_stops_folder(configuration);
  return std::nullopt;
}

}  // namespace rtpm::deviced
