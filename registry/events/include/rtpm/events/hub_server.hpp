#pragma once

#include <memory>
#include <optional>
#include <string>

#include "rtpm/base/expected.hpp"
#include "rtpm/events/defaults.hpp"
#include "rtpm/events/hub.hpp"
#include "rtpm/names/defaults.hpp"
#include "rtpm/names/registration.hpp"
#include "rtpm/rpc/error.hpp"
#include "rtpm/rpc/node.hpp"
#include "rtpm/rpc/server.hpp"

namespace rtpm::events {

/// How a program serves a hub of its own.
struct HubServerConfig {
  HubConfig hub{};
  /// None: server_config_for(hub), which listens on this host alone at a port that the system
  /// chooses.
  std::optional<rpc::ServerConfig> server{};
  std::string name{kHubPath};  ///< Under which others find the hub; empty: none.
  std::string registry{names::kDefaultRegistryUrl};
};

/// A hub in this program that others find by its name as they find rtpm-eventd: hub, server and
/// name in one. Its program's suppliers push without a call:
///
///     auto served = HubServer::create(node, {.name = "lab/events"}).value();
///     auto supplier = TouchedSupplier::create(served->hub());
///
/// A program that serves other objects, too, adds the hub to its own server instead:
///
///     server->add(kHubPath, hub->servant());
///     auto name = register_hub(node, *server, "lab/events");
/// @ownership refers to its node, which must outlive it
/// @threads  any
class HubServer {
 public:
  /// @realtime set-up only; blocks
  /// @errors   as Hub::create(), rpc::Server and names::Registration have them; then nothing is
  ///           served
  [[nodiscard]] static expected<std::unique_ptr<HubServer>, rpc::SetupError> create(
      rpc::Node& node, const HubServerConfig& config = {});
  HubServer(const HubServer&) = delete;
  HubServer& operator=(const HubServer&) = delete;
  /// Takes the name away, then ends the server, then the hub.
  ~HubServer();

  [[nodiscard]] Hub& hub() noexcept { return *hub_; }
  /// Where the hub is, "rtpm://127.0.0.1:4711/rtpm/events".
  [[nodiscard]] std::string url() const { return server_->url(kHubPath); }

 private:
  HubServer() = default;

  std::unique_ptr<Hub> hub_{};
  std::unique_ptr<rpc::Server> server_{};
  std::unique_ptr<names::Registration> name_{};
};

/// Binds `name` to the hub that `server`, which has started, serves at kHubPath, for as long as the
/// result lives.
/// @realtime set-up only; blocks
/// @errors   as names::Registration::create()
[[nodiscard]] expected<std::unique_ptr<names::Registration>, rpc::SetupError> register_hub(
    rpc::Node& node, const rpc::Server& server, const std::string& name = std::string(kHubPath),
    const std::string& registry = std::string(names::kDefaultRegistryUrl));

}  // namespace rtpm::events
