#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace rtpm::console {

/// The path of the gateway: "/gateway?to=names", "/gateway?to=127.0.0.1:4711", with the token.
inline constexpr std::string_view kGatewayPath = "/gateway";
/// The sub-protocol of the gateway: the bytes of a TCP connection of the H-Protocol.
inline constexpr std::string_view kGatewaySubprotocol = "rtpm.stream.v1";
/// `to` of the registry of names.
inline constexpr std::string_view kGatewayToNames = "names";

/// Where a server listens.
struct ServerAddress {
  std::string host{};  ///< Numeric, without brackets.
  std::uint16_t port = 0;
  friend bool operator==(const ServerAddress&, const ServerAddress&) = default;
};

/// Says to which servers pages may be connected.
/// @threads  called on the web server's thread
class GatewayTargets {
 public:
  GatewayTargets() = default;
  GatewayTargets(const GatewayTargets&) = delete;
  GatewayTargets& operator=(const GatewayTargets&) = delete;
  virtual ~GatewayTargets() = default;

  /// The addresses of a server, to be tried in order; empty if the registry names no such server.
  /// @param to  `kGatewayToNames`, or "host:port" as in the URL of a bound object
  [[nodiscard]] virtual std::vector<ServerAddress> gateway_addresses(std::string_view to) const = 0;
};

}  // namespace rtpm::console
