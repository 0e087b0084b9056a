// rtpm-deviced: hosts devices. It runs each device's driver in a real-time loop of its own, serves
// them to callers in two lanes, and binds their names at the registry.
#include <cstdio>
#include <memory>
#include <string_view>
#include <utility>
#include <vector>

#include "configuration.hpp"
#include "hosted_device.hpp"
#include "rtpm/introspection/catalog.hpp"
#include "rtpm/options/stop_signal.hpp"
#include "rtpm/rpc/node.hpp"
#include "rtpm/rpc/server.hpp"
#include "rtpm/rt/log.hpp"

namespace rtpm::deviced {
namespace {

using Devices = std::vector<std::unique_ptr<HostedDevice>>;

int fail(const SetupError& error) {
  rt::print_error("rtpm-deviced", error.text());
  return 1;
}

expected<Devices, SetupError> create_devices(const Configuration& configuration) {
  Devices devices;
  for (const DeviceSettings& settings : configuration.devices) {
    auto device = HostedDevice::create(configuration, settings);
    if (!device) return unexpected{device.error()};
    devices.push_back(std::move(*device));
  }
  return devices;
}

expected<void, SetupError> start(Devices& devices, rpc::Server& server,
                                 introspection::Catalog& catalog) {
  for (const auto& device : devices) {
    if (auto added = device->add_to(server, catalog); !added) return added;
  }
  if (auto added = server.add(introspection::kPath, catalog); !added) return added;
  for (const auto& device : devices) {
    if (auto started = device->start(); !started) return started;
  }
  return server.start();
}

int serve(const Configuration& configuration) {
  const options::StopSignal stop;
  auto devices = create_devices(configuration);
  if (!devices) return fail(devices.error());
  const auto prepared = options::prepare(configuration.settings);
  if (!prepared) return fail(prepared.error());
  rpc::ServerConfig server_config = configuration.settings.server;
  server_config.name = "rtpm-deviced";
  auto server = rpc::Server::create(std::move(server_config));
  if (!server) return fail(server.error());
  introspection::Catalog catalog;
  if (auto started = start(*devices, **server, catalog); !started) return fail(started.error());

  rpc::Node node({.wait = {.strategy = rt::WaitStrategy::kBlock}});
  for (const auto& device : *devices) {
    if (auto bound = device->bind(node, **server, configuration); !bound) {
      return fail(bound.error());
    }
  }
  options::show_setup(configuration.settings);
  for (const auto& device : *devices) {
    std::printf("serving %s at %s\n", device->name().c_str(),
                (*server)->url(device->name()).c_str());
  }
  std::fflush(stdout);

  stop.wait();
  // The names first, so that no client finds a server about to end; then calls, then the devices.
  for (const auto& device : *devices)
    device->unbind();
  (*server)->stop();
  for (const auto& device : *devices)
    device->stop();
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
