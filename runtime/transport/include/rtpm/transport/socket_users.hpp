#pragma once

#include <cstdint>
#include <iosfwd>
#include <optional>
#include <span>
#include <vector>

#include "rtpm/transport/address.hpp"

namespace rtpm::transport {

/// The users, each once, with a socket of this host that takes datagrams or connections to the
/// address: at the address itself, or at all addresses. nullopt if the system hides them.
/// @realtime set-up only
[[nodiscard]] std::optional<std::vector<std::uint32_t>> users_at(const SocketAddress& address);

/// Whether servers of the user are trusted as those of `others`, of this user and of root are.
/// @realtime alloc-free, one system call
[[nodiscard]] bool is_trusted_user(std::uint32_t user,
                                   std::span<const std::uint32_t> others) noexcept;

/// The users at an address in one table of /proc/net, of TCP's sockets or of UDP's.
/// @realtime set-up only
[[nodiscard]] std::vector<std::uint32_t> users_in_table(std::istream& table, bool is_tcp,
                                                        const SocketAddress& address);

}  // namespace rtpm::transport
