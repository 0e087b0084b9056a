#include "device_events.hpp"

#include <utility>

namespace rtpm::deviced {
namespace {

/// A hub's name can't be resolved without a registry.
bool has_hub(const Configuration& configuration) {
  if (configuration.serves_events) return true;
  if (configuration.events == kNoHub) return false;
  return configuration.registry != kNoRegistry || configuration.events.starts_with("rtpm://");
}

events::HubServerConfig hub_config(const Configuration& configuration) {
  events::HubServerConfig config;
  config.hub.realtime = configuration.settings.server.realtime;
  auto server = events::server_config_for(config.hub);
  server.host = configuration.settings.server.host;
  server.advertise = configuration.settings.server.advertise;
  server.security = configuration.settings.server.security;
  server.realtime = configuration.settings.server.realtime;
  config.server = std::move(server);
  config.name = configuration.registry == kNoRegistry ? "" : configuration.events;
  config.registry = configuration.registry;
  return config;
}

}  // namespace

DeviceEvents::DeviceEvents(const Configuration& configuration)
    : hub_url_(has_hub(configuration) ? configuration.events : ""),
      realtime_(configuration.settings.server.realtime),
      stops_({.folder = configuration.stops_folder, .listener = &stop_reporter_}) {}

expected<std::unique_ptr<DeviceEvents>, SetupError> DeviceEvents::create(
    rpc::Node& node, const Configuration& configuration) {
  std::unique_ptr<DeviceEvents> made(new DeviceEvents(configuration));
  if (made->hub_url_.empty()) return made;
  gvd::DevicePublisherConfig config;
  if (configuration.serves_events) {
    auto hub = events::HubServer::create(node, hub_config(configuration));
    if (!hub) return unexpected{std::move(hub.error())};
    made->hub_ = std::move(*hub);
    made->hub_url_ = made->hub_->url();
    config.own_hub = &made->hub_->hub();
  }
  config.hub = made->hub_url_;
  config.thread.realtime = made->realtime_;
  config.listener = &made->reporter_;
  made->publisher_ = std::make_unique<gvd::DevicePublisher>(node, std::move(config));
  return made;
}

expected<gvd::CycleObserver*, SetupError> DeviceEvents::observe(std::string_view name) {
  if (publisher_ == nullptr) return nullptr;
  return publisher_->add(name);
}

expected<void, SetupError> DeviceEvents::start_publishing() {
  if (publisher_ == nullptr) return {};
  return publisher_->start();
}

expected<void, SetupError> DeviceEvents::start_stops(rpc::Node& node) {
  if (auto started = stops_.start(); !started) return started;
  if (publisher_ == nullptr) return {};
  gvd::SystemStopConfig config;
  config.hub = hub_url_;
  config.realtime = realtime_;
  auto system_stop = gvd::SystemStop::start(node, &stops_, config);
  if (!system_stop) return unexpected{std::move(system_stop.error())};
  system_stop_ = std::move(*system_stop);
  return {};
}

void DeviceEvents::stop() noexcept {
  system_stop_.reset();
  stops_.stop();
  if (publisher_ != nullptr) publisher_->stop();
}

void DeviceEvents::publish_configuration(std::string_view name, std::uint64_t revision,
                                         std::span<const std::string> names) {
  if (publisher_ != nullptr) publisher_->publish_configuration(name, revision, names);
}

void DeviceEvents::stop_devices() noexcept {
  stops_.stop_devices();
}

bool DeviceEvents::stop_system() noexcept {
  stop_devices();
  if (system_stop_ == nullptr) return false;
  system_stop_->request();
  return true;
}

}  // namespace rtpm::deviced
