// A virtual device inside an unmodified mpv, like the GVD server and supplier in Kino (§3.2 of the
// paper). mpv loads it with --script=rtpm-mpv.so.
#include <mpv/client.h>

#include <algorithm>
#include <cstdio>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "inside_driver.hpp"
#include "rtpm/gvd/holder.hpp"
#include "rtpm/gvd/offer.hpp"
#include "rtpm/gvd/publisher.hpp"
#include "rtpm/gvd/server.hpp"
#include "rtpm/introspection/catalog.hpp"
#include "rtpm/names/defaults.hpp"
#include "rtpm/names/registration.hpp"
#include "rtpm/names/resolver.hpp"
#include "rtpm/rpc/node.hpp"
#include "rtpm/rpc/server.hpp"
#include "rtpm/rt/log.hpp"

namespace rtpm::mpv_plugin {
namespace {

/// The value of `key` in mpv's --script-opts, "a=1,b=2".
std::string option(mpv_handle* handle, std::string_view key, std::string otherwise) {
  const std::unique_ptr<char, decltype(&mpv_free)> text(
      mpv_get_property_string(handle, "options/script-opts"), &mpv_free);
  std::string_view options = text ? text.get() : "";
  while (!options.empty()) {
    const std::string_view entry = options.substr(0, options.find(','));
    options.remove_prefix(std::min(options.size(), entry.size() + 1));
    const std::size_t equals = entry.find('=');
    if (entry.substr(0, equals) == key && equals != std::string_view::npos) {
      return std::string(entry.substr(equals + 1));
    }
  }
  return otherwise;
}

/// The device for this player: its driver, thread, object, events and name.
class Service {
 public:
  [[nodiscard]] expected<void, SetupError> start(const std::string& name,
                                                 const std::string& registry, Exchange& exchange) {
    resolver_.emplace(node_, registry);
    node_.use(*resolver_);
    publisher_.emplace(node_, gvd::DevicePublisherConfig{});
    auto observer = publisher_->add(name);
    if (!observer) return unexpected{observer.error()};
    gvd::DeviceServerConfig config;
    config.cycle.period = std::chrono::milliseconds{10};
    config.cycle.observer = *observer;
    auto device = gvd::DeviceServer::create(
        std::make_unique<InsideDriver>(exchange, "inside-" + name, name + "/base"),
        std::move(config));
    if (!device) return unexpected{device.error()};
    device_ = std::move(*device);
    auto server = rpc::Server::create({.name = "rtpm-mpv"});
    if (!server) return unexpected{server.error()};
    server_ = std::move(*server);
    if (auto added = server_->add(name, device_->servant()); !added) return added;
    catalog_.add(name, device_->servant());
    if (auto added = server_->add(gvd::holder_path(name), device_->holder_servant()); !added)
      return added;
    catalog_.add(gvd::holder_path(name), device_->holder_servant());
    if (auto added = catalog_.serve(*server_); !added) return added;
    if (auto started = publisher_->start(); !started) return started;
    if (auto started = device_->start(); !started) return started;
    if (auto started = server_->start(); !started) return started;
    auto bound = names::Registration::create(
        node_, registry, name, server_->url(name), std::string(device_->servant().interface().name),
        names::Registration::kDefaultLease, {}, names::Takeover::kRefused,
        gvd::properties_of(device_->descriptor(), device_->descriptor().rate_hz));
    if (!bound) return unexpected{bound.error()};
    registration_ = std::move(*bound);
    std::printf("serving %s at %s\n", name.c_str(), server_->url(name).c_str());
    std::fflush(stdout);
    return {};
  }

 private:
  // Declared in this order because each refers to those above it.
  rpc::Node node_{{.wait = {.strategy = rt::WaitStrategy::kBlock}}};
  std::optional<names::RegistryResolver> resolver_{};
  std::optional<gvd::DevicePublisher> publisher_{};
  std::unique_ptr<gvd::DeviceServer> device_{};
  introspection::Catalog catalog_{};
  std::unique_ptr<rpc::Server> server_{};
  std::unique_ptr<names::Registration> registration_{};
};

/// Interval of polling mpv's state. The thread waits for mpv's events, so it notices at once when
/// mpv exits.
constexpr double kTurnSeconds = 0.0025;

int run(mpv_handle* handle) {
  Exchange exchange;
  Player player(handle);
  exchange.state.write(player.look());
  Service service;
  const auto started =
      service.start(option(handle, "rtpm-name", "lab/mpv0"),
                    option(handle, "rtpm-registry", std::string(names::kThisHost)), exchange);
  if (!started) {
    rt::print_error("rtpm-mpv", started.error().text());
    return -1;
  }
  while (mpv_wait_event(handle, kTurnSeconds)->event_id != MPV_EVENT_SHUTDOWN) {
    if (const auto request = exchange.request.read()) player.apply(*request);
    exchange.state.write(player.look());
  }
  exchange.is_over.store(true, std::memory_order_relaxed);
  return 0;
}

}  // namespace
}  // namespace rtpm::mpv_plugin

/// @source   mpv's manual, "C plugins"
extern "C" [[gnu::visibility("default")]] int mpv_open_cplugin(mpv_handle* handle) {
  return rtpm::mpv_plugin::run(handle);
}
