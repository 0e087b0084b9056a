#pragma once

#include <string>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/discovery/scope.hpp"
#include "rtpm/transport/lan_socket.hpp"

namespace rtpm::discovery {

/// The multicast address of a domain: "239.255.43.7" for domain 7.
/// @source   spec/hprotocol.md#hp-10.1
[[nodiscard]] std::string group_of(std::uint8_t domain);

/// The interfaces of a kLan scope; reports them once per program.
/// @errors   those of multicast_interfaces()
[[nodiscard]] expected<std::vector<transport::NetworkInterface>, SetupError> interfaces_of(
    const Scope& scope);

/// Writes a sentence to standard error, once per program.
void say_once(const std::string& sentence);

}  // namespace rtpm::discovery
