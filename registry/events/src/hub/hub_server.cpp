#include "rtpm/events/hub_server.hpp"

#include <utility>

#include "idl.hpp"
#include "rtpm/introspection/catalog.hpp"

namespace rtpm::events {

expected<std::unique_ptr<HubServer>, SetupError> HubServer::create(rpc::Node& node,
                                                                   const HubServerConfig& config) {
  auto hub = Hub::create(config.hub);
  if (!hub) return unexpected{std::move(hub.error())};
  auto server = rpc::Server::create(config.server.value_or(server_config_for(config.hub)));
  if (!server) return unexpected{std::move(server.error())};
  std::unique_ptr<HubServer> served(new HubServer);
  served->hub_ = std::move(*hub);
  served->server_ = std::move(*server);
  if (auto added =
          served->server_->add(kHubPath, served->hub_->servant(), {.checks_callers = true});
      !added) {
    return unexpected{std::move(added.error())};
  }
  served->catalog_ = std::make_unique<introspection::Catalog>();
  served->catalog_->add(std::string(kHubPath), served->hub_->servant());
  if (auto added = served->catalog_->serve(*served->server_); !added) {
    return unexpected{std::move(added.error())};
  }
  if (auto started = served->server_->start(); !started) {
    return unexpected{std::move(started.error())};
  }
  if (config.name.empty()) return served;
  auto name = register_hub(node, *served->server_, config.name, config.registry);
  if (!name) return unexpected{std::move(name.error())};
  served->name_ = std::move(*name);
  return served;
}

HubServer::HubServer() noexcept = default;

HubServer::~HubServer() {
  name_.reset();
  if (server_) server_->stop();
}

expected<std::unique_ptr<names::Registration>, SetupError> register_hub(
    rpc::Node& node, const rpc::Server& server, const std::string& name,
    const std::string& registry) {
  return names::Registration::create(node, registry, name, server.url(kHubPath),
                                     std::string(HubClient::interface().name));
}

}  // namespace rtpm::events
