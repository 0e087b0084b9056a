#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "rtpm/transport/address.hpp"

namespace rtpm::transport {

/// The users that have a socket on this host which receives datagrams or connections at the
/// address: bound to it, or to all addresses. Without duplicates; nullopt if the system hides them.
/// Where users have no numbers, this one and the system are 0.
/// @realtime set-up only
[[nodiscard]] std::optional<std::vector<std::uint32_t>> users_at(const SocketAddress& address);

/// Whether servers of the user are trusted: a user among `others`, this user, or root.
/// @realtime alloc-free, one system call
[[nodiscard]] bool is_trusted_user(std::uint32_t user,
                                   std::span<const std::uint32_t> others) noexcept;

}  // namespace rtpm::transport
