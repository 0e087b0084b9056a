#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>

#include "rtpm/base/time.hpp"

/// Every number of the protocol, each with its reason.   Source: spec/hprotocol.md#hp-9.
namespace rtpm::wire {

inline constexpr std::uint8_t kVersion = 1;

/// One cache line, and a multiple of 16 so that the payload is aligned to 16 bytes.
inline constexpr std::size_t kHeaderSize = 64;

/// The largest frame in a datagram: Ethernet's 1500 bytes less IPv4 and UDP headers (28) and room
/// for a tunnel's own header (64), so that no router has to fragment.
inline constexpr std::size_t kDatagramFrameSizeMax = 1408;
inline constexpr std::size_t kDatagramPayloadSizeMax = kDatagramFrameSizeMax - kHeaderSize;

/// The largest frame on a stream, and so the largest fragment: what a connection buffers.
inline constexpr std::size_t kStreamFrameSizeMax = std::size_t{64} * 1024;
inline constexpr std::size_t kStreamPayloadSizeMax = kStreamFrameSizeMax - kHeaderSize;

/// The largest frame in shared memory: a window of fragments fits a ring of 128 KiB, so that a
/// hundred connections take no more than 26 MiB, all of it in memory before it is needed.
inline constexpr std::size_t kSharedFrameSizeMax = std::size_t{16} * 1024;
inline constexpr std::size_t kSharedPayloadSizeMax = kSharedFrameSizeMax - kHeaderSize;

/// The bounds of what a side may state as its largest message on a stream.
inline constexpr std::uint32_t kMessageSizeFloor = 1024;
inline constexpr std::uint32_t kMessageSizeCeiling = 16 * 1024 * 1024;

/// How many calls of one session the server remembers with their replies, hence how many may be
/// open at a time. A power of two.
inline constexpr std::uint16_t kCallWindow = 8;

/// How many fragments of a message are on their way at a time: 44 KiB of datagrams, which fit every
/// socket's buffer and keep a gigabit busy over a round trip of 350 µs.
inline constexpr std::uint16_t kFragmentWindow = 32;
/// The same on a stream: a quarter of a megabyte, which the send buffer that Linux gives by default
/// holds without waiting.
inline constexpr std::uint16_t kStreamFragmentWindow = 4;
/// The most fragments of a message: 16 MiB in datagrams. A multiple of 64.
inline constexpr std::uint16_t kFragmentCountMax = 12'544;
static_assert(kFragmentCountMax * kDatagramPayloadSizeMax >= kMessageSizeCeiling);

/// How many items of a stream are on their way, or wait to be taken, at a time. At most 64.
inline constexpr std::uint32_t kStreamWindow = 32;
/// What a client states as the time that it will still wait for a stream's next sign of life, and
/// the server so long keeps the stream without hearing of it.
inline constexpr Duration kStreamLease = std::chrono::seconds{3};
/// A client asks after a stream at least so often, whether items come or not (hp-5.10-5).
inline constexpr Duration kStreamAskIntervalMax = std::chrono::milliseconds{500};
/// Over a connection, which loses nothing, it is not asked after sooner than this behind an item:
/// so who waits for the next one need set no timer that it would outrun.
inline constexpr Duration kStreamAskIntervalConnected = std::chrono::milliseconds{100};

/// A session is not replaced before it was silent for so long (hp-5.5-1). A caller repeats at least
/// every kRetransmitIntervalMax, so one that waits is never silent that long.
inline constexpr Duration kSessionIdleMin = std::chrono::seconds{30};

/// A cookie is good for one to two such spans after it was given.
inline constexpr Duration kCookieSpan = std::chrono::seconds{10};

/// The first repetition of a call whose round trip was never measured comes after this.
inline constexpr Duration kRetransmitIntervalFirst = std::chrono::milliseconds{5};
/// No repetition comes sooner: below, a busy server would be asked twice without need.
inline constexpr Duration kRetransmitIntervalMin = std::chrono::microseconds{500};
/// The same where no frame leaves the host: then a frame was lost only if its receiver had no room
/// for it, or has died, and a server that is late would be asked in vain. So long that who waits
/// need not set a timer to the microsecond, which takes longer than a system call.
inline constexpr Duration kRetransmitIntervalOnHost = std::chrono::milliseconds{30};
/// No repetition comes later, however often it was doubled (hp-5.3-3).
inline constexpr Duration kRetransmitIntervalMax = std::chrono::seconds{1};

/// Names: a path is 1…200 bytes, so that a bind fits every frame.
inline constexpr std::size_t kPathSizeMax = 200;

/// The service number of the session itself, and its methods.
inline constexpr std::uint32_t kSessionService = 0;
inline constexpr std::uint16_t kMethodBind = 1;
inline constexpr std::uint16_t kMethodPing = 2;
inline constexpr std::uint16_t kMethodDescribe = 3;

}  // namespace rtpm::wire
