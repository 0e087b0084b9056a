#pragma once

#include "rtpm/base/time.hpp"
#include "rtpm/wire/limits.hpp"

namespace rtpm::wire {

/// A channel's round trip, measured by its calls: smoothed mean and deviation.
/// @realtime alloc-free
/// @source   spec/hprotocol.md#hp-5.3; RFC 6298 with other bounds
class RoundTrip {
 public:
  /// Sets the lower bound of interval().
  void set_interval_min(Duration interval_min) noexcept { interval_min_ = interval_min; }
  /// Adds the round trip of a call that was sent once.
  void add(Duration sample) noexcept;
  /// Records the last wait of a repeated call; 0 for a call that was not repeated. After two
  /// repeated calls in a row the wait also applies to the next call. Otherwise a round trip longer
  /// than the wait would never be measured again, since repeated calls are not measured. A single
  /// repeated call merely indicates a loss.
  void back_off(Duration wait) noexcept;

  /// How long to wait for an answer.
  [[nodiscard]] Duration interval() const noexcept;
  /// How long to wait after the first transmission of a call.
  [[nodiscard]] Duration first_interval() const noexcept;
  /// The smoothed round trip; 0 before the first measurement.
  [[nodiscard]] Duration smoothed() const noexcept { return smoothed_; }

 private:
  Duration interval_min_ = kRetransmitIntervalMin;
  Duration smoothed_{0};
  Duration deviation_{0};
  Duration backed_off_{0};
  bool was_repeated_ = false;  ///< Whether the last ended call was repeated.
};

/// Decides when a call is repeated: after RoundTrip::interval(), doubled with each repetition,
/// within the bounds of limits.hpp.
/// @ownership views the channel's RoundTrip
/// @realtime alloc-free
/// @source   spec/hprotocol.md#hp-5.3
class RetransmitTimer {
 public:
  explicit RetransmitTimer(RoundTrip& path) noexcept : path_(&path) {}

  /// Call it when the call is first sent.
  void begin(MonotonicTime now) noexcept;
  /// Call it when the call is sent again.
  void repeat(MonotonicTime now) noexcept;
  /// Call it when part of the answer or an acknowledgement arrived: restarts the wait. The call is
  /// then not measured.
  void progress(MonotonicTime now) noexcept;
  /// Sets the next repetition to `wait` from now; later waits double that.
  void wait(MonotonicTime now, Duration wait) noexcept;
  /// Call it when the answer arrived. Measures the round trip, unless the call was repeated: it is
  /// unknown which transmission was answered (Karn's rule); the total is only an upper bound.
  void end(MonotonicTime now) noexcept;

  /// When to repeat; kNever for not at all.
  [[nodiscard]] MonotonicTime due() const noexcept { return due_; }
  /// The current wait, doubled with each repetition.
  [[nodiscard]] Duration current() const noexcept { return current_; }
  /// The number of repetitions of the call.
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
