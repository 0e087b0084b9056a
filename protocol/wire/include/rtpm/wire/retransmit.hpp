#pragma once

#include "rtpm/base/time.hpp"
#include "rtpm/wire/limits.hpp"

namespace rtpm::wire {

/// What the calls of a channel tell of its round trip: smoothed mean and deviation.
/// RT: alloc-free.   Source: spec/hprotocol.md#hp-5.3; RFC 6298 with other bounds.
class RoundTrip {
 public:
  /// No interval is shorter, from now on.
  void set_interval_min(Duration interval_min) noexcept { interval_min_ = interval_min; }
  /// A call that was sent once, and its answer, took so long.
  void add(Duration sample) noexcept;
  /// A call that was repeated ended after such a wait; 0: a call that was not repeated ended. Where
  /// two in a row were repeated, the wait holds for the next call, too: else a round trip that grew
  /// beyond the wait would never be measured again, as each call would be repeated, so none would
  /// count. One alone tells of a loss, for which the next call is not to wait longer.
  void back_off(Duration wait) noexcept;

  /// How long to wait for an answer.
  [[nodiscard]] Duration interval() const noexcept;
  /// The same for a call's first copy.
  [[nodiscard]] Duration first_interval() const noexcept;
  /// The smoothed round trip, 0 before the first measurement.
  [[nodiscard]] Duration smoothed() const noexcept { return smoothed_; }

 private:
  Duration interval_min_ = kRetransmitIntervalMin;
  Duration smoothed_{0};
  Duration deviation_{0};
  Duration backed_off_{0};
  bool was_repeated_ = false;  ///< The call that ended last.
};

/// Decides when one call is repeated: after the round trip's mean and deviation, doubled with each
/// repetition, within the bounds of limits.hpp.
/// Ownership: views the channel's RoundTrip.   RT: alloc-free.   Source: spec/hprotocol.md#hp-5.3.
class RetransmitTimer {
 public:
  explicit RetransmitTimer(RoundTrip& path) noexcept : path_(&path) {}

  /// The call is sent for the first time.
  void begin(MonotonicTime now) noexcept;
  /// It was sent again.
  void repeat(MonotonicTime now) noexcept;
  /// A part of the answer, or of its acknowledgement, is here: the wait begins anew, and the call
  /// is not measured.
  void progress(MonotonicTime now) noexcept;
  /// It is not repeated before so long from now; what was doubled is forgotten.
  void wait(MonotonicTime now, Duration wait) noexcept;
  /// Its answer is here. Measures the round trip, unless the call was repeated: then nobody knows
  /// which copy was answered (Karn's rule), but that the round trip was no longer than all of it.
  void end(MonotonicTime now) noexcept;

  [[nodiscard]] MonotonicTime due() const noexcept { return due_; }
  [[nodiscard]] Duration current() const noexcept { return current_; }
  [[nodiscard]] int repeat_count() const noexcept { return repeat_count_; }

 private:
  RoundTrip* path_;
  Duration current_{0};
  MonotonicTime sent_{};
  MonotonicTime due_ = kNever;
  int repeat_count_ = 0;
  bool is_measured_ = true;
};

}  // namespace rtpm::wire
