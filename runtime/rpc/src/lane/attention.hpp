#pragma once

#include <cstdint>

#include "model/source.hpp"
#include "rtpm/base/time.hpp"

namespace rtpm::rpc {

/// Decides which source of a lane is polled next, so that none starves. Polls the source of the
/// last frame, the hot one, first: that saves a system call per frame. Pure arithmetic.
/// @threads  one at a time
/// @realtime alloc-free, a few ns
class Attention {
 public:
  /// While the hot source has frames, the others are polled after this many of them, or after
  /// kLookIntervalMax. For shared memory the count does not apply: a frame takes less time than a
  /// poll.
  static constexpr std::uint32_t kStreakMax = 16;
  static constexpr Duration kLookIntervalMax = std::chrono::microseconds{200};
  /// While no source has frames, the sockets are polled at this interval: a poll takes as long as a
  /// call through shared memory. While only shared memory is hot, the interval doubles with each
  /// poll that finds nothing.
  static constexpr Duration kLookIntervalMin = std::chrono::microseconds{4};
  /// While one shared-memory connection has frames, the others are polled at this interval.
  static constexpr Duration kMemoryLookInterval = std::chrono::microseconds{10};

  [[nodiscard]] SourceTag hot() const noexcept { return hot_; }
  void set_hot(SourceTag source) noexcept { hot_ = source; }

  /// Records a turn that served open calls. True if callers should be polled next.
  [[nodiscard]] bool on_own_work() noexcept { return ++own_streak_ >= kStreakMax; }
  /// Records a turn that polls callers.
  void on_turn() noexcept { own_streak_ = 0; }
  /// Records that there was no work at `now`.
  void on_idle(MonotonicTime now) noexcept { idle_ = now; }

  /// Whether to poll the other shared-memory connections, after a frame at `received`.
  [[nodiscard]] bool is_memory_look_due(MonotonicTime received) const noexcept {
    return received - last_memory_look_ >= kMemoryLookInterval;
  }
  void on_memory_look(MonotonicTime received) noexcept { last_memory_look_ = received; }

  /// Whether to poll the system, after a frame of the hot source at `received`.
  [[nodiscard]] bool is_look_due(MonotonicTime received, bool is_memory_hot) noexcept {
    const bool is_time = since_look(received) >= kLookIntervalMax;
    return ++streak_ >= kStreakMax ? is_time || !is_memory_hot : is_time;
  }
  /// Whether to poll the system while no frames arrive.
  [[nodiscard]] bool is_idle_look_due() noexcept { return since_look(idle_) >= look_interval_; }
  /// Records that the system is polled, or waited for.
  void on_look() noexcept {
    streak_ = 0;
    last_look_ = kNever;
  }
  /// Records the result of a poll without waiting.
  void on_looked(bool has_found, bool is_memory_hot) noexcept {
    look_interval_ = has_found || !is_memory_hot ? kLookIntervalMin : 2 * look_interval_;
    if (look_interval_ > kLookIntervalMax) look_interval_ = kLookIntervalMax;
  }

 private:
  [[nodiscard]] Duration since_look(MonotonicTime now) noexcept {
    if (last_look_ == kNever) last_look_ = now;
    return now - last_look_;
  }

  SourceTag hot_ = kPortSource;
  std::uint32_t streak_ = 0;      ///< Frames of the hot source since the last poll.
  std::uint32_t own_streak_ = 0;  ///< Turns in a row that served open calls only.
  Duration look_interval_ = kLookIntervalMin;
  MonotonicTime idle_{};
  /// The time of the first query after the last poll; kNever until then.
  MonotonicTime last_look_ = kNever;
  MonotonicTime last_memory_look_{};
};

}  // namespace rtpm::rpc
