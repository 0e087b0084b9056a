#include "console.hpp"

#include <algorithm>
#include <array>
#include <utility>

#include "graph/connection_graph.hpp"
#include "live/state_json.hpp"
#include "rtpm/names/defaults.hpp"
#include "rtpm/names/registry_list.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/utc.hpp"
#include "rtpm/wire/url.hpp"
#include "web/host_name.hpp"

namespace rtpm::console {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::string_view kDeviceInterface = "rtpm.device.Device";
constexpr std::string_view kMediumInterface = "rtpm.media.Medium";
constexpr std::string_view kConfigurationEnd = "/config";
constexpr Duration kLaneInterval = std::chrono::milliseconds{250};
constexpr Duration kObjectInterval = std::chrono::seconds{1};
constexpr Duration kProbeInterval = std::chrono::milliseconds{50};
constexpr Duration kHubInterval = std::chrono::milliseconds{100};
constexpr Duration kReportInterval = std::chrono::seconds{1};
constexpr Duration kMediaInterval = std::chrono::milliseconds{100};
constexpr Duration kStateInterval = std::chrono::milliseconds{250};
constexpr Duration kLatencyInterval = std::chrono::seconds{1};
constexpr Duration kIdleInterval = std::chrono::seconds{1};
/// The interval between attempts to deliver a stop; each attempt takes up to a second.
constexpr Duration kDeliverInterval = std::chrono::milliseconds{100};
constexpr std::size_t kLostCountMax = 1024;
constexpr Duration kRenewInterval = std::chrono::milliseconds{300};
constexpr Duration kParameterInterval = std::chrono::seconds{2};
constexpr Duration kMarkInterval = std::chrono::milliseconds{100};
constexpr std::size_t kGarbageCountMax = 10;

/// A hub given by name is found together with all other hubs.
gvd::StopDeliveryConfig stop_config(const Configuration& configuration) {
  const bool is_url = configuration.events.starts_with("rtpm://");
  return {.where = configuration.registry, .hub = is_url ? configuration.events : ""};
}

/// The URLs of the registry, "URL,URL"; this host's registry if it is not named by URLs.
std::vector<std::string> registry_urls(std::string_view registry) {
  return names::registries_of(registry.starts_with("rtpm://") ? registry
                                                              : names::kDefaultRegistryUrl);
}

}  // namespace

Console::Console(rpc::Node& node, const Configuration& configuration, Post post)
    : node_(node),
      configuration_(configuration),
      post_(std::move(post)),
      begin_(rt::now()),
      session_id_(std::to_string(rt::utc_ns(begin_))),
      channels_(clients_),
      event_channels_(channels_),
      media_channels_(channels_),
      router_(clients_),
      stops_(node, stop_config(configuration), router_, urgent_, post_),
      desk_(router_, pool_, post_,
            {[this] {
               std::vector<std::string> names;
               for (const auto& [name, device] : devices_)
                 names.push_back(name);
               return names;
             },
             [this](const std::string& name) {
               const auto found = devices_.find(name);
               return found == devices_.end() ? nullptr : found->second.link();
             }}),
      incidents_({configuration.incidents, configuration.recordings}, router_, channels_, post_,
                 [this](std::uint64_t connection_id) { return desk_.name_of(connection_id); }),
      objects_services_(node, router_, desk_, pool_, background_, post_,
                        [this](const std::string& name) {
                          const auto found = devices_.find(name);
                          return found == devices_.end() ? nullptr : found->second.link();
                        }),
      history_(router_),
      parameters_(node, clients_, pool_, background_, post_,
                  [this](const auto& object, const auto& numbers) {
                    history_.take_parameters(object, numbers);
                  }),
      records_(node, {configuration.events, configuration.registry, configuration.recordings},
               router_, channels_, pool_, post_),
      downloads_(configuration.recordings, router_, post_),
      marks_(node, configuration.events, router_, channels_, pool_, post_),
      reviews_(
          records_.folder(), [this](const std::string& file) { return records_.use_of(file); },
          router_, post_),
      hub_(node, configuration.events, post_,
           {[this](const HubEvent& event) { take_event(event); },
            [this](const Standing& standing) { hub_standing_ = standing; },
            [this](std::shared_ptr<const events::HubTypes> types) {
              history_.set_types(types);
              event_channels_.set_types(std::move(types));
            }}),
      device_watch_(node),
      media_watch_(node, post_, [this](const MediumView& view) { media_channels_.take(view); }) {
  channels_.add({.topic = "console/state", .encoding = "json"});
  channels_.add({.topic = "console/latency", .encoding = "json"});
  channels_.add({.topic = "console/log", .encoding = "json"});
}

