#pragma once

#include <array>
#include <optional>
#include <string_view>

#include "rtpm/crypto/primitives.hpp"

namespace rtpm::crypto {

/// The prefix of a key's text: "rtpm25519 " and 44 characters of Base64 (RFC 4648, padded).
inline constexpr std::string_view kKeyTextName = "rtpm25519";

/// 32 bytes in Base64, as in key files. The text of a private key is secret: wipe it.
using KeyText = std::array<char, 44>;

/// @realtime alloc-free
void encode_key(std::span<const std::byte, kKeySize> key, KeyText& text) noexcept;
/// @param key  receives 32 bytes; unspecified on failure
/// @return false if `text` is not 44 characters of Base64 for 32 bytes
/// @realtime alloc-free
[[nodiscard]] bool decode_key(std::string_view text, std::span<std::byte, kKeySize> key) noexcept;

}  // namespace rtpm::crypto
