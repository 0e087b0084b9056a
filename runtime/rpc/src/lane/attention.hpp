#pragma once

#include <cstdint>

#include "model/source.hpp"
#include "rtpm/base/time.hpp"

namespace rtpm::rpc {

/// Decides which source of a lane is asked next, so that none waits long for another. The source of
/// the last frame, which is hot, is asked first: that spares a system call a frame. Pure
/// arithmetic.
/// @threads  one at a time
/// @realtime alloc-free, a few ns
class Attention {
 public:
  /// While the hot source has frames, the others are asked after so many of them, or after
  /// kLookIntervalMax. Through memory the number does not count: a frame takes less than a look.
  static constexpr std::uint32_t kStreakMax = 16;
  static constexpr Duration kLookIntervalMax = std::chrono::microseconds{200};
  /// While nothing has frames, the sockets are asked so often: a look takes as long as a call
  /// through memory. While only memory is hot the interval doubles with each look in vain.
  static constexpr Duration kLookIntervalMin = std::chrono::microseconds{4};
  /// While one connection through memory has frames, the others are asked so often.
  static constexpr Duration kMemoryLookInterval = std::chrono::microseconds{10};

  [[nodiscard]] SourceTag hot() const noexcept { return hot_; }
  void set_hot(SourceTag source) noexcept { hot_ = source; }

  /// A turn served open calls; true if callers are to be asked at last.
  [[nodiscard]] bool on_own_work() noexcept { return ++own_streak_ >= kStreakMax; }
  /// A turn asks callers.
  void on_turn() noexcept { own_streak_ = 0; }
  /// There was nothing to do at `now`.
  void on_idle(MonotonicTime now) noexcept { idle_ = now; }

  /// Whether to ask the other connections through memory, after a frame at `received`.
  [[nodiscard]] bool is_memory_look_due(MonotonicTime received) const noexcept {
    return received - last_memory_look_ >= kMemoryLookInterval;
  }
  void on_memory_look(MonotonicTime received) noexcept { last_memory_look_ = received; }

  /// Whether to ask the system, after a frame of the hot source at `received`.
  [[nodiscard]] bool is_look_due(MonotonicTime received, bool is_memory_hot) noexcept {
    const bool is_time = since_look(received) >= kLookIntervalMax;
    return ++streak_ >= kStreakMax ? is_time || !is_memory_hot : is_time;
  }
  /// Whether to ask the system, while no frame comes.
  [[nodiscard]] bool is_idle_look_due() noexcept { return since_look(idle_) >= look_interval_; }
  /// The system is asked, or waited for.
  void on_look() noexcept {
    streak_ = 0;
    last_look_ = kNever;
  }
  /// It was only asked.
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
  std::uint32_t streak_ = 0;      ///< Frames of the hot source since the last look.
  std::uint32_t own_streak_ = 0;  ///< Turns in a row that served open calls only.
  Duration look_interval_ = kLookIntervalMin;
  MonotonicTime idle_{};
  MonotonicTime last_look_ = kNever;  ///< kNever: it ends now, whenever that is.
  MonotonicTime last_memory_look_{};
};

}  // namespace rtpm::rpc