Console::~Console() = default;

expected<void, SetupError> Console::start(
    const std::function<void(Duration, std::function<void()>)>& every) {
  stops_.start();
  desk_.start();
  history_.start();
  if (auto started = records_.start(); !started) return started;
  if (auto started = downloads_.start(); !started) return started;
  marks_.start();
  if (auto started = reviews_.start(); !started) return started;
  if (auto started = incidents_.start(); !started) return started;
  router_.add_json(
      "console/dismiss",
      [this](const PendingCall& call, const nlohmann::json& request) { dismiss(call, request); });
  add_log_filter();
  if (auto started = pool_.start({}); !started) return started;
  if (auto started = background_.start({.name = "console-look", .thread_count = 4}); !started) {
    return started;
  }
  if (auto started = urgent_.start({.name = "console-stop", .thread_count = 4}); !started) {
    return started;
  }
  if (auto started = start_threads(); !started) return started;
  history_.follow_clock(rt::now());
  every(kStateInterval, [this] { history_.follow_clock(rt::now()); });
  every(kStateInterval, [this] { publish_state(); });
  every(kLatencyInterval, [this] { publish_latency(); });
  every(kLatencyInterval, [this] { publish_graph(); });
  every(kLatencyInterval, [this] { incidents_.publish(rt::now()); });
  every(kMediaInterval, [this] { media_watch_.set_watched(media_channels_.watched()); });
  every(kIdleInterval, [this] { event_channels_.drop_idle(rt::now()); });
  every(kIdleInterval, [this] { downloads_.expire(rt::now()); });
  every(kRenewInterval, [this] { desk_.renew(rt::now()); });
  every(kParameterInterval, [this] { parameters_.poll(); });
  every(kMarkInterval, [this] { marks_.flush(); });
  return {};
}

expected<void, SetupError> Console::start_threads() {
  const auto lanes = std::make_shared<LaneWatch>();
  const auto objects = std::make_shared<ObjectWatch>(node_, configuration_.registry);
  const auto report = std::make_shared<HubReport>(node_, configuration_.events);
  struct Watch {
    PeriodicThread& thread;
    const char* name;
    Duration period;
    std::function<void()> work;
  };
  const std::array watches{
      Watch{lane_thread_, "console-lanes", kLaneInterval,
            [this, lanes] { post_([this, servers = lanes->look()] { servers_ = servers; }); }},
      Watch{object_thread_, "console-names", kObjectInterval,
            [this, objects] { post_([this, view = objects->look()] { take_objects(view); }); }},
      Watch{probe_thread_, "console-probe", kProbeInterval,
            [this] {
              for (const DeviceProbe& probe : device_watch_.look())
                post_([this, probe] { take_probe(probe); });
            }},
      Watch{hub_thread_, "console-hub", kHubInterval, [this] { hub_.look(); }},
      Watch{report_thread_, "console-report", kReportInterval,
            [this, report] { post_([this, view = report->look()] { hub_view_ = view; }); }},
      Watch{media_thread_, "console-media", kMediaInterval, [this] { media_watch_.look(); }},
      Watch{stop_thread_, "console-stop", kDeliverInterval, [this] { stops_.deliver(); }}};
  for (const Watch& watch : watches) {
    if (auto started = watch.thread.start(watch.name, watch.period, watch.work); !started) {
      return started;
    }
  }
  return {};
}

void Console::stop() {
  for (PeriodicThread* const thread : {&lane_thread_, &object_thread_, &probe_thread_, &hub_thread_,
                                       &report_thread_, &stop_thread_, &media_thread_}) {
    thread->stop();
  }
  media_watch_.stop();
  records_.stop_reading();
  downloads_.stop();
  reviews_.stop();
  pool_.stop();
  background_.stop();
  urgent_.stop();
  hub_.stop();
  desk_.release_all();
  records_.close();
  incidents_.stop();
}

