// rtpm-vrpn: serves devices to clients of VRPN.
#include <chrono>
#include <cstdio>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "rtpm/base/printable.hpp"
#include "rtpm/gvd/client.hpp"
#include "rtpm/names/defaults.hpp"
#include "rtpm/names/directory.hpp"
#include "rtpm/names/resolver.hpp"
#include "rtpm/options/options.hpp"
#include "rtpm/program/stop_signal.hpp"
#include "rtpm/rpc/node.hpp"
#include "rtpm/rt/log.hpp"
#include "rtpm/rt/utc.hpp"
#include "server.hpp"

namespace {

using namespace std::chrono_literals;
using namespace rtpm;

struct Configuration {
  std::string registry{names::kThisHost};
  rpc::NodeSecurity security{};
  std::vector<std::string> devices{};
  std::string host = "127.0.0.1";
  std::uint16_t port = vrpn::kPort;
  double rate_hz = 100;
};

int fail(const std::string& text) {
  rt::print_error("rtpm-vrpn", text);
  return 1;
}

/// The names of all devices.
expected<std::vector<std::string>, SetupError> find_devices(rpc::Node& node,
                                                            const std::string& registry) {
  const auto entries = names::Directory(node, registry).list();
  if (!entries) return unexpected{SetupError{entries.error()}};
  std::vector<std::string> found;
  for (const names::NameEntry& entry : *entries) {
    if (entry.interface == "rtpm.device.Device") found.push_back(entry.name);
  }
  if (found.empty()) {
    return setup_error("there are no devices to serve", "",
                       "start rtpm-deviced, or give --devices");
  }
  return found;
}

/// A device, and what was last said about it.
struct Source {
  gvd::DeviceClient client;
  std::uint64_t last_sequence = 0;
  bool is_lost = false;
};

void read(Source& source, std::size_t index, const std::string& name, vrpn::Server& server,
          rt::Log& log) {
  const auto sample = source.client.read({.deadline = 50ms});
  if (!sample) {
    if (!std::exchange(source.is_lost, true)) {
      log.write(printable(name) + " is lost: " + std::string(gvd::to_string(sample.error())));
    }
    return;
  }
  if (std::exchange(source.is_lost, false)) log.write(printable(name) + " is back");
  if (std::exchange(source.last_sequence, sample->sequence) == sample->sequence) return;
  server.publish(index, *sample, static_cast<std::int64_t>(rt::utc_ns(sample->host_time) / 1000));
}

int serve(const Configuration& its, const program::StopSignal& stop, rpc::Node& node) {
  std::vector<std::string> names = its.devices;
  if (names.empty()) {
    auto found = find_devices(node, its.registry);
    if (!found) return fail(found.error().text());
    names = std::move(*found);
  }
  std::vector<Source> sources;
  vrpn::ServerConfig config{.host = its.host, .port = its.port};
  for (const std::string& name : names) {
    auto client = gvd::DeviceClient::open(node, name);
    if (!client) return fail(name + ": " + client.error().text());
    config.devices.push_back({name, client->descriptor()});
    sources.push_back({.client = std::move(*client)});
  }
  auto server = vrpn::Server::create(std::move(config));
  if (!server) return fail(server.error().text());
  rt::Log log("rtpm-vrpn");
  if (its.host != "127.0.0.1" && its.host != "::1") {
    log.write("VRPN has no security: everybody who reaches " + printable(its.host) +
              " sees the devices");
  }
  for (const std::string& name : names) {
    std::printf("serving %s@%s:%u\n", printable(name).c_str(), its.host.c_str(),
                unsigned{server->port()});
  }
  std::fflush(stdout);
  const auto period =
      std::chrono::duration_cast<Duration>(std::chrono::duration<double>(1 / its.rate_hz));
  while (!stop.wait_for(period)) {
    for (std::size_t i = 0; i < sources.size(); ++i)
      read(sources[i], i, names[i], *server, log);
    server->poll();
    log.tick();
  }
  const vrpn::ServerCounters& counters = server->counters();
  std::printf("%llu clients, %llu refused, %llu closed, %llu reports dropped\n",
              static_cast<unsigned long long>(counters.connection_count),
              static_cast<unsigned long long>(counters.refused_count),
              static_cast<unsigned long long>(counters.closed_count),
              static_cast<unsigned long long>(counters.dropped_count));
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  Configuration its;
  options::Options options("rtpm-vrpn",
                           "devices as Tracker, Button, Analog and ForceDevice of VRPN");
  options.add_registry(its.registry);
  options::add_caller(options, its.security);
  options.add("devices", its.devices, "Devices to serve, by name; empty: all that there are");
  options.add("host", its.host, "The address to listen at; VRPN has no security");
  options.add("port", its.port, "The port, TCP and UDP; 0: the system chooses", {0, 65'535});
  options.add("rate", its.rate_hz, "Samples per second, at most the device's", {1, 1000});
  if (const auto exit_code = options.parse(argc, argv)) return *exit_code;
  const program::StopSignal stop;
  rpc::Node node({.security = its.security});
  names::RegistryResolver resolver(node, its.registry);
  node.use(resolver);
  return serve(its, stop, node);
}
