#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "rtpm/crypto/primitives.hpp"

namespace rtpm::access {

/// The short form of a public key, for logs and for people who compare keys: the first 10 bytes of
/// the key's SHA-256 as hexadecimal digits, "3f2a-91c0-77de-0b14-a5c2".
/// @realtime set-up only
/// @source   spec/security.md#sec-2
[[nodiscard]] std::string fingerprint(const crypto::PublicKey& key);

/// Whether `text` is the fingerprint of `key`; ignores case and missing dashes.
[[nodiscard]] bool is_fingerprint_of(std::string_view text, const crypto::PublicKey& key);

/// "rtpm25519 BASE64", the form of a public key in files and on command lines.
/// @realtime set-up only
[[nodiscard]] std::string public_key_text(const crypto::PublicKey& key);
/// Parses such a text; ignores what follows the key, such as its comment. nullopt if it contains no
/// key.
[[nodiscard]] std::optional<crypto::PublicKey> parse_public_key(std::string_view text);

}  // namespace rtpm::access
