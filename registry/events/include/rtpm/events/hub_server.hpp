#pragma once

#include <memory>
#include <optional>
#include <string>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/events/defaults.hpp"
#include "rtpm/events/hub.hpp"
#include "rtpm/names/defaults.hpp"
#include "rtpm/names/registration.hpp"
#include "rtpm/rpc/error.hpp"
#include "rtpm/rpc/node.hpp"
#include "rtpm/rpc/server.hpp"

namespace rtpm::introspection {
class Catalog;
}  // namespace rtpm::introspection

namespace rtpm::events {

/// Configures a HubServer.
struct HubServerConfig {
  HubConfig hub{};
  /// By default server_config_for(hub), on a free port of the loopback interface.
  std::optional<rpc::ServerConfig> server{};
  std::string name{kHubPath};  ///< The hub's name at the registry; if empty, it has none.
  std::string registry{names::kThisHost};
};

/// A hub with its server and name: a hub in this program that other programs find by name and tools
/// can query, like rtpm-eventd. Suppliers in this program push without a call:
///
///     auto served = HubServer::create(node, {.name = "lab/events"}).value();
///     auto supplier = TouchedSupplier::create(served->hub());
///
/// A program with its own server adds the hub to it instead:
///
///     server->add(kHubPath, hub->servant());
///     auto name = register_hub(node, *server, "lab/events");
/// @ownership refers to its node, which must outlive it
/// @threads  any
class HubServer {
 public:
  /// @realtime set-up only; blocks
  /// @errors   those of Hub::create(), rpc::Server and names::Registration; nothing is served then
  [[nodiscard]] static expected<std::unique_ptr<HubServer>, SetupError> create(
      rpc::Node& node, const HubServerConfig& config = {});
  HubServer(const HubServer&) = delete;
  HubServer& operator=(const HubServer&) = delete;
  /// Unbinds the name, then ends server and hub.
  ~HubServer();

  [[nodiscard]] Hub& hub() noexcept { return *hub_; }
  /// The hub's URL, such as "rtpm://127.0.0.1:4711/rtpm/events".
  [[nodiscard]] std::string url() const { return server_->url(kHubPath); }

 private:
  HubServer() noexcept;

  std::unique_ptr<Hub> hub_{};
  std::unique_ptr<introspection::Catalog> catalog_{};
  std::unique_ptr<rpc::Server> server_{};
  std::unique_ptr<names::Registration> name_{};
};

/// Binds `name` to the hub that the started `server` serves at kHubPath, for the lifetime of the
/// result.
/// @realtime set-up only; blocks
/// @errors   those of names::Registration::create()
[[nodiscard]] expected<std::unique_ptr<names::Registration>, SetupError> register_hub(
    rpc::Node& node, const rpc::Server& server, const std::string& name = std::string(kHubPath),
    const std::string& registry = std::string(names::kThisHost));

}  // namespace rtpm::events
