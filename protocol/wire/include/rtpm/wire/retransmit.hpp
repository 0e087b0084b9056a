#pragma once

#include "rtpm/base/time.hpp"
#include "rtpm/wire/limits.hpp"

namespace rtpm::wire {

/// Decides when a call is repeated: after the round trip's smoothed mean and deviation, doubled
/// with each repetition, within the bounds of limits.hpp.
/// RT: alloc-free.   Source: spec/hprotocol.md#hp-5.3; RFC 6298 with other bounds.
class RetransmitTimer {
 public:
  /// The call is sent for the first time.
  void begin(MonotonicTime now) noexcept;
  /// It was sent again.
  void repeat(MonotonicTime now) noexcept;
  /// A part of the answer, or of its acknowledgement, is here: the wait begins anew, and the call
  /// is not measured.
  void progress(MonotonicTime now) noexcept;
  /// Its answer is here. Measures the round trip, unless the call was repeated: then nobody knows
  /// which copy was answered (Karn's rule); the doubled wait then holds for the next call, too.
  void end(MonotonicTime now) noexcept;

  /// When to repeat.
  [[nodiscard]] MonotonicTime due() const noexcept { return due_; }
  /// How often the call was repeated.
  [[nodiscard]] int repeat_count() const noexcept { return repeat_count_; }
  /// The smoothed round trip, 0 before the first measurement.
  [[nodiscard]] Duration smoothed() const noexcept { return smoothed_; }

 private:
  [[nodiscard]] Duration interval() const noexcept;

  Duration smoothed_{0};
  Duration deviation_{0};
  Duration current_{0};
  Duration backed_off_{0};  ///< The wait at the end of the last call, if that was repeated.
  MonotonicTime sent_{};
  MonotonicTime due_ = kNever;
  int repeat_count_ = 0;
  bool is_measured_ = true;
};

}  // namespace rtpm::wire
