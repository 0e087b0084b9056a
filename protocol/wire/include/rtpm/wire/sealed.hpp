#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>

#include "rtpm/base/bytes.hpp"
#include "rtpm/base/expected.hpp"
#include "rtpm/base/priority.hpp"
#include "rtpm/wire/handshake.hpp"
#include "rtpm/wire/header.hpp"
#include "rtpm/wire/medium.hpp"

/// The encoding of sealed sessions: their frames, and the longer payloads of their handshakes. The
/// sealed parts are opaque here. All functions are alloc-free.
/// @source   spec/security.md
namespace rtpm::wire {

/// Bits of Hello::features and Welcome::features.
inline constexpr std::uint32_t kFeatureSealed = 1;  ///< The session is sealed.
inline constexpr std::uint32_t kFeatureAesGcm = 2;  ///< Its suite is AES-256-GCM.

/// A public key.
using KeyBytes = std::array<std::byte, 32>;

/// The payload of COOKIE for a client that offered kFeatureSealed.
/// @source   spec/security.md#sec-3.1
struct SealedCookie {
  static constexpr std::size_t kSize = 56;
  Cookie cookie{};
  KeyBytes server_key{};  ///< Not authentic: the client knows the right key from elsewhere.
  /// The server's suites, as bits of crypto::Suite; unknown bits are ignored.
  std::uint32_t suites = 0;
};

/// The payload of a HELLO that contains the handshake's first message.
/// @source   spec/security.md#sec-3.2
struct SealedHello {
  static constexpr std::size_t kMessageSize = 104;
  static constexpr std::size_t kSize = Hello::kSize + kMessageSize;
  Hello hello;
  std::span<const std::byte, kMessageSize> message;  ///< Views the payload.
};

/// The size of the first message's sealed payload: the client's earlier session, or 0.
inline constexpr std::size_t kMessage1PayloadSize = 8;

/// The state of the session that the first message names.
enum class FormerSession : std::uint8_t {
  kNone = 0,   ///< The message named no session.
  kAlive = 1,  ///< The server still has it: the new session is not opened.
  kGone = 2,   ///< The server no longer has it, see hp-5.5-2.
  kEnded = 3,  ///< Like kGone, but its open calls may have run, since the server may have ended it.
};

/// The sealed part of the second message, which is the whole payload of a sealed WELCOME.
/// @source   spec/security.md#sec-3.3
struct SealedWelcome {
  static constexpr std::size_t kInnerSize = 64;
  static constexpr std::size_t kSize = 32 + kInnerSize + 16;
  std::uint64_t session = 0;  ///< The session in the header.
  Welcome welcome;
  FormerSession former = FormerSession::kNone;
};

/// The bytes that both sides of a handshake hash first, so that any change in transit is detected.
/// @source   spec/security.md#sec-3.4
inline constexpr std::size_t kPrologueSize = 16 + 2 + 4 + Hello::kSize + SealedCookie::kSize;
using Prologue = std::array<std::byte, kPrologueSize>;
/// @param header        of the HELLO with the first message
/// @param hello         the first 64 bytes of that HELLO's payload
/// @param cookie        the payload of the COOKIE that it answers; empty over a stream without a
///           COOKIE
[[nodiscard]] Prologue prologue_of(const Header& header,
                                   std::span<const std::byte, Hello::kSize> hello,
                                   ConstBytes cookie) noexcept;

/// Writes a payload to the beginning of `to`, which must hold its kSize (kInnerSize) bytes.
void encode(const SealedCookie& cookie, MutableBytes to) noexcept;
void encode(const SealedWelcome& inner, MutableBytes to) noexcept;

/// @return nullopt if the size, a reserved byte or a feature is wrong
[[nodiscard]] std::optional<SealedCookie> decode_sealed_cookie(ConstBytes payload) noexcept;
[[nodiscard]] std::optional<SealedHello> decode_sealed_hello(ConstBytes payload) noexcept;
/// @param features  those of the client's HELLO, which the WELCOME repeats
[[nodiscard]] std::optional<SealedWelcome> decode_sealed_welcome(ConstBytes inner,
                                                                 std::uint32_t features) noexcept;

/// The size of the trailer after a sealed frame's payload: counter and tag.
inline constexpr std::size_t kSealedTrailerSize = 24;
/// The largest payload of a sealed frame.
[[nodiscard]] constexpr std::size_t sealed_payload_max(Medium medium) noexcept {
  return frame_payload_max(medium) - kSealedTrailerSize;
}

/// Whether a frame that begins with a complete header is marked as sealed.
[[nodiscard]] bool is_sealed(ConstBytes frame) noexcept;
/// The size of the frame that begins with these bytes, at least a complete header, sealed or not; 0
/// if the header is invalid.
[[nodiscard]] std::size_t frame_size(ConstBytes bytes) noexcept;
/// Sets kFlagSealed in a frame that encode() wrote.
void mark_sealed(std::byte* frame) noexcept;
/// Clears kFlagSealed, which turns the header into that of an ordinary frame.
void unmark_sealed(std::byte* frame) noexcept;

/// Decodes and checks the header of a whole sealed frame, like decode_frame() for ordinary ones.
/// Nothing in it is authentic before the frame is opened.
/// @param header  receives the header, without kFlagSealed; unspecified after an error
[[nodiscard]] expected<void, DropReason> decode_sealed_frame(ConstBytes frame, Medium medium,
                                                             Header& header) noexcept;

}  // namespace rtpm::wire
