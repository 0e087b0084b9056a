#pragma once

#include <cstdint>

#include "rtpm/base/bytes.hpp"
#include "rtpm/base/expected.hpp"
#include "rtpm/base/priority.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/wire/counters.hpp"
#include "rtpm/wire/limits.hpp"
#include "rtpm/wire/medium.hpp"
#include "rtpm/wire/status.hpp"

namespace rtpm::wire {

/// The kinds of frames.
/// @source   spec/hprotocol.md#hp-3
enum class FrameKind : std::uint8_t {
  kHello = 1,    ///< Client → server: requests a session.
  kCookie = 2,   ///< Server → client: repeat the HELLO with this cookie to prove your address.
  kWelcome = 3,  ///< Server → client: the session and its limits.
  kRefuse = 4,   ///< Server → client: no session, or no such session.
  kCall = 5,     ///< Client → server: run a method.
  kReply = 6,    ///< Server → client: the call's result.
  kClose = 7,    ///< Both directions: the session ends.
  kAck = 8,      ///< Both directions: which fragments of a message have arrived.
  kCancel = 9,   ///< Client → server: the caller gave up.
  kItem = 10,    ///< Server → client: one item of a stream, or a fragment of it.
  /// Client → server: which frames of a stream have arrived, and how many may follow.
  kCredit = 11,
};
inline constexpr std::uint8_t kFrameKindLast = 11;

/// Bits of Header::flags; all others are zero.
inline constexpr std::uint16_t kFlagRepeated = 1;  ///< A repetition of a frame sent before.
inline constexpr std::uint16_t kFlagAckWanted =
    2;                                            ///< On a fragment or CREDIT: requests an answer.
inline constexpr std::uint16_t kFlagNoReply = 4;  ///< On a CALL: a oneway without confirmation.
inline constexpr std::uint16_t kFlagReplyOnReceipt = 8;  ///< On a CALL: reply before it runs.
/// Marks a frame of a sealed session, see sealed.hpp; elsewhere this bit is reserved.
inline constexpr std::uint16_t kFlagSealed = 16;
inline constexpr std::uint16_t kFlagsKnown =
    kFlagRepeated | kFlagAckWanted | kFlagNoReply | kFlagReplyOnReceipt;

/// The 64 bytes at the beginning of every frame.
/// @source   spec/hprotocol.md#hp-2
struct Header {
  FrameKind kind = FrameKind::kCall;
  Priority priority{};  ///< The call's priority; it steers the frame to its lane.
  std::uint16_t flags = 0;
  std::uint64_t session = 0;  ///< Given by WELCOME; 0 before.
  std::uint32_t call_id = 0;  ///< Counts a channel's calls or handshakes.
  std::uint32_t service = 0;  ///< The object's number, from a bind.
  std::uint16_t method = 0;
  Status status = Status::kOk;       ///< Set in replies and refusals.
  std::uint32_t payload_size = 0;    ///< Bytes that follow this header.
  std::uint16_t fragment_index = 0;  ///< Counts from 0.
  std::uint16_t fragment_count = 1;  ///< Above 1 only for CALL, REPLY and ITEM.
  std::uint32_t message_size = 0;    ///< The size of the whole message in bytes.
  std::uint32_t budget_us = 0;       ///< CALL: time left. REPLY: time the server took.
  /// CALL: items that the caller accepts initially, 0 if not a stream. ITEM: the frame's number.
  /// CREDIT: items below this number may be sent. REPLY and ACK of a stream: frames sent. Otherwise
  /// 0.
  std::uint32_t item = 0;
  std::uint64_t sender_time_ns = 0;  ///< The sender's monotonic clock at the time of sending.
  std::uint64_t trace_id = 0;
};

/// Encodes `header` to the beginning of `to`, which must hold kHeaderSize bytes.
/// @realtime alloc-free, a few ns, like all functions here
void encode(const Header& header, std::byte* to) noexcept;

/// Decodes and checks the header at the beginning of `bytes`, which may be anything. Does not check
/// that payload_size bytes follow: a datagram has exactly one frame, a stream many.
/// @errors   the reason under which to drop and count the frame
[[nodiscard]] expected<Header, DropReason> decode(ConstBytes bytes) noexcept;

/// Like decode(), for a whole frame: checks that exactly payload_size bytes follow the header.
[[nodiscard]] expected<Header, DropReason> decode_frame(ConstBytes frame) noexcept;
/// Like decode_frame() above; also checks that the frame is not too large for `medium`.
/// @param header  receives the header; unspecified after an error
[[nodiscard]] expected<void, DropReason> decode_frame(ConstBytes frame, Medium medium,
                                                      Header& header) noexcept;

/// Sets kFlagRepeated in a frame that encode() wrote.
void mark_repeated(std::byte* frame) noexcept;

/// The header of an unfragmented frame that refers to the call of `about`; all other fields have
/// their defaults.
[[nodiscard]] Header header_about(const Header& about, FrameKind kind, std::size_t payload_size,
                                  MonotonicTime now) noexcept;

/// The size of all fragments of a message except the last, from the header of any fragment; 0 if
/// its numbers contradict one another or the limits.
[[nodiscard]] std::uint32_t fragment_size_of(const Header& header) noexcept;

/// "HELLO", "CALL", …
[[nodiscard]] std::string_view to_string(FrameKind kind) noexcept;

}  // namespace rtpm::wire
