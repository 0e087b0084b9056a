// rtpm-deviced: hosts devices. It runs each device's driver in its own real-time loop, serves the
// devices to callers in two lanes, and binds their names at the registry.
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "configuration.hpp"
#include "device_events.hpp"
#include "driver_watch.hpp"
#include "flight_files.hpp"
#include "hosted_device.hpp"
#include "inventory.hpp"
#include "isolated_driver.hpp"
#include "plugin_check.hpp"
#include "rtpm/introspection/catalog.hpp"
#include "rtpm/names/resolver.hpp"
#include "rtpm/program/stop_signal.hpp"
#include "rtpm/rpc/node.hpp"
#include "rtpm/rpc/server.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/crash.hpp"
#include "rtpm/rt/log.hpp"

namespace rtpm::deviced {
namespace {

using Devices = std::vector<std::unique_ptr<HostedDevice>>;

int fail(const SetupError& error) {
  rt::print_error("rtpm-deviced", error.text());
  return 1;
}

constexpr int kExitDriverBlocks = 3;
constexpr Duration kStopPatience = std::chrono::seconds{2};

/// Stops all devices. If a driver does not return, ends the program, because nothing that the
/// driver uses may be destroyed.
void stop_devices(const Devices& devices) {
  for (const auto& device : devices)
    device->request_stop();
  const MonotonicTime deadline = rt::now() + kStopPatience;
  std::string blocked;
  for (const auto& device : devices) {
    if (!device->stop(deadline - rt::now()))
      blocked += (blocked.empty() ? "" : ", ") + device->name();
  }
  if (blocked.empty()) return;
  rt::print_error("rtpm-deviced",
                  SetupError{.what = blocked + " can't be deactivated and may still apply a force",
                             .why = "the driver has not returned for 2 s",
                             .remedy = "switch the device off; each call of a driver must return"}
                      .text());
  std::_Exit(kExitDriverBlocks);
}

/// Stops the devices when the scope ends.
class StopAtEnd {
 public:
  explicit StopAtEnd(const Devices& devices) noexcept : devices_(devices) {}
  StopAtEnd(const StopAtEnd&) = delete;
  StopAtEnd& operator=(const StopAtEnd&) = delete;
  ~StopAtEnd() { stop_devices(devices_); }

 private:
  const Devices& devices_;
};

/// Destroys the objects that refer to the devices, such as the system-wide stop, before the
/// devices.
class LeaveAtEnd {
 public:
  explicit LeaveAtEnd(DeviceEvents& events) noexcept : events_(events) {}
  LeaveAtEnd(const LeaveAtEnd&) = delete;
  LeaveAtEnd& operator=(const LeaveAtEnd&) = delete;
  ~LeaveAtEnd() { events_.stop(); }

 private:
  DeviceEvents& events_;
};

/// A device that can't be created is logged and skipped: one faulty driver must not affect other
/// devices.
Devices create_devices(const Configuration& configuration, DeviceEvents& events) {
  Devices devices;
  for (const DeviceSettings& settings : configuration.devices) {
    auto device = HostedDevice::create(configuration, settings, events);
    if (device) {
      devices.push_back(std::move(*device));
    } else {
      fail(device.error());
    }
  }
  return devices;
}

expected<void, SetupError> start(Devices& devices, rpc::Server& server,
                                 introspection::Catalog& catalog) {
  for (const auto& device : devices) {
    if (auto added = device->add_to(server, catalog); !added) return added;
  }
  if (auto added = catalog.serve(server); !added) return added;
  for (const auto& device : devices) {
    if (auto started = device->start(); !started) return started;
    if (!device->has_sample()) {
      rt::print_error("rtpm-deviced", device->name() +
                                          ": its driver has not set it up for 2 s; it "
                                          "is served without a sample until then");
    }
  }
  return server.start();
}

int serve(const Configuration& configuration) {
  const program::StopSignal stop;
  const auto prepared = options::prepare(configuration.settings);
  if (!prepared) return fail(prepared.error());
  rpc::Node node({.wait = {.strategy = rt::WaitStrategy::kBlock},
                  .security = options::node_security(configuration.settings),
                  .served = configuration.settings.server.security});
  names::RegistryResolver resolver(node, configuration.registry);
  if (configuration.registry != kNoRegistry) node.use(resolver);
  auto events = DeviceEvents::create(node, configuration);
  if (!events) return fail(events.error());
  Devices devices = create_devices(configuration, **events);
  if (devices.empty()) return 1;
  const LeaveAtEnd leave_at_end(**events);
  // Destroyed after the devices have stopped, so that their last faults are written, too.
  FlightFiles flight_files(configuration.flight_folder);
  for (const auto& device : devices)
    flight_files.add(device->name(), device->server().flight_recorder());
  DriverWatch driver_watch;
  for (const auto& device : devices)
    driver_watch.add(device->name(), device->server());
  const StopAtEnd stop_at_end(devices);
  if (auto started = flight_files.start(); !started) return fail(started.error());
  if (auto started = driver_watch.start(); !started) return fail(started.error());
  rpc::ServerConfig server_config = configuration.settings.server;
  server_config.name = "rtpm-deviced";
  auto server = rpc::Server::create(std::move(server_config));
  if (!server) return fail(server.error());
  if (auto joined = (*events)->start_stops(node); !joined) return fail(joined.error());
  if (auto started = (*events)->start_publishing(); !started) return fail(started.error());
  introspection::Catalog catalog;
  if (auto started = start(devices, **server, catalog); !started) return fail(started.error());

  for (const auto& device : devices) {
    if (auto bound = device->bind(node, **server, configuration); !bound) {
      return fail(bound.error());
    }
  }
  options::show_setup(configuration.settings, **server, "rtpm-deviced");
  for (const auto& device : devices) {
    std::printf("serving %s at %s\n", device->name().c_str(),
                (*server)->url(device->name()).c_str());
  }
  std::fflush(stdout);

  stop.wait();
  // First removes the names, so that no client finds a server that is about to stop; then ends
  // calls. The devices and their events are destroyed with the scope.
  for (const auto& device : devices)
    device->unbind();
  (*server)->stop();
  return devices.size() == configuration.devices.size() ? 0 : 1;
}

}  // namespace
}  // namespace rtpm::deviced

int main(int argc, char** argv) {
  if (const auto exit_code = rtpm::deviced::serve_isolated(argc, argv)) return *exit_code;
  rtpm::rt::report_crashes("rtpm-deviced",
                           "give the driver a process of its own, --device-NAME-isolated");
  rtpm::deviced::Configuration configuration;
  if (const auto exit_code = rtpm::deviced::read_configuration(argc, argv, configuration)) {
    return *exit_code;
  }
  using namespace rtpm::deviced;
  if (configuration.lists_drivers) std::fputs(list_text(drivers()).c_str(), stdout);
  if (configuration.probes) std::fputs(probe_text(probe(drivers()), drivers()).c_str(), stdout);
  if (configuration.lists_drivers || configuration.probes) return 0;
  if (!configuration.checked.empty()) {
    return check_plugin(configuration.checked, configuration.checked_arguments);
  }
  return rtpm::deviced::serve(configuration);
}
