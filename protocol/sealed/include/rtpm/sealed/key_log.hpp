#pragma once

#include <cstdint>
#include <string>

#include "rtpm/crypto/handshake.hpp"

namespace rtpm::sealed {

/// A session's line in a key log, with the keys of generation 0.
/// @realtime set-up only
/// @source   spec/security.md#sec-9
[[nodiscard]] std::string key_log_line(std::uint64_t session, crypto::Suite suite,
                                       const crypto::Secret& client, const crypto::Secret& server);

/// Receives the keys of each new session, for a key log; unused if `hear` is null.
struct KeyListener {
  void (*hear)(void* context, std::uint64_t session, const crypto::SessionKeys& keys) = nullptr;
  void* context = nullptr;
};

}  // namespace rtpm::sealed
