#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "rtpm/base/bytes.hpp"
#include "rtpm/base/priority.hpp"
#include "rtpm/wire/limits.hpp"

namespace rtpm::wire {

/// Proof that a client receives at the address that it sends from.
using Cookie = std::array<std::byte, 16>;

/// The payload of HELLO.
/// @source   spec/hprotocol.md#hp-4.1
struct Hello {
  static constexpr std::size_t kSize = 64;

  std::uint16_t version_min = kVersion;  ///< The lowest version that the client supports.
  std::uint16_t version_max = kVersion;  ///< The highest one.
  std::uint32_t features = 0;            ///< Optional features that the client offers.
  std::uint64_t client_epoch = 0;        ///< Random for each run of the client.
  std::uint64_t channel = 0;             ///< Distinguishes the channels of one client.
  std::uint64_t clock_domain = 0;        ///< Equal on both sides for one clock; 0 if unknown.
  std::uint32_t message_size_max = 0;    ///< The largest message the client takes.
  Cookie cookie{};                       ///< Zero at first.
};

/// The payload of WELCOME.
/// @source   spec/hprotocol.md#hp-4.3
struct Welcome {
  static constexpr std::size_t kSize = 48;

  std::uint16_t version = kVersion;
  Band band{};         ///< The priorities that this session serves.
  Priority ceiling{};  ///< Calls above it are refused.
  std::uint32_t features = 0;
  std::uint16_t window = kCallWindow;  ///< Calls that may be open at a time.
  std::uint64_t server_epoch = 0;      ///< Random for each run of the server.
  std::uint64_t clock_domain = 0;
  std::uint32_t message_size_max = 0;  ///< The largest message the server takes.
};

/// Writes a payload to the beginning of `to`, which holds its kSize bytes.
/// @realtime alloc-free
void encode(const Hello& hello, MutableBytes to) noexcept;
void encode(const Welcome& welcome, MutableBytes to) noexcept;

/// @return nothing if the size or a reserved byte is wrong
/// @realtime alloc-free
[[nodiscard]] std::optional<Hello> decode_hello(ConstBytes payload) noexcept;
/// @param features  bits that the client offered; others are wrong
[[nodiscard]] std::optional<Welcome> decode_welcome(ConstBytes payload,
                                                    std::uint32_t features = 0) noexcept;

}  // namespace rtpm::wire
