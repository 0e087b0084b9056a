#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <mutex>
#include <optional>
#include <utility>

#include "live/callbacks.hpp"

namespace rtpm::console {

/// Events on their way to the web server's thread. If that thread falls behind, a stream's oldest
/// events are dropped and counted, which limits memory and protects the thread's other work.
/// @threads  any
class EventInbox {
 public:
  /// Limits of each stream.
  static constexpr std::size_t kByteMax = std::size_t{4} << 20;
  static constexpr std::size_t kCountMax = 8192;

  /// @return whether the inbox was empty before; then the caller schedules pop()
  [[nodiscard]] bool push(HubEvent event) {
    const std::lock_guard lock(mutex_);
    Stream& stream = streams_[static_cast<std::size_t>(event.stream)];
    const bool was_empty = std::exchange(count_, count_ + 1) == 0;
    stream.byte_count += size_of(event);
    stream.events.push_back(std::move(event));
    while (stream.events.size() > kCountMax ||
           (stream.byte_count > kByteMax && stream.events.size() > 1)) {
      take_front(stream);
      ++dropped_count_;
    }
    return was_empty;
  }
  /// The next event, changes of devices first; nullopt if none is queued.
  [[nodiscard]] std::optional<HubEvent> pop() {
    const std::lock_guard lock(mutex_);
    for (const EventStream next : kOrder) {
      Stream& stream = streams_[static_cast<std::size_t>(next)];
      if (!stream.events.empty()) return take_front(stream);
    }
    return std::nullopt;
  }
  [[nodiscard]] bool is_empty() const {
    const std::lock_guard lock(mutex_);
    return count_ == 0;
  }
  [[nodiscard]] std::uint64_t dropped_count() const {
    const std::lock_guard lock(mutex_);
    return dropped_count_;
  }

 private:
  struct Stream {
    std::deque<HubEvent> events{};
    std::size_t byte_count = 0;
  };
  static constexpr std::array kOrder{EventStream::kChange, EventStream::kMark, EventStream::kSample,
                                     EventStream::kLog, EventStream::kGeneric};

  [[nodiscard]] static std::size_t size_of(const HubEvent& event) noexcept {
    return sizeof event + event.payload.size();
  }
  HubEvent take_front(Stream& stream) {
    HubEvent event = std::move(stream.events.front());
    stream.events.pop_front();
    stream.byte_count -= size_of(event);
    --count_;
    return event;
  }

  mutable std::mutex mutex_{};
  std::array<Stream, kOrder.size()> streams_{};
  std::size_t count_ = 0;
  std::uint64_t dropped_count_ = 0;
};

}  // namespace rtpm::console
