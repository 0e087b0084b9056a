// rtpm-event-bridge: passes a hub's events to an MQTT broker, and the broker's messages to the hub.
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include "bridge.hpp"
#include "rtpm/events/defaults.hpp"
#include "rtpm/names/defaults.hpp"
#include "rtpm/names/resolver.hpp"
#include "rtpm/options/options.hpp"
#include "rtpm/program/stop_signal.hpp"
#include "rtpm/rpc/node.hpp"
#include "rtpm/rt/log.hpp"

namespace {

using namespace std::chrono_literals;
using namespace rtpm::mqtt;

struct Configuration {
  BridgeConfig bridge{};
  BrokerConfig broker{};
  std::string registry{rtpm::names::kThisHost};
  rtpm::rpc::NodeSecurity security{};
  std::string direction = "both";
  std::vector<std::string> events{};
  std::vector<std::string> mappings{};
  std::uint32_t hops = 0;
  rtpm::Duration report{0};
};

int fail(const std::string& text) {
  rtpm::rt::print_error("rtpm-event-bridge", text);
  return 1;
}

void add_options(rtpm::options::Options& options, Configuration& its) {
  options.add_registry(its.registry);
  rtpm::options::add_caller(options, its.security);
  options.add("hub", its.bridge.hub, "The hub, by name or URL");
  options.add("host", its.broker.host, "The broker's name or address");
  options.add("port", its.broker.port, "The broker's port", {1, 65'535});
  options.add("user", its.broker.user, "User at the broker; empty: none");
  options.add_secret("password", its.broker.password, "The user's password");
  options.add("ca-file", its.broker.ca_file, "Trusted certificates; empty: no TLS");
  options.add("prefix", its.bridge.prefix, "Prefix of topics: PREFIX/TYPE/SOURCE");
  options.add_choice("direction", its.direction, {"both", "to-broker", "from-broker"},
                     "Direction of events");
  options.add("events", its.events, "Events to publish, as TYPE or TYPE/SOURCE; empty: all");
  options.add("map", its.mappings, "Topics of other clients to receive, as TOPIC=TYPE/SOURCE");
  options.add("interval", its.bridge.delivery.interval,
              "Publishes at most one event per interval, 0s: all");
  options.add("retain", its.broker.retains,
              "Lets the broker retain the last message of each topic");
  options.add("queue", its.broker.queue_capacity, "Maximum messages that wait for the broker",
              {1, 65'536});
  options.add("hops", its.hops, "Links that events of other clients may cross", {0, 8});
  options.add("priority", its.bridge.priority, "Of the bridge, and of events from the broker");
  options.add_realtime(its.bridge.realtime);
  options.add("report", its.report, "Interval of printing the counters, 0s: only at the end");
}

/// The error in the options; empty if there is none.
std::string finish(Configuration& its) {
  if (!is_topic(its.bridge.prefix)) return "--prefix is no topic";
  its.bridge.hops = static_cast<std::uint8_t>(its.hops);
  its.bridge.direction = its.direction == "both"        ? Direction::kBoth
                         : its.direction == "to-broker" ? Direction::kToBroker
                                                        : Direction::kFromBroker;
  for (const std::string& each : its.events) {
    const auto wanted = parse_wanted(each);
    if (!wanted) return "--events: " + wanted.error().reason();
    its.bridge.wanted.push_back(*wanted);
  }
  for (const std::string& each : its.mappings) {
    const auto mapping = parse_mapping(each);
    if (!mapping) return "--map: " + mapping.error().reason();
    its.bridge.mappings.push_back(*mapping);
  }
  return {};
}

void report_connection(const Bridge& bridge, rtpm::rt::Log& output, rtpm::rt::Log& log,
                       bool& was_connected, std::string& reported) {
  const bool is_connected = bridge.broker().is_connected();
  const std::string reason = bridge.broker().reason();
  if (is_connected && !was_connected) {
    output.write("connected to the broker");
  } else if (!is_connected && reason != reported) {
    log.write("not connected to the broker: " + reason);
  }
  log.tick();
  output.tick();
  was_connected = is_connected;
  reported = is_connected ? std::string() : reason;
}

int run(const Configuration& configuration) {
  const rtpm::program::StopSignal stop;
  rtpm::rpc::Node node({.security = configuration.security});
  rtpm::names::RegistryResolver resolver(node, configuration.registry);
  node.use(resolver);
  auto bridge = Bridge::create(node, configuration.bridge, configuration.broker);
  if (!bridge) return fail(bridge.error().text());
  std::printf("bridging %s\n", configuration.bridge.hub.c_str());
  bool was_connected = false;
  std::string reported;
  rtpm::rt::Log output("", {}, stdout);
  rtpm::rt::Log log("rtpm-event-bridge");
  rtpm::Duration since_report{0};
  constexpr rtpm::Duration kLook = 50ms;
  while (!stop.wait_for(kLook)) {
    report_connection(**bridge, output, log, was_connected, reported);
    since_report += kLook;
    if (configuration.report == rtpm::Duration{0} || since_report < configuration.report) continue;
    since_report = rtpm::Duration{0};
    std::printf("%s\n", (*bridge)->report().c_str());
    std::fflush(stdout);
  }
  std::printf("%s\n", (*bridge)->report().c_str());
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  Configuration configuration;
  configuration.bridge.hub = rtpm::events::kHubPath;
  rtpm::options::Options options("rtpm-event-bridge",
                                 "events of a hub as messages of an MQTT 5 broker, and back");
  add_options(options, configuration);
  if (const auto exit_code = options.parse(argc, argv)) return *exit_code;
  if (const std::string wrong = finish(configuration); !wrong.empty()) {
    return options.usage_error(wrong);
  }
  return run(configuration);
}
