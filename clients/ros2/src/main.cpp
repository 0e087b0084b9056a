// rtpm-ros2: shows devices as topics of ROS 2, and takes commands and stops from there.
#include <chrono>
#include <cstdio>
#include <string>
#include <vector>

#include "bridge.hpp"
#include "cyclone/domain.hpp"
#include "rtpm/events/defaults.hpp"
#include "rtpm/names/defaults.hpp"
#include "rtpm/names/resolver.hpp"
#include "rtpm/options/options.hpp"
#include "rtpm/program/stop_signal.hpp"
#include "rtpm/rpc/node.hpp"
#include "rtpm/rt/log.hpp"

namespace {

using namespace std::chrono_literals;
using namespace rtpm::ros2;

struct Configuration {
  BridgeConfig bridge{};
  std::vector<std::string> events{};
  rtpm::rpc::NodeSecurity security{};
  rtpm::Duration report{0};
  rtpm::Duration run_for{0};
};

int fail(const std::string& text) {
  rtpm::rt::print_error("rtpm-ros2", text);
  return 1;
}

void add_options(rtpm::options::Options& options, Configuration& its) {
  options.add_registry(its.bridge.registry);
  rtpm::options::add_caller(options, its.security);
  options.add("hub", its.bridge.hub, "The hub of the devices' events, by name or URL");
  options.add("devices", its.bridge.devices, "Devices to show; empty: all");
  options.add("rate", its.bridge.rate_hz, "Samples per second of each device at most",
              {1.0, 1000.0});
  options.add("tf", its.bridge.has_tf, "Publishes poses on /tf, too");
  options.add("node", its.bridge.node, "The node's name in ROS");
  options.add("command", its.bridge.commanded, "Devices that ROS topics may command");
  options.add("hold", its.bridge.command.hold, "How long a command lasts without a newer one",
              {1ms, 10s});
  options.add("command-age", its.bridge.command.age_max,
              "How much a command's stamp may differ from this host's clock", {1ms, 10s});
  options.add("event", its.events, "Topics that become events, as /TOPIC:PACKAGE/msg/TYPE");
  options.add("report", its.report, "Interval of printing the counters, 0s: only at the end");
  options.add("duration", its.run_for, "How long to run; 0s: until it is ended");
}

/// The error in the options; empty if there is none.
std::string finish(Configuration& its) {
  if (its.bridge.node.empty() || ros_name(its.bridge.node) != its.bridge.node ||
      its.bridge.node.find('/') != std::string::npos || its.bridge.node.size() > 200)
    return "--node is no name of a node: letters, digits and '_', no digit first";
  for (const std::string& each : its.events) {
    auto topic = parse_topic(each);
    if (!topic) return "--event: " + topic.error().text();
    its.bridge.events.push_back(std::move(*topic));
  }
  return {};
}

int run(const Configuration& configuration) {
  const rtpm::program::StopSignal stop;
  const auto domain = domain_of_environment();
  if (!domain) return fail(domain.error().text());
  rtpm::rpc::Node node({.security = configuration.security});
  rtpm::names::RegistryResolver resolver(node, configuration.bridge.registry);
  node.use(resolver);
  rtpm::rt::Log log("rtpm-ros2");
  auto bridge = Bridge::create(node, *domain, configuration.bridge, log);
  if (!bridge) return fail(bridge.error().text());
  std::printf("bridging to ROS 2 domain %u as node /%s\n", domain->id,
              configuration.bridge.node.c_str());
  std::fflush(stdout);
  constexpr rtpm::Duration kLook = 100ms;
  rtpm::Duration since_report{0};
  rtpm::Duration left = configuration.run_for;
  while (!stop.wait_for(kLook)) {
    (*bridge)->attend();
    log.tick();
    since_report += kLook;
    left -= kLook;
    if (configuration.run_for != 0s && left <= 0s) break;
    if (configuration.report == 0s || since_report < configuration.report) continue;
    since_report = 0s;
    std::printf("%s\n", (*bridge)->report().c_str());
    std::fflush(stdout);
  }
  std::printf("%s\n", (*bridge)->report().c_str());
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  Configuration configuration;
  configuration.bridge.registry = rtpm::names::kThisHost;
  configuration.bridge.hub = rtpm::events::kHubPath;
  rtpm::options::Options options("rtpm-ros2",
                                 "devices as topics of ROS 2, and commands from there");
  add_options(options, configuration);
  if (const auto exit_code = options.parse(argc, argv)) return *exit_code;
  if (const std::string wrong = finish(configuration); !wrong.empty())
    return options.usage_error(wrong);
  return run(configuration);
}
