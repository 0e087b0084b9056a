#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "foxglove/replies.hpp"
#include "foxglove/requests.hpp"
#include "sessions/clients.hpp"

namespace rtpm::console {

/// The most unanswered calls of a client; more are refused.
inline constexpr std::size_t kOpenCallCountMax = 32;
/// The limit for a client that may not command, and so only reads parameters.
inline constexpr std::size_t kOpenReadCountMax = 4;

/// A call to be answered.
struct PendingCall {
  std::uint64_t connection_id = 0;
  std::uint32_t service_id = 0;
  std::uint32_t call_id = 0;
  std::string encoding{};  ///< "json" or "flatbuffer".
};

/// The services and their pending calls.
/// @ownership refers to the clients
/// @threads  the web server's thread
class CallRouter {
 public:
  /// Starts a call, which must later be answered exactly once by succeed() or fail().
  using Handler = std::function<void(const PendingCall& call, std::string payload)>;
  /// A handler for a service whose requests are JSON objects.
  using JsonHandler = std::function<void(const PendingCall& call, const nlohmann::json& request)>;

  explicit CallRouter(Clients& clients) noexcept : clients_(clients) {}

  /// Advertises services and chooses their ids.
  /// @param handlers  one for each service
  void add(std::vector<foxglove::ServiceInfo> services, std::vector<Handler> handlers);
  void add_json(const std::string& name, JsonHandler handler);
  void remove(const std::vector<std::string>& names);
  [[nodiscard]] std::vector<std::string> names() const;

  void advertise_to(Client& client) const;
  void call(Client& client, const foxglove::ServiceCall& call);
  void succeed(const PendingCall& call, std::string_view payload);
  void succeed(const PendingCall& call, const nlohmann::ordered_json& reply);
  void fail(const PendingCall& call, std::string_view why);

 private:
  struct Service {
    foxglove::ServiceInfo info{};
    Handler handler{};
  };
  void end(const PendingCall& call);
  template <class Visit>
  void for_commanding(const Visit& visit);

  Clients& clients_;
  std::map<std::uint32_t, Service> services_{};
  std::map<std::string, std::uint32_t> ids_{};
  std::uint32_t last_id_ = 0;
};

}  // namespace rtpm::console
