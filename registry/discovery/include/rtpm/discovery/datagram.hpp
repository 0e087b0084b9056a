#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "rtpm/base/bytes.hpp"

/// The datagrams of discovery, spec/hprotocol.md, section 10.1. All have the same size.
namespace rtpm::discovery {

inline constexpr std::uint16_t kPort = 7423;
inline constexpr std::size_t kDatagramSize = 256;
/// Maximum number of services in an answer.
inline constexpr std::size_t kAnsweredServiceCountMax = 30;

/// A name service on the host that sent the answer.
struct AnsweredService {
  std::uint16_t port = 0;
  bool is_registry = false;
  std::uint32_t process_id = 0;  ///< 0 if unknown.
  friend bool operator==(const AnsweredService&, const AnsweredService&) = default;
};

struct Datagram {
  bool is_answer = false;
  std::uint8_t domain = 0;
  std::uint64_t number = 0;  ///< A random number of the query, which its answers repeat.
  std::vector<AnsweredService> services{};
};

using DatagramBytes = std::array<std::byte, kDatagramSize>;

/// Services that do not fit are left out.
[[nodiscard]] DatagramBytes encode(const Datagram& datagram) noexcept;

/// @return nullopt if `bytes` is not a discovery datagram, or has another version
/// @realtime set-up only
[[nodiscard]] std::optional<Datagram> decode(ConstBytes bytes);

}  // namespace rtpm::discovery
