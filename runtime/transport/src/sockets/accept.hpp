#pragma once

#include "rtpm/transport/socket.hpp"

namespace rtpm::transport {

/// How many connections may wait to be accepted, where the system does not allow fewer
/// (net.core.somaxconn).
inline constexpr int kBacklog = 1024;

/// A descriptor that is of no use but to be given up when no other is left.
[[nodiscard]] Descriptor spare_descriptor() noexcept;

/// The next connection of a listening socket, non-blocking. Where no descriptor is left the
/// connection is ended: it would wake its acceptor again and again, and its client would wait for
/// nothing. `spare` is room enough for that, unless another thread took its place before.
[[nodiscard]] Accepted accept_or_turn_away(int listener, Descriptor& spare) noexcept;

}  // namespace rtpm::transport
