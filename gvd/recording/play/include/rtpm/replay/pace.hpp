#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>

#include "rtpm/base/latest.hpp"
#include "rtpm/base/time.hpp"

namespace rtpm::replay {

/// Maps this host's time to the time of a recording: at a steady pace with pauses and jumps, or in
/// steps, where each read of a device is a step.
/// @ownership a value, not copied
/// @threads  play(), pause() and seek() from one at a time; the rest from any
/// @realtime alloc-free, without waiting
class Pace {
 public:
  struct Config {
    Duration length{};  ///< The recording's length.
    bool loops = false;
    std::size_t stepped_count = 0;  ///< Devices whose reads are the steps; 0 for a steady pace.
  };
  /// A position in the recording.
  struct Position {
    Duration at{};            ///< Time since the recording's start.
    std::uint64_t round = 0;  ///< Counts repetitions from 0.
  };

  explicit Pace(const Config& config) noexcept;

  /// Continues from the current position.
  /// @param speed  seconds of the recording per second
  void play(MonotonicTime now, double speed) noexcept;
  void pause(MonotonicTime now) noexcept;
  /// Jumps to a position, and pauses there.
  void seek(Duration at) noexcept;

  /// Records that a device shows its sample at this position. The pace follows the device that is
  /// farthest ahead.
  void step_to(Position position) noexcept;
  /// Records that a device has shown its last sample. After the last device the recording is over.
  void end_steps(MonotonicTime now) noexcept;

  [[nodiscard]] const Config& config() const noexcept { return config_; }
  [[nodiscard]] bool is_stepped() const noexcept { return config_.stepped_count > 0; }
  /// The position at `now`; before the beginning, the recording's start.
  [[nodiscard]] Position position(MonotonicTime now) const noexcept;
  [[nodiscard]] bool has_reached(Position position, MonotonicTime now) const noexcept;
  /// Whether the recording was over at `now`; never in a loop.
  [[nodiscard]] bool is_over(MonotonicTime now) const noexcept;
  /// When a steady pace reaches a position; kNever during a pause.
  [[nodiscard]] MonotonicTime due(Position position) const noexcept;

 private:
  struct Course {
    MonotonicTime begin{};
    Duration from{0};  ///< The position at `begin`.
    double speed = 1;
    bool is_playing = false;
  };
  [[nodiscard]] Course course() const noexcept { return course_.read().value_or(Course{}); }
  /// The time played, over all rounds.
  [[nodiscard]] Duration played(MonotonicTime now) const noexcept;
  [[nodiscard]] Duration played_at(Position position) const noexcept;

  Config config_;
  Latest<Course> course_{};
  std::atomic<Duration> stepped_{Duration{-1}};
  std::atomic<std::size_t> stepping_count_;
  std::atomic<MonotonicTime> over_since_{kNever};
};

}  // namespace rtpm::replay
