#include "finding/service_trust.hpp"

#include <optional>

#include "rtpm/rpc/local_trust.hpp"
#include "rtpm/transport/address.hpp"
#include "rtpm/wire/url.hpp"

namespace rtpm::names {

expected<void, SetupError> check_service(rpc::Node& node, const std::string& url) {
  const auto parts = wire::parse_url(url);
  if (!parts) return {};
  for (const std::string& host : parts->hosts) {
    const auto address = transport::SocketAddress::parse(host, parts->port);
    if (!address || !address->is_loopback()) continue;
    if (auto checked = rpc::check_local_server(node, host, parts->port); !checked) return checked;
  }
  return {};
}

}  // namespace rtpm::names
