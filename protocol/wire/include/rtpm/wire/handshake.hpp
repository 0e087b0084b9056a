#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "rtpm/base/bytes.hpp"
#include "rtpm/base/priority.hpp"
#include "rtpm/wire/limits.hpp"

namespace rtpm::wire {

/// Proves that a client receives at the address that it sends from.
using Cookie = std::array<std::byte, 16>;

/// The payload of HELLO.
/// @source   spec/hprotocol.md#hp-4.1
struct Hello {
  static constexpr std::size_t kSize = 64;

  std::uint16_t version_min = kVersion;  ///< The lowest version that the client supports.
  std::uint16_t version_max = kVersion;  ///< The highest version that the client supports.
  std::uint32_t features = 0;            ///< Optional features that the client offers.
  std::uint64_t client_epoch = 0;        ///< Random for each run of the client.
  std::uint64_t channel = 0;             ///< Distinguishes the channels of one client.
  std::uint64_t clock_domain = 0;      ///< Equal on both sides if they share a clock; 0 if unknown.
  std::uint32_t message_size_max = 0;  ///< The largest message that the client accepts.
  Cookie cookie{};                     ///< Initially zero.
};

/// The payload of WELCOME.
/// @source   spec/hprotocol.md#hp-4.3
struct Welcome {
  static constexpr std::size_t kSize = 48;

  std::uint16_t version = kVersion;
  Band band{};         ///< The priorities that this session serves.
  Priority ceiling{};  ///< Calls with a higher priority are refused.
  std::uint32_t features = 0;
  std::uint16_t window = kCallWindow;  ///< How many calls may be open at a time.
  std::uint64_t server_epoch = 0;      ///< Random for each run of the server.
  std::uint64_t clock_domain = 0;
  std::uint32_t message_size_max = 0;  ///< The largest message that the server accepts.
};

/// Writes a payload to the beginning of `to`, which must hold its kSize bytes.
/// @realtime alloc-free
void encode(const Hello& hello, MutableBytes to) noexcept;
void encode(const Welcome& welcome, MutableBytes to) noexcept;

/// @return nullopt if the size or a reserved byte is wrong
/// @realtime alloc-free
[[nodiscard]] std::optional<Hello> decode_hello(ConstBytes payload) noexcept;
/// @param features  the bits that the client offered; others are invalid
[[nodiscard]] std::optional<Welcome> decode_welcome(ConstBytes payload,
                                                    std::uint32_t features = 0) noexcept;

}  // namespace rtpm::wire