void Console::on_open(Connection& connection) {
  Client& client = clients_.add(connection);
  const std::uint64_t id = connection.id();
  const bool may_command = connection.may_command();
  if (may_command) desk_.on_open(id, rt::now());
  foxglove::ServerInfo info{
      .name = "rtpm-console",
      .capabilities = {"parameters", "parametersSubscribe", "connectionGraph"},
      .encodings = {"json", "flatbuffer"},
      .metadata = {{"rtpm.access", may_command ? "command" : "observe"},
                   {"rtpm.version", RTPM_VERSION},
                   {"rtpm.host", host_name()}},
      .session_id = session_id_};
  if (may_command) info.capabilities.emplace_back("services");
  clients_.send(id, foxglove::server_info(info));
  channels_.advertise_to(client);
  if (may_command) router_.advertise_to(client);
  if (connection.has_wrong_token()) {
    clients_.send_status(id, foxglove::StatusLevel::kWarning,
                         "the token of the URL is not that of this rtpm-console, so it is "
                         "read-only; open the URL that it printed");
  }
}

void Console::on_close(Connection& connection, MonotonicTime since) {
  const std::uint64_t id = connection.id();
  if (Client* const client = clients_.find(id)) channels_.remove_client(*client);
  clients_.remove(id);
  hub_.end_log(id);
  desk_.on_close(id, since);
  downloads_.on_close(id);
}

std::optional<Download> Console::take_download(std::string_view ticket) {
  return downloads_.take(ticket, rt::now());
}

std::vector<ServerAddress> Console::gateway_addresses(std::string_view to) const {
  std::vector<ServerAddress> addresses;
  const auto add = [&](std::string_view url) {
    const auto parsed = wire::parse_url(url);
    if (!parsed) return;
    for (const std::string& host : parsed->hosts) {
      ServerAddress address{host, parsed->port};
      if (std::ranges::count(addresses, address) == 0) addresses.push_back(std::move(address));
    }
  };
  if (to == kGatewayToNames) {
    for (const std::string& url : registry_urls(configuration_.registry))
      add(url);
    for (const ObjectView& object : objects_.objects)
      add(object.service_url);
    return addresses;
  }
  const bool is_bound = std::ranges::any_of(objects_.objects, [&](const ObjectView& object) {
    const auto url = wire::parse_url(object.url);
    return url && std::ranges::any_of(url->hosts, [&](const std::string& host) {
             return wire::host_and_port(host, url->port) == to;
           });
  });
  if (is_bound) add("rtpm://" + std::string(to) + "/x");
  return addresses;
}

void Console::on_text(Connection& connection, std::string_view text) {
  auto request = foxglove::read_text(text, connection.may_command());
  if (!request) return take_garbage(connection.id(), request.error());
  Client* const client = clients_.find(connection.id());
  if (client == nullptr) return;
  client->garbage_count = 0;
  take_text(connection.id(), std::move(*request));
}

void Console::on_binary(Connection& connection, ConstBytes bytes) {
  const auto call = foxglove::read_binary(bytes);
  if (!call) return take_garbage(connection.id(), call.error());
  Client* const client = clients_.find(connection.id());
  if (client == nullptr) return;
  client->garbage_count = 0;
  router_.call(*client, *call);
}

void Console::take_garbage(std::uint64_t id, const std::string& why) {
  Client* const client = clients_.find(id);
  if (client == nullptr) return;
  if (++client->garbage_count >= kGarbageCountMax) {
    return client->connection->close(CloseCode::kProtocolError, "ten malformed frames in a row");
  }
  clients_.send_status(id, foxglove::StatusLevel::kError, why);
}

void Console::take_text(std::uint64_t id, foxglove::TextRequest request) {
  Client& client = *clients_.find(id);
  const auto tell = [&](const std::vector<std::string>& faults) {
    for (const std::string& fault : faults)
      clients_.send_status(id, foxglove::StatusLevel::kWarning, fault);
  };
  const auto has_room = [&] {
    const bool may_command = client.connection->may_command();
    if (client.open_call_count < (may_command ? kOpenCallCountMax : kOpenReadCountMax)) return true;
    tell({"too many requests of this connection are under way; wait for their answers"});
    return false;
  };
  if (const auto* const subscribe = std::get_if<foxglove::Subscribe>(&request)) {
    tell(channels_.subscribe(client, *subscribe));
    marks_.greet(id, *subscribe);
  } else if (const auto* const unsubscribe = std::get_if<foxglove::Unsubscribe>(&request)) {
    tell(channels_.unsubscribe(client, *unsubscribe));
  } else if (const auto* const get = std::get_if<foxglove::GetParameters>(&request)) {
    if (has_room()) parameters_.get(client, *get);
  } else if (const auto* const set = std::get_if<foxglove::SetParameters>(&request)) {
    if (has_room()) parameters_.set(client, *set);
  } else if (const auto* const watch = std::get_if<foxglove::WatchParameters>(&request)) {
    parameters_.watch(client, *watch);
  } else if (const auto* const graph = std::get_if<foxglove::WatchGraph>(&request)) {
    client.watches_graph = graph->is_watching;
    if (graph->is_watching) clients_.send(id, foxglove::graph_update({}, graph_));
  } else if (const auto* const other = std::get_if<foxglove::Unsupported>(&request)) {
    tell({"this server has no capability for '" + other->op + "'"});
  }
}

