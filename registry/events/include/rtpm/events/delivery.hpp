#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "rtpm/base/time.hpp"
#include "rtpm/events/event.hpp"

/// How a subscription receives accepted events: how many, and what happens if the consumer is slow.
namespace rtpm::events {

inline constexpr std::uint32_t kQueueCapacityMax = 4096;  ///< In events; a ring may hold more.
/// Capacity of a kKeepLatest queue, whose look-up is linear.
inline constexpr std::uint32_t kLatestQueueCapacityMax = 64;
inline constexpr std::uint32_t kReplayMax = 64;
inline constexpr std::size_t kDeadbandCountMax = 8;
/// Pairs of type and source of a subscription that may have their own interval.
inline constexpr std::size_t kIntervalSourceMax = 256;

/// The action when the queue is full.
enum class QueuePolicy : std::uint8_t {
  kDropOldest,  ///< Drops the oldest event.
  /// Keeps only the newest event of each type and source; if still full, drops the oldest.
  kKeepLatest,
  kDisconnect,  ///< Ends the subscription and reports why.
};

/// Omits an event of `type` if `field` differs by less than `threshold` from the last delivered
/// event of the same source.
struct Deadband {
  EventType type = 0;
  std::string field{};
  double threshold = 0;  ///< Above 0, in the field's unit.
};

/// Selects and buffers the accepted events of a subscription.
struct DeliveryPolicy {
  std::uint32_t every_nth = 1;  ///< Delivers the first accepted event, then every n-th.
  Duration interval{0};         ///< At most one delivery per interval; 0 delivers all.
  /// Delivers the last omitted event at the end of `interval`, so that the final state is not lost.
  bool is_trailing = true;
  std::vector<Deadband> deadbands{};
  QueuePolicy when_full = QueuePolicy::kDropOldest;
  std::uint32_t queue_capacity = 64;  ///< In events.
  /// How many of the latest accepted events of each type and source are replayed at the start, if
  /// the hub still has them; 1 replays the latched value.
  std::uint32_t replay = 0;
  /// `interval` applies to each type and source separately, instead of all together. Beyond
  /// kIntervalSourceMax pairs, the rest share one interval.
  bool is_interval_per_source = false;
};

/// Events that a consumer missed since it subscribed, by cause.
struct Losses {
  std::uint64_t overflow_count = 0;   ///< Dropped from a full queue.
  std::uint64_t replaced_count = 0;   ///< Replaced by a newer one (kKeepLatest).
  std::uint64_t suspended_count = 0;  ///< Arrived while the subscription was suspended.
  std::uint64_t memory_count = 0;     ///< Evicted or not stored because the hub was out of memory.
  std::uint64_t too_large_count = 0;  ///< Larger than the consumer's transport can carry.
  std::uint64_t overrun_count = 0;    ///< The shared ring was read too slowly.
  /// Multicast: lost in the network or socket, and no longer in the hub's history.
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
