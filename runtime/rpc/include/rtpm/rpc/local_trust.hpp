#pragma once

#include <cstdint>
#include <string>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/rpc/node.hpp"

namespace rtpm::rpc {

/// Whether the node may trust the server at this loopback address: known_servers has a key for it,
/// or its sockets belong to this user, root, or a user in a `local uid:` line. Also true if nothing
/// listens there.
/// @threads  any
/// @realtime set-up only
/// @errors   the server belongs to another user (the text gives the uid), or the system does not
///           tell its user
[[nodiscard]] expected<void, SetupError> check_local_server(Node& node, const std::string& host,
                                                            std::uint16_t port);

}  // namespace rtpm::rpc
