#pragma once

#include <cstdint>
#include <iosfwd>
#include <vector>

#include "rtpm/transport/socket_users.hpp"

namespace rtpm::transport {

/// The users at an address in one table of /proc/net, for TCP or UDP sockets.
/// @realtime set-up only
[[nodiscard]] std::vector<std::uint32_t> users_in_table(std::istream& table, bool is_tcp,
                                                        const SocketAddress& address);

}  // namespace rtpm::transport
