#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>

#include "rtpm/base/time.hpp"

/// Every number of the protocol, each with its reason.
/// @source   spec/hprotocol.md#hp-9
namespace rtpm::wire {

inline constexpr std::uint8_t kVersion = 1;

/// One cache line, and a multiple of 16 so that the payload is aligned to 16 bytes.
inline constexpr std::size_t kHeaderSize = 64;

/// The largest frame in a datagram: Ethernet's 1500 bytes less IPv4 and UDP headers (28) and a
/// tunnel's header (64), so that no router has to fragment.
inline constexpr std::size_t kDatagramFrameSizeMax = 1408;
inline constexpr std::size_t kDatagramPayloadSizeMax = kDatagramFrameSizeMax - kHeaderSize;

/// The largest frame on a stream, and so the largest fragment that a connection buffers.
inline constexpr std::size_t kStreamFrameSizeMax = std::size_t{64} * 1024;
inline constexpr std::size_t kStreamPayloadSizeMax = kStreamFrameSizeMax - kHeaderSize;

/// The largest frame in shared memory: a window of fragments fits a ring of 128 KiB. A hundred
/// connections then take at most 26 MiB, all of it resident from the beginning.
inline constexpr std::size_t kSharedFrameSizeMax = std::size_t{16} * 1024;
inline constexpr std::size_t kSharedPayloadSizeMax = kSharedFrameSizeMax - kHeaderSize;

/// The bounds of the largest message that a side may state on a stream.
inline constexpr std::uint32_t kMessageSizeFloor = 1024;
inline constexpr std::uint32_t kMessageSizeCeiling = 16 * 1024 * 1024;

/// The calls of a session that the server keeps with their replies, hence the calls that may be
/// open at a time. A power of two.
inline constexpr std::uint16_t kCallWindow = 8;

/// The fragments of a message that may be unacknowledged: 44 KiB of datagrams, which fit every
/// socket's buffer and fill a gigabit link over a round trip of 350 µs.
inline constexpr std::uint16_t kFragmentWindow = 32;
/// The unacknowledged fragments on a stream: 256 KiB, which fit Linux's default send buffer.
inline constexpr std::uint16_t kStreamFragmentWindow = 4;
/// The most fragments of a message: 16 MiB in datagrams. A multiple of 64.
inline constexpr std::uint16_t kFragmentCountMax = 12'544;
static_assert(kFragmentCountMax * kDatagramPayloadSizeMax >= kMessageSizeCeiling);

/// An incomplete large message, or an unacknowledged large reply, may be evicted after this time
/// without a frame (hp-5.6-10): three repetitions at the longest interval.
inline constexpr Duration kLargeMessageSilenceMax = std::chrono::seconds{3};

/// One host's quota of a shared resource: three quarters, rounded up.
[[nodiscard]] constexpr std::uint32_t share_of_one_host(std::uint32_t count) noexcept {
  return count - count / 4;
}

/// The datagrams outside sessions that are answered for one host at once (hp-4.4-5).
inline constexpr std::uint32_t kStrangerAnswerBurst = 256;
/// After that burst, one is answered per interval.
inline constexpr Duration kStrangerAnswerInterval = std::chrono::milliseconds{2};

/// The items of a stream that may wait for their reader, and its datagrams that may be in flight.
/// At most 64.
inline constexpr std::uint32_t kStreamWindow = 32;
/// The bytes of items that a server may send before the first CREDIT: a window of datagrams.
inline constexpr std::uint32_t kStreamBytesFirstDatagram = 32 * kDatagramPayloadSizeMax;
/// The bytes before the first CREDIT on a stream: one largest frame, half of a shared-memory ring.
inline constexpr std::uint32_t kStreamBytesFirstStream = kStreamPayloadSizeMax;
/// The most frames of a stream that a client keeps, see stream_frame_count().
inline constexpr std::uint32_t kStreamFrameCountMax = 80;
/// How long a client keeps asking after a stream without an answer.
inline constexpr Duration kStreamSilence = std::chrono::seconds{3};
/// How long a server keeps a stream over datagrams without hearing its client: a client's default,
/// and the most that a server grants, which is as long as it keeps a session (hp-5.5-1). A closed
/// connection reports its client's end.
inline constexpr Duration kStreamLease = std::chrono::seconds{10};
inline constexpr Duration kStreamLeaseMax = std::chrono::seconds{30};
/// A budget that means: as long as the connection lasts.
inline constexpr std::uint32_t kBudgetUnlimited = 0xffff'ffff;
/// The longest interval between two questions after a stream (hp-5.10-5).
inline constexpr Duration kStreamAskIntervalMax = std::chrono::milliseconds{500};
/// Over a connection, which loses nothing, no question comes sooner than this after an item, so
/// that a reader of frequent items sets no timer.
inline constexpr Duration kStreamAskIntervalConnected = std::chrono::milliseconds{100};

/// A session is not replaced before it was silent for this time (hp-5.5-1). A waiting caller
/// repeats at least every kRetransmitIntervalMax, so it is never silent that long.
inline constexpr Duration kSessionIdleMin = std::chrono::seconds{30};

/// A cookie is valid for one to two such spans.
inline constexpr Duration kCookieSpan = std::chrono::seconds{10};

/// The first wait of a call whose round trip was never measured.
inline constexpr Duration kRetransmitIntervalFirst = std::chrono::milliseconds{5};
/// No repetition comes sooner: a busy server would be asked twice without need.
inline constexpr Duration kRetransmitIntervalMin = std::chrono::microseconds{500};
/// The least wait where no frame leaves the host: a frame is lost only if its receiver's buffer is
/// full or the receiver has died. Long enough for a caller to wait without a precise timer, which
/// costs more than a system call.
inline constexpr Duration kRetransmitIntervalOnHost = std::chrono::milliseconds{30};
/// The bound of the doubled wait (hp-5.3-3).
inline constexpr Duration kRetransmitIntervalMax = std::chrono::seconds{1};

/// A path is 1…200 bytes, so that a bind fits every frame.
inline constexpr std::size_t kPathSizeMax = 200;

/// The service number of the session itself, and its methods.
inline constexpr std::uint32_t kSessionService = 0;
inline constexpr std::uint16_t kMethodBind = 1;
inline constexpr std::uint16_t kMethodPing = 2;
inline constexpr std::uint16_t kMethodDescribe = 3;

}  // namespace rtpm::wire
