#pragma once

#include <cstdint>
#include <string>

#include "rtpm/base/expected.hpp"
#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/crypto/primitives.hpp"

namespace rtpm::rpc {

/// Asks the server at host:port for its public key, over UDP. The answer is not authenticated:
/// compare it with the key that the server itself shows before trusting it.
/// @realtime set-up only
/// @errors   no answer by `deadline`; the server has no sealed sessions; the host is unknown
/// @source   spec/security.md#sec-3.1
[[nodiscard]] expected<crypto::PublicKey, SetupError> ask_server_key(const std::string& host,
                                                                     std::uint16_t port,
                                                                     MonotonicTime deadline);

}  // namespace rtpm::rpc
