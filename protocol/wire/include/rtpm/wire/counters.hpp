#pragma once

#include <array>
#include <cstdint>
#include <string_view>

namespace rtpm::wire {

/// Why a frame was dropped. Each drop is counted under exactly one reason.
/// @source   spec/hprotocol.md#hp-8, hp-8-1
enum class DropReason : std::uint8_t {
  kTooShort,          ///< Fewer bytes than a header.
  kBadMagic,          ///< Not an H-Protocol frame.
  kBadVersion,        ///< An unsupported protocol version.
  kBadKind,           ///< An unknown kind, or one that this side does not receive.
  kReservedSet,       ///< A reserved bit or byte is not zero.
  kBadPriority,       ///< A priority above 32767.
  kBadLength,         ///< A length that contradicts the frame's size or the limits.
  kBadFragment,       ///< Fragment numbers that contradict each other.
  kBadPayload,        ///< A malformed handshake payload.
  kBadCookie,         ///< A cookie that this server did not recently issue to this address.
  kUnknownSession,    ///< A session that does not exist; the peer gets an answer.
  kForeignAddress,    ///< A session used from a wrong address.
  kStaleCall,         ///< A call older than its session's window.
  kDuplicateRunning,  ///< A repetition of a call that is still running.
  kUnexpected,        ///< A well-formed frame that does not fit the state, such as a stale answer.
  kRateLimited,       ///< Outside any session; its host exhausted its quota of answers (hp-4.4-5).
  kUnsealed,          ///< Unsealed, in a sealed session.
  kBadSeal,           ///< Not sealed by its session's peer, or modified in transit.
  kReplayed,          ///< A sealed frame that was received before, or is older than the window.
};
inline constexpr std::size_t kDropReasonCount = 19;

/// The name in the specification.
[[nodiscard]] std::string_view to_string(DropReason reason) noexcept;

/// Counts the frames that one side of the protocol received and dropped.
struct FrameCounters {
  std::uint64_t received_count = 0;            ///< Frames, including dropped ones.
  std::uint64_t duplicate_answered_count = 0;  ///< Repeated calls answered from the reply cache.
  std::uint64_t expired_count = 0;             ///< Calls not run because their deadline had passed.
  std::uint64_t refused_count = 0;             ///< Calls and sessions refused.
  std::uint64_t session_opened_count = 0;
  std::uint64_t session_evicted_count = 0;  ///< Sessions replaced by newer ones.
  std::uint64_t cancelled_count = 0;        ///< Calls that their callers cancelled in time.
  std::uint64_t orphaned_count = 0;         ///< Calls that ended without a peer to answer.
  std::uint64_t large_evicted_count = 0;    ///< Silent large messages evicted for new ones.
  std::uint64_t item_count = 0;             ///< Stream items sent, not counting repetitions.
  std::uint64_t item_repeated_count = 0;    ///< Items sent again.
  std::array<std::uint64_t, kDropReasonCount> dropped{};  ///< Indexed by DropReason.

  void drop(DropReason reason) noexcept { ++dropped[static_cast<std::size_t>(reason)]; }
  [[nodiscard]] std::uint64_t dropped_for(DropReason reason) const noexcept {
    return dropped[static_cast<std::size_t>(reason)];
  }
  void add(const FrameCounters& other) noexcept;
};

}  // namespace rtpm::wire
