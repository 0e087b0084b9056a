#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "rtpm/base/time.hpp"
#include "rtpm/events/event_store.hpp"
#include "rtpm/events/program.hpp"

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

/// Lets through as much as a policy wants. What it leaves out was not wanted, so it is no loss.
/// Ownership: one event, held for the end of the interval.   Threads: one at a time.
/// RT: alloc-free but for construction.
class Gate {
 public:
  Gate() noexcept = default;
  /// Set-up only.   Errors: a value out of bounds; a deadband's type or field that nobody knows.
  [[nodiscard]] static expected<Gate, FilterError> make(const DeliveryPolicy& policy,
                                                        const DescriptorSource& types);

  /// Whether a delivery goes on now. `event` is the one it consists of, or empty if it is a group,
  /// which deadbands leave alone and no interval holds back for later.
  [[nodiscard]] bool admit(const EventRef& event, MonotonicTime now) noexcept;
  /// When the event that was held back is due; kNever if there is none.
  [[nodiscard]] MonotonicTime next_time() const noexcept { return held_ ? next_open_ : kNever; }
  /// The event that was held back, if it is due.
  [[nodiscard]] EventRef take_held(MonotonicTime now) noexcept;
  [[nodiscard]] bool has_interval() const noexcept { return interval_ > Duration{0}; }
  /// Gives up the event that was held back.
  void release_events() noexcept { held_ = EventRef(); }
  /// How many were left out.
  [[nodiscard]] std::uint64_t omitted_count() const noexcept { return omitted_count_; }

 private:
  struct Band {
    EventType type = 0;
    ScalarType field_type = ScalarType::kDouble;
    FieldPath path{};
    std::uint64_t schema_id = 0;
    Scalar default_value{};
    double threshold = 0;
  };
  /// The last value that was delivered, of one band and source.
  struct Last {
    std::uint32_t band = 0;
    SourceId source = 0;
    double value = 0;
  };
  static constexpr std::size_t kLastCountMax = 64;

  [[nodiscard]] bool is_news(const EventView& event) noexcept;
  [[nodiscard]] bool is_beyond(std::uint32_t band, const EventView& event) const noexcept;
  void remember(const EventView& event) noexcept;

  std::uint32_t every_nth_ = 1;
  Duration interval_{0};
  bool is_trailing_ = true;
  std::vector<Band> bands_{};
  std::vector<Last> lasts_{};  ///< Of fixed capacity.
  std::size_t next_last_ = 0;
  std::uint32_t nth_ = 0;
  MonotonicTime next_open_ = MonotonicTime::min();
  EventRef held_{};
  std::uint64_t omitted_count_ = 0;
};

/// The events that wait for one consumer; those that belong together stay together.
/// Ownership: references to its events.   Threads: one at a time.   RT: alloc-free but for
/// construction.
class DeliveryQueue {
 public:
  DeliveryQueue() noexcept = default;
  DeliveryQueue(QueuePolicy policy, std::uint32_t capacity);

  /// Appends a delivery. False if it is full and its policy is to disconnect.
  [[nodiscard]] bool push(std::span<const EventRef> group, Losses& losses) noexcept;
  /// Appends what another queue holds.
  [[nodiscard]] bool take_over(DeliveryQueue& other, Losses& losses) noexcept;

  [[nodiscard]] bool empty() const noexcept { return size_ == 0; }
  [[nodiscard]] std::size_t size() const noexcept { return size_; }
  /// The i-th event from the front, and whether the one behind it belongs to it.
  struct Entry {
    EventRef event{};
    bool is_continued = false;
  };
  [[nodiscard]] const Entry& operator[](std::size_t i) const noexcept {
    return entries_[(head_ + i) % entries_.size()];
  }
  /// Takes one event from the front.
  void pop() noexcept;
  /// Drops the front delivery whole; how many events it had.
  std::size_t drop_front() noexcept;
  /// Drops all.
  void release_events() noexcept {
    while (!empty())
      pop();
  }

 private:
  [[nodiscard]] bool replace(const EventRef& event) noexcept;

  QueuePolicy policy_ = QueuePolicy::kDropOldest;
  std::size_t capacity_ = 0;
  std::vector<Entry> entries_{};
  std::size_t head_ = 0;
  std::size_t size_ = 0;
};

}  // namespace rtpm::events
