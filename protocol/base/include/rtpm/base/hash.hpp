#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

namespace rtpm::inline base {

/// FNV-1a, 64 bits: for names and fingerprints, if the input is not hostile.
[[nodiscard]] constexpr std::uint64_t fnv1a_64(
    std::string_view text, std::uint64_t basis = 0xcbf29ce484222325ULL) noexcept {
  std::uint64_t hash = basis;
  for (const char character : text) {
    hash ^= static_cast<std::uint8_t>(character);
    hash *= 0x100000001b3ULL;
  }
  return hash;
}

/// CRC-32 as in IEEE 802.3 and zlib, for device packets; `crc` is the CRC of the preceding bytes.
/// @realtime alloc-free, about 3 ns per byte
[[nodiscard]] std::uint32_t crc32(std::span<const std::byte> bytes, std::uint32_t crc = 0) noexcept;

/// The secret of a keyed hash, drawn at random once per process.
struct SipKey {
  std::uint64_t low = 0;
  std::uint64_t high = 0;
};

/// SipHash-2-4, 64 bits: a keyed hash that can't be forged without the key; for cookies.
/// @realtime alloc-free, about 20 ns for 40 bytes
/// @source   Aumasson and Bernstein, 2012
[[nodiscard]] std::uint64_t siphash_2_4(SipKey key, std::span<const std::byte> bytes) noexcept;

}  // namespace rtpm::inline base
