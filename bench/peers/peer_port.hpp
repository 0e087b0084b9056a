#pragma once

#include <cstdint>
#include <string>

namespace rtpm::bench {

/// A TCP port of this host that nobody uses, for servers that are to be told one.   Set-up only.
[[nodiscard]] std::uint16_t free_port();
/// Waits until something accepts connections at the port, for ten seconds at most; false if nothing
/// did.   Set-up only.
[[nodiscard]] bool wait_for_port(std::uint16_t port);
/// As wait_for_port(), of the Unix socket at `path`.
[[nodiscard]] bool wait_for_socket(const std::string& path);

}  // namespace rtpm::bench
