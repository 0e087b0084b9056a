#pragma once

#include <atomic>
#include <cstdint>
#include <cstring>
#include <vector>

#include "outcome.hpp"
#include "rtpm/base/bytes.hpp"
#include "rtpm/base/time.hpp"

namespace rtpm::bench {

/// The 32 bytes of an event that the events case pushes.
struct EventStamp {
  std::int64_t due_ns = 0;   ///< When it was to be pushed.
  std::uint32_t block = 0;   ///< The stretch of the run that it belongs to,
  std::uint32_t number = 0;  ///< and its number within that stretch.
  std::uint64_t filling[2]{};
};
static_assert(sizeof(EventStamp) == 32);

/// Where the first consumers record when each event reached them. Threads: note() by each consumer
/// for its own row; the rest by the one thread that waits for them.   RT: note() is alloc-free.
class EventBoard {
 public:
  EventBoard(std::size_t consumer_count, std::size_t event_count)
      : event_count_(event_count), cells_(consumer_count * event_count) {}

  /// Begins another stretch; events of earlier ones no longer count.
  void begin(std::uint32_t block) {
    for (std::int64_t& cell : cells_)
      cell = 0;
    arrived_count_.store(0, std::memory_order_relaxed);
    block_.store(block, std::memory_order_release);
  }
  /// Records that an event reached a consumer.
  void note(std::size_t consumer, ConstBytes bytes, MonotonicTime now) noexcept {
    EventStamp stamp;
    if (bytes.size() < sizeof stamp) return;
    std::memcpy(&stamp, bytes.data(), sizeof stamp);
    const std::size_t cell = consumer * event_count_ + stamp.number;
    if (stamp.block != block_.load(std::memory_order_acquire) || stamp.number >= event_count_ ||
        cell >= cells_.size()) {
      return;
    }
    cells_[cell] = to_ns(now) - stamp.due_ns;
    arrived_count_.fetch_add(1, std::memory_order_release);
  }
  [[nodiscard]] std::uint64_t arrived_count() const noexcept {
    return arrived_count_.load(std::memory_order_acquire);
  }
  /// The latency; 0 if the event did not arrive.
  [[nodiscard]] Duration at(std::size_t consumer, std::size_t event) const noexcept {
    return Duration{cells_[consumer * event_count_ + event]};
  }
  [[nodiscard]] std::size_t event_count() const noexcept { return event_count_; }

 private:
  std::size_t event_count_;
  std::vector<std::int64_t> cells_;
  std::atomic<std::uint32_t> block_{0};
  std::atomic<std::uint64_t> arrived_count_{0};
};

/// Supplier and consumers of one side. Threads: push() from one.
class EventSide {
 public:
  virtual ~EventSide() = default;
  [[nodiscard]] virtual Outcome<> push(const EventStamp& stamp) = 0;
  /// Lets the last `count` consumers take a tenth of a second for each event, or stops that. Only a
  /// hub's consumers can be slow.
  virtual void set_slow(int count) { static_cast<void>(count); }
};

}  // namespace rtpm::bench
