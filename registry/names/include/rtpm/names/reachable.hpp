#pragma once

#include <span>
#include <string>
#include <vector>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/names/directory.hpp"
#include "rtpm/transport/address.hpp"

namespace rtpm::names {

/// The URL of a bound name, with the hosts that this host can reach, in the order in which it is to
/// try them: its own addresses, if the server is on this host; those in a network that both share;
/// the others, and names, as they are. Of a server on another host this host's own addresses are
/// none, and neither are loopback ones.
/// @param own  this host's, see transport::own_addresses()
/// @realtime set-up only
/// @errors   the server is on another host, and serves its loopback addresses only
[[nodiscard]] expected<std::string, SetupError> reachable_url(
    const NameEntry& entry, std::span<const transport::InterfaceAddress> own);
/// The same with the addresses of now.
[[nodiscard]] expected<std::string, SetupError> reachable_url(const NameEntry& entry);

}  // namespace rtpm::names
