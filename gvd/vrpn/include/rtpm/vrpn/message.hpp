#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "rtpm/base/bytes.hpp"

/// The messages of VRPN 07 as bytes.
/// @source VRPN's Format_Of_Protocol.txt
namespace rtpm::vrpn {

inline constexpr std::uint16_t kPort = 3883;  ///< TCP and UDP.
inline constexpr std::size_t kCookieSize = 24;
inline constexpr std::size_t kHeaderSize = 24;
/// Payloads of trackers, buttons, analogs and descriptions are much smaller.
inline constexpr std::size_t kPayloadSizeMax = 16 * 1024;

/// Types of VRPN itself; those of devices have numbers from 0, which each side chooses.
enum SystemType : std::int32_t {
  kSenderDescription = -1,  ///< Message::sender is the number, the payload the name.
  kTypeDescription = -2,    ///< The same for a type.
  kUdpDescription = -3,
  kLogDescription = -4,
};

struct Message {
  std::int32_t sender = 0;
  std::int32_t type = 0;
  std::int64_t time_us = 0;  ///< Since 1970, by the sender's wall clock.
  ConstBytes payload{};
};

/// The first bytes of either side.
[[nodiscard]] std::array<std::byte, kCookieSize> cookie() noexcept;
/// Whether a peer's first kCookieSize bytes are those of VRPN 07, of any minor version.
[[nodiscard]] bool is_cookie(ConstBytes bytes) noexcept;

/// Appends the message to `to`, padded.
/// @param number  counts the messages of a connection
void append(std::vector<std::byte>& to, const Message& message, std::uint32_t number);

/// Cuts a byte stream, after the cookie, into messages.
/// @ownership keeps the bytes of an incomplete message
/// @threads  one at a time
class Parser {
 public:
  /// Takes bytes of the stream.
  void push(ConstBytes bytes) { bytes_.insert(bytes_.end(), bytes.begin(), bytes.end()); }
  /// The next complete message, valid until the next call; nullopt if there is none.
  [[nodiscard]] std::optional<Message> next();
  /// Whether the stream is no longer readable, as a length was impossible.
  [[nodiscard]] bool is_broken() const noexcept { return is_broken_; }

 private:
  std::vector<std::byte> bytes_{};
  std::size_t taken_ = 0;  ///< The bytes of earlier messages.
  bool is_broken_ = false;
};

}  // namespace rtpm::vrpn
