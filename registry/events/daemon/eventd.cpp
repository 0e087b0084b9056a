// rtpm-eventd: serves a hub of events, and binds its name.
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include "hub_log.hpp"
#include "rtpm/events/defaults.hpp"
#include "rtpm/events/hub.hpp"
#include "rtpm/events/link.hpp"
#include "rtpm/introspection/catalog.hpp"
#include "rtpm/names/registration.hpp"
#include "rtpm/names/resolver.hpp"
#include "rtpm/options/options.hpp"
#include "rtpm/options/server_options.hpp"
#include "rtpm/program/stop_signal.hpp"
#include "rtpm/rpc/node.hpp"
#include "rtpm/rpc/server.hpp"
#include "rtpm/rt/log.hpp"

namespace {

struct Configuration {
  rtpm::options::ServerSettings settings{};
  std::string registry{rtpm::names::kThisHost};
  std::string name{rtpm::events::kHubPath};
  bool allows_takeover = false;  ///< Takes the name even from a live server.
  std::uint64_t subscriptions_max = 1024;
  std::uint64_t history = 8;
  double quota = 2e6;
  std::vector<std::string> links{};
  rtpm::Priority link_priority{};
  rtpm::events::MulticastConfig multicast{};
  std::uint32_t multicast_hops = 1;
};

int fail(const std::string& text) {
  rtpm::rt::print_error("rtpm-eventd", text);
  return 1;
}

rtpm::events::HubConfig hub_config(const Configuration& configuration) {
  rtpm::events::HubConfig hub;
  hub.limits.subscription_count_max = static_cast<std::uint32_t>(configuration.subscriptions_max);
  hub.limits.interest_count_max = 8 * hub.limits.subscription_count_max;
  hub.limits.history_depth = static_cast<std::uint32_t>(configuration.history);
  hub.quota.events_per_s = configuration.quota;
  hub.realtime = configuration.settings.server.realtime;
  if (!configuration.multicast.group.group.empty()) {
    hub.multicast = configuration.multicast;
    hub.multicast->group.hops = static_cast<std::uint8_t>(configuration.multicast_hops);
  }
  return hub;
}

rtpm::expected<void, rtpm::SetupError> link(rtpm::events::Hub& hub, rtpm::rpc::Node& node,
                                            const Configuration& configuration) {
  rtpm::events::LinkConfig link;
  link.priority = configuration.link_priority;
  link.realtime = configuration.settings.server.realtime;
  // Distinguishes the links in the other hub's report.
  if (!configuration.name.empty()) link.name = configuration.name;
  for (const std::string& target : configuration.links) {
    if (auto linked = hub.link(node, target, link); !linked) return linked;
  }
  return {};
}

int serve(const Configuration& configuration) {
  const rtpm::program::StopSignal stop;
  const auto prepared = rtpm::options::prepare(configuration.settings);
  if (!prepared) return fail(prepared.error().text());
  rtpm::rpc::Node node({.security = rtpm::options::node_security(configuration.settings),
                        .served = configuration.settings.server.security});
  rtpm::names::RegistryResolver resolver(node, configuration.registry);
  node.use(resolver);
  auto hub = rtpm::events::Hub::create(hub_config(configuration));
  if (!hub) return fail(hub.error().text());
  auto server = rtpm::rpc::Server::create(configuration.settings.server);
  if (!server) return fail(server.error().text());
  const rtpm::rpc::ObjectOptions by_type{.checks_callers = true};
  if (auto added = (*server)->add(rtpm::events::kHubPath, (*hub)->servant(), by_type); !added) {
    return fail(added.error().text());
  }
  rtpm::introspection::Catalog catalog;
  catalog.add(std::string(rtpm::events::kHubPath), (*hub)->servant());
  if (auto added = catalog.serve(**server); !added) {
    return fail(added.error().text());
  }
  if (auto started = (*server)->start(); !started) return fail(started.error().text());
  rtpm::options::show_setup(configuration.settings, **server, "rtpm-eventd");
  const std::string url = (*server)->url(rtpm::events::kHubPath);
  std::unique_ptr<rtpm::names::Registration> name;
  if (!configuration.name.empty()) {
    auto bound = rtpm::names::Registration::create(
        node, configuration.registry, configuration.name, url, "rtpm.events.Hub",
        rtpm::names::Registration::kDefaultLease, {},
        configuration.allows_takeover ? rtpm::names::Takeover::kAllowed
                                      : rtpm::names::Takeover::kRefused);
    if (!bound) return fail(bound.error().text());
    name = std::move(*bound);
  }
  if (const auto linked = link(**hub, node, configuration); !linked) {
    return fail(linked.error().text());
  }
  std::printf("events at %s\n", url.c_str());
  std::fflush(stdout);
  rtpm::eventd::HubLog log(**hub);
  while (!stop.wait_for(std::chrono::milliseconds{250}))
    log.write_changes();
  name.reset();
  (*server)->stop();
  return 0;
}

void add_multicast(rtpm::options::Options& options, Configuration& configuration) {
  rtpm::events::MulticastConfig& multicast = configuration.multicast;
  multicast.group.group.clear();
  options.add("multicast", multicast.group.group,
              "Multicast group for consumers that request it, such as 239.255.42.1; empty: none. "
              "Everybody on the network can read multicast and forge its events, whatever the "
              "grants say");
  options.add("multicast-port", multicast.group.port, "The group's port", {1, 65'535});
  options.add("multicast-interface", multicast.group.interface,
              "Address of the sending interface; empty: by the routing table");
  options.add("multicast-hops", configuration.multicast_hops,
              "Scope of the group: 0 this host, 1 the LAN", {0, 255});
  options.add("multicast-history", multicast.history_count, "Datagrams kept for repair",
              {8, 1'000'000});
}

}  // namespace

int main(int argc, char** argv) {
  Configuration configuration;
  rtpm::options::Options options("rtpm-eventd", "a hub of events");
  rtpm::rpc::ServerConfig& server = configuration.settings.server;
  server = rtpm::events::server_config_for({});
  server.port = rtpm::events::kDefaultHubPort;
  // Two bands, so that urgent events do not queue behind the rest.
  server.lanes = {{.name = "events-low", .low = 0}, {.name = "events-high", .low = 16'384}};
  rtpm::options::add_server(options, configuration.settings);
  rtpm::options::add_caller(options, configuration.settings);
  options.add_registry(configuration.registry);
  options.add("name", configuration.name, "Name to bind at the registry; empty: none");
  options.add("allow-takeover", configuration.allows_takeover,
              "At the start, take the name from another server");
  rtpm::options::Options rare = options.rare();
  rare.add("subscriptions-max", configuration.subscriptions_max, "Maximum number of consumers",
           {1, 1024});
  rare.add("history", configuration.history, "Events of each type and source kept for late joiners",
           {0, 64});
  rare.add("quota", configuration.quota, "Events per second of one supplier");
  rare.add("link", configuration.links,
           "Hubs, by name or URL, to subscribe to for the consumers of this hub");
  rare.add("link-priority", configuration.link_priority, "Priority of the links");
  add_multicast(options, configuration);
  if (const auto exit_code = options.parse(argc, argv)) return *exit_code;
  return serve(configuration);
}
