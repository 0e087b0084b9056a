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

/// What a frame is.   Source: spec/hprotocol.md#hp-3.
enum class FrameKind : std::uint8_t {
  kHello = 1,    ///< Client → server: asks for a session.
  kCookie = 2,   ///< Server → client: repeat the HELLO with this, to prove your address.
  kWelcome = 3,  ///< Server → client: the session and its limits.
  kRefuse = 4,   ///< Server → client: no session, or no such session.
  kCall = 5,     ///< Client → server: run a method.
  kReply = 6,    ///< Server → client: how it ended.
  kClose = 7,    ///< Both ways: the session ends.
  kAck = 8,      ///< Both ways: how far a message in fragments has arrived.
  kCancel = 9,   ///< Client → server: the caller gave up.
  kItem = 10,    ///< Server → client: one item of a stream, or a fragment of it.
  kCredit = 11,  ///< Client → server: which frames of a stream are there, and how much may come.
};
inline constexpr std::uint8_t kFrameKindLast = 11;

/// Bits of Header::flags. All others are zero.
inline constexpr std::uint16_t kFlagRepeated = 1;  ///< A copy of a frame sent before.
inline constexpr std::uint16_t kFlagAckWanted =
    2;                                            ///< On a fragment or CREDIT: tell how far it is.
inline constexpr std::uint16_t kFlagNoReply = 4;  ///< On a CALL: a oneway, sent and forgotten.
inline constexpr std::uint16_t kFlagReplyOnReceipt = 8;  ///< On a CALL: reply before it runs.
inline constexpr std::uint16_t kFlagsKnown =
    kFlagRepeated | kFlagAckWanted | kFlagNoReply | kFlagReplyOnReceipt;

/// The 64 bytes at the beginning of every frame.   Source: spec/hprotocol.md#hp-2.
struct Header {
  FrameKind kind = FrameKind::kCall;
  Priority priority{};  ///< Of the call; it steers the frame to its lane.
  std::uint16_t flags = 0;
  std::uint64_t session = 0;  ///< Given by WELCOME; 0 before.
  std::uint32_t call_id = 0;  ///< Counts a channel's calls, or its handshakes.
  std::uint32_t service = 0;  ///< The object's number, given by a bind.
  std::uint16_t method = 0;
  Status status = Status::kOk;       ///< In replies and refusals.
  std::uint32_t payload_size = 0;    ///< Bytes that follow this header.
  std::uint16_t fragment_index = 0;  ///< Which part of the message this is, of
  std::uint16_t fragment_count = 1;  ///< so many; only CALL, REPLY and ITEM come in several.
  std::uint32_t message_size = 0;    ///< Bytes of the whole message.
  std::uint32_t budget_us = 0;       ///< CALL: time left. REPLY: time the server took.
  /// CALL: items that the caller takes at first; 0: no stream. ITEM: the frame's number. CREDIT:
  /// items below this number may come. REPLY and ACK of a stream: frames sent. Else 0.
  std::uint32_t item = 0;
  std::uint64_t sender_time_ns = 0;  ///< The sender's monotonic clock when it sent.
  std::uint64_t trace_id = 0;
};

/// Writes `header` in its wire form at the beginning of `to`, which holds at least kHeaderSize
/// bytes. RT: alloc-free, a few ns.
void encode(const Header& header, std::byte* to) noexcept;

/// Reads and checks the header at the beginning of `bytes`, which may be anything. That
/// payload_size bytes follow is for the caller to check: datagrams carry exactly one frame, streams
/// many. RT: alloc-free, a few ns. Errors: the reason under which the frame is to be dropped and
/// counted.
[[nodiscard]] expected<Header, DropReason> decode(ConstBytes bytes) noexcept;

/// As decode(), for a whole frame: exactly payload_size bytes follow the header.
[[nodiscard]] expected<Header, DropReason> decode_frame(ConstBytes frame) noexcept;
/// The same, for a frame that came over `medium`, which no frame may be too large for; into a
/// header where it is to stay. After an error that holds anything.
[[nodiscard]] expected<void, DropReason> decode_frame(ConstBytes frame, Medium medium,
                                                      Header& header) noexcept;

/// Marks a frame that encode() wrote as a copy of one sent before.   RT: alloc-free.
void mark_repeated(std::byte* frame) noexcept;

/// The header of a frame of one piece that is about the call of `about`: it names the same call,
/// and states nothing else yet.   RT: alloc-free.
[[nodiscard]] Header header_about(const Header& about, FrameKind kind, std::size_t payload_size,
                                  MonotonicTime now) noexcept;

/// The size of all fragments but the last, told by any one of several; 0 if the numbers contradict
/// each other or the limits.   RT: alloc-free.
[[nodiscard]] std::uint32_t fragment_size_of(const Header& header) noexcept;

/// "HELLO", "CALL", …
[[nodiscard]] std::string_view to_string(FrameKind kind) noexcept;

}  // namespace rtpm::wire