void Console::take_objects(const ObjectsView& view) {
  objects_ = view;
  std::vector<std::string> devices;
  std::vector<std::string> configured;
  std::set<std::string> media;
  for (const ObjectView& object : view.objects) {
    if (object.interface == kDeviceInterface) {
      devices.push_back(object.name);
      devices_.try_emplace(object.name, object.name).first->second.set_bound(object.service_url);
      stops_.remember(object.name, object.url);
    }
    if (object.interface == kMediumInterface) media.insert(object.name);
    if (object.interface == "rtpm.configuration.Configuration" &&
        object.name.ends_with(kConfigurationEnd)) {
      configured.push_back(object.name.substr(0, object.name.size() - kConfigurationEnd.size()));
    }
  }
  device_names_ = {devices.begin(), devices.end()};
  take_lost(view);
  device_watch_.set_devices(devices);
  hub_.set_devices(devices);
  event_channels_.set_devices(device_names_);
  media_channels_.set_media(media);
  parameters_.set_objects(std::move(configured));
  objects_services_.set_objects(view.objects);
}

// A device whose name was unbound has ended normally; any other missing device is lost until it is
// back or dismissed.
void Console::take_lost(const ObjectsView& view) {
  const MonotonicTime now = rt::now();
  decltype(dismissed_) still_lapsed;
  for (const names::LapsedName& each : view.lapsed) {
    const std::tuple key{each.service_url, each.name, each.revision};
    if (dismissed_.contains(key)) {
      still_lapsed.insert(key);
      continue;
    }
    if (each.interface != kDeviceInterface || device_names_.contains(each.name)) continue;
    if (devices_.size() >= kLostCountMax && !devices_.contains(each.name)) continue;
    devices_.try_emplace(each.name, each.name)
        .first->second.set_lost(now - each.lapsed_for, each.url);
    stops_.remember(each.name, each.url);
  }
  dismissed_ = std::move(still_lapsed);
  const std::set<std::string> owed = stops_.owed_devices();
  for (auto each = devices_.begin(); each != devices_.end();) {
    auto& [name, device] = *each;
    if (device_names_.contains(name) || device.is_lost()) {
      ++each;
      continue;
    }
    const bool is_unbound = std::ranges::count(view.lapsed_services, device.service_url()) > 0;
    if (is_unbound && !owed.contains(name)) {
      stops_.dismiss(name);
      each = devices_.erase(each);
    } else {
      device.set_lost(now, {});
      ++each;
    }
  }
}

void Console::dismiss(const PendingCall& call, const nlohmann::json& request) {
  const auto named = request.find("device");
  const std::string name =
      named != request.end() && named->is_string() ? named->get<std::string>() : "";
  const auto device = devices_.find(name);
  const bool is_lost = device != devices_.end() && device->second.is_lost();
  if (!is_lost && !stops_.owed_devices().contains(name)) {
    return router_.fail(call, "'" + name + "' is neither lost nor waits for a stop");
  }
  stops_.dismiss(name);
  if (is_lost) devices_.erase(device);
  std::vector<names::LapsedName> lapsed;
  for (const names::LapsedName& each : objects_.lapsed) {
    if (each.name != name) continue;
    dismissed_.emplace(each.service_url, each.name, each.revision);
    lapsed.push_back(each);
  }
  // Even if the registry refuses, the name stays dismissed here.
  const bool is_queued = pool_.run("dismiss", [this, lapsed] {
    for (const names::LapsedName& each : lapsed)
      static_cast<void>(names::dismiss(node_, each));
  });
  static_cast<void>(is_queued);
  router_.succeed(call, Json{{"ok", true}});
}

void Console::take_probe(const DeviceProbe& probe) {
  const auto device = devices_.find(probe.name);
  if (device != devices_.end()) device->second.take(probe, rt::now());
  if (!probe.descriptor) return;
  event_channels_.set_descriptor(probe.name, probe.descriptor);
  history_.set_descriptor(probe.name, probe.descriptor);
}

