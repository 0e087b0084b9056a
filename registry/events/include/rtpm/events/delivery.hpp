#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "rtpm/base/time.hpp"
#include "rtpm/events/event.hpp"

/// How a subscription gets what its filter accepts: how much of it, and what happens when its
/// consumer does not keep up.
namespace rtpm::events {

inline constexpr std::uint32_t kQueueCapacityMax = 4096;  ///< Events.
/// A queue that looks for the older of a pair does not search longer.
inline constexpr std::uint32_t kLatestQueueCapacityMax = 64;
inline constexpr std::uint32_t kReplayMax = 64;
inline constexpr std::size_t kDeadbandCountMax = 8;

/// What a full queue does.
enum class QueuePolicy : std::uint8_t {
  kDropOldest,  ///< The oldest makes room.
  /// Of each type and source only the newest waits, in the older's place; full all the same, the
  /// oldest makes room.
  kKeepLatest,
  kDisconnect,  ///< The subscription ends, and its consumer is told why.
};

/// An event of `type` is left out while its `field` is less than `threshold` away from what it was
/// in the last one delivered, of the same source.
struct Deadband {
  EventType type = 0;
  std::string field{};
  double threshold = 0;  ///< Above 0, in the field's unit.
};

/// How a subscription wants its events.
struct DeliveryPolicy {
  std::uint32_t every_nth = 1;  ///< Of what is accepted, the first and then each n-th.
  Duration interval{0};         ///< At most one in so long, 0: all.
  /// The last one that `interval` left out comes at its end, so that the final state is not lost.
  bool is_trailing = true;
  std::vector<Deadband> deadbands{};
  QueuePolicy when_full = QueuePolicy::kDropOldest;
  std::uint32_t queue_capacity = 64;  ///< Events that wait for the consumer at most.
  /// At the begin, how many of the last events of each type and source that the filter accepts
  /// come first; 1: the latched value. As far back as the hub remembers.
  std::uint32_t replay = 0;
};

/// What a consumer missed and why. Counted from the begin of the subscription.
struct Losses {
  std::uint64_t overflow_count = 0;   ///< Dropped from a full queue.
  std::uint64_t replaced_count = 0;   ///< A newer one took its place (kKeepLatest).
  std::uint64_t suspended_count = 0;  ///< Came while the subscription was suspended.
  std::uint64_t memory_count = 0;     ///< The hub had no memory to hold it for so long.
  std::uint64_t too_large_count = 0;  ///< Does not go over the consumer's transport.
  std::uint64_t overrun_count = 0;    ///< The shared ring came round before it was read.
  /// Of multicast: lost on the network, or by a full socket, and no longer kept by the hub.
  std::uint64_t unrepaired_count = 0;
  friend bool operator==(const Losses&, const Losses&) = default;
  void add(const Losses& more) noexcept {
    overflow_count += more.overflow_count;
    replaced_count += more.replaced_count;
    suspended_count += more.suspended_count;
    memory_count += more.memory_count;
    too_large_count += more.too_large_count;
    overrun_count += more.overrun_count;
    unrepaired_count += more.unrepaired_count;
  }
  [[nodiscard]] std::uint64_t total() const noexcept {
    return overflow_count + replaced_count + suspended_count + memory_count + too_large_count +
           overrun_count + unrepaired_count;
  }
};

}  // namespace rtpm::events
