#pragma once

#include <span>
#include <string>
#include <vector>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/names/directory.hpp"
#include "rtpm/transport/address.hpp"

namespace rtpm::names {

/// The URL of a bound name, with the hosts that this host can reach, in the order to try them: its
/// own addresses, if the server is on this host; those in a network that both share; then the other
/// addresses and host names, unchanged. If the server is on another host, loopback addresses and
/// this host's own addresses are left out.
/// @param own  this host's addresses, see transport::own_addresses()
/// @realtime set-up only
/// @errors   the server is on another host, and only serves its loopback addresses
[[nodiscard]] expected<std::string, SetupError> reachable_url(
    const NameEntry& entry, std::span<const transport::InterfaceAddress> own);
/// The reachable URL for this host's current addresses.
[[nodiscard]] expected<std::string, SetupError> reachable_url(const NameEntry& entry);

}  // namespace rtpm::names