void Console::take_event(const HubEvent& event) {
  if (event.stream == EventStream::kLog) return event_channels_.publish_log(event);
  if (event.stream == EventStream::kMark) return marks_.take(event);
  const std::string* const name = event_channels_.device_of(event.header.source);
  const auto device = name == nullptr ? devices_.end() : devices_.find(*name);
  if (device != devices_.end()) take_device_event(event, device->second, parameters_);
  event_channels_.publish(event);
  history_.take(event, name);
}

void Console::add_log_filter() {
  router_.add_json(
      "console/log_filter",
      [this](const PendingCall& call, const nlohmann::json& request) { set_log(call, request); });
}

void Console::set_log(const PendingCall& call, const nlohmann::json& request) {
  const auto filter = request.find("filter");
  if (filter != request.end() && filter->is_null()) {
    hub_.end_log(call.connection_id);
    return router_.succeed(call, Json{{"ok", true}});
  }
  if (filter == request.end() || !filter->is_string()) {
    return router_.fail(call, "log_filter needs `filter`: a text, or null to end the log");
  }
  const bool is_queued = pool_.run("hub", [this, call, text = filter->get<std::string>()] {
    const auto set = hub_.set_log(call.connection_id, text);
    post_([this, call, set] {
      // The connection has closed meanwhile, so nothing else would end its log.
      if (clients_.find(call.connection_id) == nullptr) hub_.end_log(call.connection_id);
      if (set) return router_.succeed(call, Json{{"ok", true}});
      router_.succeed(
          call, Json{{"ok", false}, {"offset", set.error().offset}, {"what", set.error().what}});
    });
  });
  if (!is_queued) router_.fail(call, "too much waits to be done; try again");
}

Json Console::state() const {
  const MonotonicTime now = rt::now();
  Json events = event_channels_.state();
  events["dropped_count"] = hub_.dropped_count();
  Json devices = Json::array();
  for (const auto& [name, device] : devices_) {
    devices.push_back(device.json(now, parameters_.has(name), desk_.left(name, now)));
    desk_.add_operator(name, now, devices.back()["lease"]);
  }
  Json objects = Json::array();
  for (const ObjectView& object : objects_.objects) {
    objects.push_back(
        {{"name", object.name}, {"interface", object.interface}, {"url", object.url}});
  }
  const HubReportView none;
  const HubReportView& hub = hub_standing_.is_ok ? hub_view_ : none;
  return {{"time_ns", rt::utc_ns(now)},
          {"uptime_s", std::chrono::duration<double>(now - begin_).count()},
          {"registry",
           {{"url", configuration_.registry},
            {"ok", objects_.registry.is_ok},
            {"problem", objects_.registry.problem}}},
          {"hub",
           {{"name", configuration_.events},
            {"ok", hub_standing_.is_ok},
            {"problem", hub_standing_.problem},
            {"consumer_count", hub.consumers.size()},
            {"consumers", consumers_json(hub.consumers)},
            {"event_per_s", hub.event_per_s}}},
          {"events", std::move(events)},
          {"servers", servers_json(servers_)},
          {"objects", std::move(objects)},
          {"devices", std::move(devices)},
          {"media", media_channels_.state()},
          {"not_stopped", stops_.owed_json(now)},
          {"recording", records_.recording_json()},
          {"replay", records_.replay_json()},
          {"history", history_.state()},
          {"clients", {{"count", clients_.count()}, {"dropped_count", clients_.dropped_count()}}}};
}

void Console::publish_state() {
  const MonotonicTime now = rt::now();
  Json shown = state();
  incidents_.observe(shown, now);
  const std::uint32_t channel = channels_.find("console/state");
  if (!channels_.has_subscriber(channel)) return;
  shown["incidents"] = incidents_.state_json();
  channels_.publish(channel, rt::utc_ns(now), foxglove::dumped(shown));
}

void Console::publish_latency() {
  const std::uint32_t channel = channels_.find("console/latency");
  if (!channels_.has_subscriber(channel)) return;
  const MonotonicTime now = rt::now();
  Json latency{{"targets", Json::array()}};
  for (auto& [name, device] : devices_)
    latency["targets"].push_back(latency_json(name, device.latency().summary(now)));
  channels_.publish(channel, rt::utc_ns(now), foxglove::dumped(latency));
}

void Console::publish_graph() {
  foxglove::Graph graph = connection_graph(channels_, router_, objects_.objects, device_names_);
  if (graph == graph_) return;
  const auto text = std::make_shared<const std::string>(foxglove::graph_update(graph_, graph));
  graph_ = std::move(graph);
  clients_.for_each([&](Client& client) {
    if (client.watches_graph) client.connection->send_text(text);
  });
}

}  // namespace rtpm::console
