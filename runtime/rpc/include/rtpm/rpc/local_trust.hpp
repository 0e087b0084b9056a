#pragma once

#include <cstdint>
#include <string>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/rpc/node.hpp"

namespace rtpm::rpc {

/// Whether the node may rely on the server at this loopback address: known_servers has a key for
/// it, or its sockets are this user's, root's, or of the users in `local uid:` lines. If nothing
/// listens there, the node may.
/// @threads  any
/// @realtime set-up only
/// @errors   it is another user's, with that user's number; the system does not tell whose it is
[[nodiscard]] expected<void, SetupError> check_local_server(Node& node, const std::string& host,
                                                            std::uint16_t port);

}  // namespace rtpm::rpc
