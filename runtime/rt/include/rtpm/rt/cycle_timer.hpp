#pragma once

#include <cstdint>

#include "rtpm/base/assert.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/rt/clock.hpp"

namespace rtpm::rt {

/// The due times of a periodic loop, and how often it was late:
///
///     rt::CycleTimer cycle(1ms);
///     while (is_running) {
///       cycle.wait();
///       render();
///       cycle.finish();
///     }
///
/// Due times are absolute: a late cycle does not shift the next ones. Cycles whose time is already
/// over when a cycle ends are skipped.
/// @threads  one
/// @realtime alloc-free; wait() one system call
class CycleTimer {
 public:
  /// @param period  greater than 0
  /// @param begin   when the first cycle is due
  explicit CycleTimer(Duration period, MonotonicTime begin = now()) noexcept
      : period_(period), due_(begin) {
    RTPM_ASSERT(period > Duration{0}, "a period is greater than 0");
  }

  /// When the current cycle is due, or was.
  [[nodiscard]] MonotonicTime due() const noexcept { return due_; }
  /// Cycles that ended after the next one was due, plus the cycles skipped as a result.
  [[nodiscard]] std::uint64_t overrun_count() const noexcept { return overrun_count_; }

  /// Sleeps until the current cycle is due.
  void wait() const noexcept { sleep_until(due_); }

  /// Ends the current cycle. The next one is the first whose time is not over.
  void finish() noexcept {
    due_ += period_;
    const Duration behind = now() - due_;
    if (behind <= Duration{0}) return;
    const auto skipped_count = behind / period_;
    overrun_count_ += static_cast<std::uint64_t>(skipped_count) + 1;
    due_ += skipped_count * period_;
  }

 private:
  Duration period_;
  MonotonicTime due_;
  std::uint64_t overrun_count_ = 0;
};

}  // namespace rtpm::rt
