#pragma once

#include "rtpm/transport/socket.hpp"

namespace rtpm::transport {

/// A descriptor that is of no use but to be given up when no other is left.
[[nodiscard]] Descriptor spare_descriptor() noexcept;

/// The next connection of a listening socket, non-blocking; not open if there is none, or no
/// descriptor left. Then the connection is ended: it would wake its acceptor again and again, and
/// its client would wait for nothing. `spare` is room enough for that.
[[nodiscard]] Descriptor accept_or_turn_away(int listener, Descriptor& spare) noexcept;

}  // namespace rtpm::transport
