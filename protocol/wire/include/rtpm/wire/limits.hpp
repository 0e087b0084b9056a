#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>

#include "rtpm/base/time.hpp"

/// All numbers of the protocol, with their reasons.
/// @source   spec/hprotocol.md#hp-9
namespace rtpm::wire {

inline constexpr std::uint8_t kVersion = 1;

/// One cache line, and a multiple of 16 so that the payload is aligned to 16 bytes.
inline constexpr std::size_t kHeaderSize = 64;

/// The largest frame in a datagram: Ethernet's 1500 bytes minus IPv4 and UDP headers (28) and a
/// tunnel header (64), so that no router has to fragment.
inline constexpr std::size_t kDatagramFrameSizeMax = 1408;
inline constexpr std::size_t kDatagramPayloadSizeMax = kDatagramFrameSizeMax - kHeaderSize;

/// The largest frame on a stream, and so the largest fragment that a connection buffers.
inline constexpr std::size_t kStreamFrameSizeMax = std::size_t{64} * 1024;
inline constexpr std::size_t kStreamPayloadSizeMax = kStreamFrameSizeMax - kHeaderSize;

/// The largest frame in shared memory: a window of fragments fits a ring of 128 KiB. A hundred
/// connections take at most 26 MiB, all resident from the start.
inline constexpr std::size_t kSharedFrameSizeMax = std::size_t{16} * 1024;
inline constexpr std::size_t kSharedPayloadSizeMax = kSharedFrameSizeMax - kHeaderSize;

/// The range of the maximum message size that a side may state on a stream.
inline constexpr std::uint32_t kMessageSizeFloor = 1024;
inline constexpr std::uint32_t kMessageSizeCeiling = 16 * 1024 * 1024;

/// How many calls of a session, with their replies, the server keeps; so how many may be open at a
/// time. A power of two.
inline constexpr std::uint16_t kCallWindow = 8;

/// How many fragments of a message may be unacknowledged: 44 KiB of datagrams, which fit every
/// socket's buffer and fill a gigabit link with a round trip of 350 µs.
inline constexpr std::uint16_t kFragmentWindow = 32;
/// How many fragments may be unacknowledged on a stream: 256 KiB, which fit Linux's default send
/// buffer.
inline constexpr std::uint16_t kStreamFragmentWindow = 4;
/// The most fragments of a message: 16 MiB in datagrams. A multiple of 64.
inline constexpr std::uint16_t kFragmentCountMax = 12'544;
static_assert(kFragmentCountMax * kDatagramPayloadSizeMax >= kMessageSizeCeiling);

/// How long an incomplete large message, or an unacknowledged large reply, may be silent before it
/// may be evicted (hp-5.6-10): three repetitions at the longest interval.
inline constexpr Duration kLargeMessageSilenceMax = std::chrono::seconds{3};

/// One host's quota of a shared resource: three quarters, rounded up.
[[nodiscard]] constexpr std::uint32_t share_of_one_host(std::uint32_t count) noexcept {
  return count - count / 4;
}

/// How many datagrams outside sessions are answered at once for one host (hp-4.4-5).
inline constexpr std::uint32_t kStrangerAnswerBurst = 256;
/// After that burst, one is answered per interval.
inline constexpr Duration kStrangerAnswerInterval = std::chrono::milliseconds{2};

/// How many items of a stream may wait for their reader, and how many of its datagrams may be in
/// flight. At most 64.
inline constexpr std::uint32_t kStreamWindow = 32;
/// How many bytes of items a server may send before the first CREDIT: a window of datagrams.
inline constexpr std::uint32_t kStreamBytesFirstDatagram = 32 * kDatagramPayloadSizeMax;
/// How many bytes may be sent on a stream before the first CREDIT: one largest frame, half of a
/// shared-memory ring.
inline constexpr std::uint32_t kStreamBytesFirstStream = kStreamPayloadSizeMax;
/// The most frames of a stream that a client keeps, see stream_frame_count().
inline constexpr std::uint32_t kStreamFrameCountMax = 80;
/// How long a stream's client keeps asking without an answer.
inline constexpr Duration kStreamSilence = std::chrono::seconds{3};
/// How long a server keeps a stream over datagrams without hearing from its client: the client's
/// default. The server grants at most as long as it keeps a session (hp-5.5-1). With connections,
/// the end of a client is visible.
inline constexpr Duration kStreamLease = std::chrono::seconds{10};
inline constexpr Duration kStreamLeaseMax = std::chrono::seconds{30};
/// A budget that means as long as the connection lasts.
inline constexpr std::uint32_t kBudgetUnlimited = 0xffff'ffff;
/// The longest interval between a stream's queries (hp-5.10-5).
inline constexpr Duration kStreamAskIntervalMax = std::chrono::milliseconds{500};
/// On a connection, which loses nothing, the earliest query after an item. So a reader of frequent
/// items sets no timer.
inline constexpr Duration kStreamAskIntervalConnected = std::chrono::milliseconds{100};

/// A session may only be replaced after this time of silence (hp-5.5-1). A waiting caller repeats
/// at least every kRetransmitIntervalMax, so it is never silent for that long.
inline constexpr Duration kSessionIdleMin = std::chrono::seconds{30};

/// A cookie is valid for one to two spans.
inline constexpr Duration kCookieSpan = std::chrono::seconds{10};

/// The first wait of a call without a measured round trip.
inline constexpr Duration kRetransmitIntervalFirst = std::chrono::milliseconds{5};
/// The shortest wait before a repetition, so that a busy server is not asked twice needlessly.
inline constexpr Duration kRetransmitIntervalMin = std::chrono::microseconds{500};
/// The shortest wait if no frame leaves the host: a frame is only lost if its receiver's buffer is
/// full or the receiver has died. Long enough for a caller to wait without a precise timer, which
/// costs more than a system call.
inline constexpr Duration kRetransmitIntervalOnHost = std::chrono::milliseconds{30};
/// The upper bound of the doubled wait (hp-5.3-3).
inline constexpr Duration kRetransmitIntervalMax = std::chrono::seconds{1};

/// A path has 1…200 bytes, so that a bind fits every frame.
inline constexpr std::size_t kPathSizeMax = 200;

/// The service number of the session itself, and its methods.
inline constexpr std::uint32_t kSessionService = 0;
inline constexpr std::uint16_t kMethodBind = 1;
inline constexpr std::uint16_t kMethodPing = 2;
inline constexpr std::uint16_t kMethodDescribe = 3;

}  // namespace rtpm::wire
