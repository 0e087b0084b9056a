#include "rtpm/rpc/local_trust.hpp"

#include <vector>

#include "client/node_impl.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/transport/address.hpp"
#include "rtpm/transport/socket_users.hpp"

namespace rtpm::rpc {

expected<void, SetupError> check_local_server(Node& node, const std::string& host,
                                              std::uint16_t port) {
  const auto address = transport::SocketAddress::parse(host, port);
  if (!address || !address->is_loopback()) {
    return setup_error("'" + printable(host) + "' is no loopback address");
  }
  const auto keys = node.impl().keys.keys_of(host, *address);
  if (!keys) return unexpected{keys.error()};
  if (!keys->empty()) return {};
  const auto users = transport::users_at(*address);
  if (!users) {
    return setup_error("the system does not tell whose server is at " + address->text(), "",
                       "give its URL");
  }
  const std::vector<std::uint32_t> trusted = node.impl().keys.trusted_users();
  for (const std::uint32_t user : *users) {
    if (transport::is_trusted_user(user, trusted)) continue;
    return setup_error("the server at " + address->text() + " is another user's",
                       "it is of user " + std::to_string(user),
                       "trust that user's servers by a line 'local uid:" + std::to_string(user) +
                           "' in known_servers, or learn its key (rtpm key learn)");
  }
  return {};
}

}  // namespace rtpm::rpc
