#pragma once

#include <atomic>
#include <cstdint>

#include "rtpm/base/time.hpp"

namespace rtpm::replay {

/// Maps this host's time to the time of the recording.
/// @ownership a value, not copied
/// @threads  start() once, before the others; the rest from any
/// @realtime alloc-free, without waiting
class Pace {
 public:
  /// @param length  the recording's length
  /// @param speed   seconds of the recording that are played per second
  Pace(Duration length, double speed, bool loops) noexcept
      : length_(length), speed_(speed), loops_(loops) {}

  void start(MonotonicTime now) noexcept { begin_.store(now, std::memory_order_release); }

  /// A place in the recording.
  struct Position {
    Duration at{};            ///< Time since the recording's start.
    std::uint64_t round = 0;  ///< Counts repetitions from 0.
    bool is_over = false;     ///< Only without `loops`.
  };
  /// The place at `now`; before start() the recording's start.
  [[nodiscard]] Position position(MonotonicTime now) const noexcept;

 private:
  Duration length_;
  double speed_;
  bool loops_;
  std::atomic<MonotonicTime> begin_{kNever};
};

}  // namespace rtpm::replay
