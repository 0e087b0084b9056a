#pragma once

#include <string>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/discovery/scope.hpp"
#include "rtpm/transport/lan_socket.hpp"

namespace rtpm::discovery {

/// "239.255.43.7" for domain 7.
/// @source   spec/hprotocol.md#hp-10.1
[[nodiscard]] std::string group_of(std::uint8_t domain);

/// The interfaces of a scope of kind kLan; says which they are, once in a program.
/// @errors   as multicast_interfaces()
[[nodiscard]] expected<std::vector<transport::NetworkInterface>, SetupError> interfaces_of(
    const Scope& scope);

/// Says a sentence on standard error, once in a program.
void say_once(const std::string& sentence);

}  // namespace rtpm::discovery
