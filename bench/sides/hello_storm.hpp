#pragma once

#include <cstdint>

#include "sides/caller.hpp"

namespace rtpm::bench {

inline constexpr int kHellosPerSecond = 1000;

/// Sends 1000 HELLOs a second to a server of sealed sessions, one per call, from 16 addresses of
/// this host. Half of them ask for a cookie, the others have one and a message 1 without a valid
/// seal: the server computes with its key before it detects that.
/// @param port  the server's port at 127.0.0.1
/// @realtime set-up only
[[nodiscard]] Outcome<Call> make_hello_storm(std::uint16_t port);

/// `call` a thousand times a second.
[[nodiscard]] Call paced_as_hellos(Call call);

}  // namespace rtpm::bench
