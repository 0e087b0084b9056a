// rtpm-deviced: hosts a device. It runs the device's driver in a real-time loop, serves it to
// callers in two lanes, and binds its name at the registry.
#include <algorithm>
#include <cstdio>
#include <memory>
#include <string>
#include <string_view>
#include <utility>

#include "configuration.hpp"
#include "rtpm/device_sim/sim_driver.hpp"
#include "rtpm/gvd/server.hpp"
#include "rtpm/introspection/catalog.hpp"
#include "rtpm/names/registration.hpp"
#include "rtpm/options/stop_signal.hpp"
#include "rtpm/rpc/node.hpp"
#include "rtpm/rpc/server.hpp"
#include "rtpm/rt/log.hpp"

namespace rtpm::deviced {
namespace {

/// Logs the device's events to standard error.
class Reporter final : public gvd::DeviceListener {
 public:
  void report(std::string_view text) override { log_.write(text); }

 private:
  rt::Log log_{"rtpm-deviced"};
};

int fail(std::string_view text) {
  rt::print_error("rtpm-deviced", text);
  return 1;
}

/// The last component of a name: "arm0" of "lab/arm0".
std::string short_name(const std::string& name) {
  return name.substr(name.rfind('/') + 1);
}

expected<std::unique_ptr<driver::Driver>, SetupError> make_driver(
    const Configuration& configuration) {
  device_sim::SimConfig sim;
  sim.is_held = !configuration.is_free;
  sim.hand_file = configuration.hand;
  sim.seed = configuration.seed;
  sim.serial = "sim-" + short_name(configuration.name);
  sim.frame = short_name(configuration.name) + "/base";
  auto made = device_sim::SimDriver::create(std::move(sim));
  if (!made) return unexpected{made.error()};
  return std::unique_ptr<driver::Driver>(std::move(*made));
}

gvd::DeviceServerConfig device_config(const Configuration& configuration,
                                      const driver::Descriptor& descriptor, Reporter& reporter) {
  gvd::SafetyConfig safety = gvd::SafetyConfig::for_device(descriptor.limits);
  if (configuration.force_max_newton > 0) {
    safety.force_newton_max = std::min(safety.force_newton_max, configuration.force_max_newton);
  }
  safety.hold_max = configuration.hold_max;
  safety.ramp = configuration.ramp;
  safety.soft_start = configuration.soft_start;
  gvd::DeviceServerConfig config;
  config.cycle.period = std::chrono::duration_cast<Duration>(
      std::chrono::duration<double>(1.0 / configuration.rate_hz));
  config.cycle.lease = configuration.lease;
  config.cycle.operator_priority = configuration.operator_priority;
  config.cycle.safety = safety;
  config.cycle.listener = &reporter;
  config.thread.name = "device";
  config.thread.priority = configuration.device_priority;
  config.thread.realtime = configuration.settings.server.realtime;
  return config;
}

int serve(const Configuration& configuration) {
  const options::StopSignal stop;
  auto driver = make_driver(configuration);
  if (!driver) return fail(driver.error().text());
  Reporter reporter;
  const driver::Descriptor descriptor = (*driver)->describe();
  auto device = gvd::DeviceServer::create(std::move(*driver),
                                          device_config(configuration, descriptor, reporter));
  if (!device) return fail(device.error().text());
  const auto prepared = options::prepare(configuration.settings);
  if (!prepared) return fail(prepared.error().text());
  rpc::ServerConfig server_config = configuration.settings.server;
  server_config.name = configuration.name;
  auto server = rpc::Server::create(std::move(server_config));
  if (!server) return fail(server.error().text());
  gvd::DeviceServer& served = **device;
  if (auto added = (*server)->add(configuration.name, served.servant()); !added) {
    return fail(added.error().text());
  }
  introspection::Catalog catalog;
  catalog.add(configuration.name, served.servant());
  if (auto added = (*server)->add(introspection::kPath, catalog); !added) {
    return fail(added.error().text());
  }
  if (auto started = served.start(); !started) return fail(started.error().text());
  if (auto started = (*server)->start(); !started) return fail(started.error().text());

  rpc::Node node({.wait = {.strategy = rt::WaitStrategy::kBlock}});
  const std::string url = (*server)->url(configuration.name);
  std::unique_ptr<names::Registration> registration;
  if (configuration.registry != kNoRegistry) {
    auto bound = names::Registration::create(
        node, configuration.registry, configuration.name, url,
        std::string(served.servant().interface().name), names::Registration::kDefaultLease, {},
        configuration.allows_takeover ? names::Takeover::kAllowed : names::Takeover::kRefused);
    if (!bound) return fail(bound.error().text());
    registration = std::move(*bound);
  }
  options::show_setup(configuration.settings);
  std::printf("serving %s at %s\n", configuration.name.c_str(), url.c_str());
  std::fflush(stdout);

  stop.wait();
  // The name first, so that no client finds a server about to end; then calls, then the device.
  registration.reset();
  (*server)->stop();
  served.stop();
  return 0;
}

}  // namespace
}  // namespace rtpm::deviced

int main(int argc, char** argv) {
  rtpm::deviced::Configuration configuration;
  if (const auto exit_code = rtpm::deviced::read_configuration(argc, argv, configuration)) {
    return *exit_code;
  }
  return rtpm::deviced::serve(configuration);
}
