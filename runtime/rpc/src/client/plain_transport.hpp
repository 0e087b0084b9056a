#pragma once

#include <memory>

#include "client/server_address.hpp"
#include "rtpm/transport/client_transport.hpp"
#include "security/node_keys.hpp"

namespace rtpm::rpc {

/// Opens the transport that the address names. Nothing on it is sealed, whatever key the address
/// has.
/// @realtime set-up only
/// @errors   as those of rtpm/transport
[[nodiscard]] expected<std::unique_ptr<transport::ClientTransport>, SetupError>
open_plain_transport(const ServerAddress& address, NodeKeys& keys, Priority priority,
                     MonotonicTime deadline);

}  // namespace rtpm::rpc
