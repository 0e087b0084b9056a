#pragma once

#include <cstdint>
#include <string>

#include "rtpm/access/address_range.hpp"
#include "rtpm/crypto/primitives.hpp"

namespace rtpm::access {

/// The id that the kernel shows for users that it can't name, such as those of another user
/// namespace. It never has grants.
inline constexpr std::uint32_t kUnknownUser = 65534;

/// The authenticated identity of a caller: by a key in a sealed session, by the kernel on this
/// host, or none.
struct Subject {
  enum class Kind : std::uint8_t { kAnonymous, kLocalUser, kKey };
  Kind kind = Kind::kAnonymous;
  std::uint32_t user = 0;   ///< The user id, for kLocalUser.
  crypto::PublicKey key{};  ///< The client's key, for kKey.
  friend bool operator==(const Subject&, const Subject&) noexcept = default;
};

/// The beginning of a line of `authorized`: "rtpm25519 BASE64", "uid:1000", "anonymous".
/// @realtime set-up only
[[nodiscard]] std::string to_text(const Subject& subject);

}  // namespace rtpm::access
