#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "rtpm/base/time.hpp"

/// Predicts when a periodic caller calls next, and how much earlier to wake for it. Pure arithmetic
/// on the times passed in.
namespace rtpm::rt {

/// When something is expected: worth spinning for from `from` to `to`.
struct Expectation {
  MonotonicTime from{};
  MonotonicTime to{};
};

/// Estimates the period, the phase and the jitter of one caller. Several calls in a row in one turn
/// count as one, at the time when the turn begins.
/// @realtime alloc-free, a few ns
class PeriodEstimator {
 public:
  /// Periods that are worth it: shorter ones are spun through, longer ones wake cold anyway.
  static constexpr Duration kPeriodMin = std::chrono::microseconds{200};
  static constexpr Duration kPeriodMax = std::chrono::milliseconds{50};

  /// A call came.
  void on_arrival(MonotonicTime when) noexcept;
  /// The time of the expected call has passed without it; it is expected a period later.
  void on_missed() noexcept;

  /// When the next call is expected to begin, if that can be said by now.
  [[nodiscard]] std::optional<MonotonicTime> next() const noexcept;
  /// How far from next() the call may come, by the jitter observed so far.
  [[nodiscard]] Duration jitter() const noexcept { return 3 * deviation_; }
  [[nodiscard]] Duration period() const noexcept { return period_; }
  /// How long after a call another of the same turn may come; 0 if turns have one call only.
  [[nodiscard]] Duration patience() const noexcept { return patience_; }

 private:
  static constexpr int kSteadyCount = 8;  ///< Good periods in a row that make a rhythm,
  static constexpr int kMissedMax = 3;    ///< and missed calls in a row that end it.

  void learn(Duration interval) noexcept;
  void forget() noexcept;

  MonotonicTime begun_{};  ///< When the caller's last turn began,
  MonotonicTime last_{};   ///< and when its last call came.
  Duration period_{0};
  Duration deviation_{0};
  Duration patience_{0};
  bool has_further_calls_ = false;  ///< In this turn.
  int steady_count_ = 0;
  int missed_count_ = 0;  ///< Since begun_.
};

/// Predicts the calls of a few callers at once, and estimates how early its owner must wake.
/// @ownership its own memory, bounded; a new caller replaces the one heard longest ago
/// @threads  one
/// @realtime alloc-free, some ten ns
class ArrivalPredictor {
 public:
  static constexpr std::size_t kCallerCountMax = 16;

  /// `caller` is any non-zero number that identifies the caller.
  void on_arrival(std::uint64_t caller, MonotonicTime when) noexcept;
  /// A sleep that was to end at `wanted` ended by itself at `woken`.
  void on_woken(MonotonicTime wanted, MonotonicTime woken) noexcept;

  /// The next time worth spinning, or nothing while no caller has a rhythm. Expected calls before
  /// `now` that did not come count as missed.
  [[nodiscard]] std::optional<Expectation> next(MonotonicTime now) noexcept;
  /// How long after a call it is worth spinning for another of the same turn.
  [[nodiscard]] Duration patience() const noexcept;
  /// How much earlier than needed a sleep is to end.
  [[nodiscard]] Duration lead() const noexcept;

 private:
  struct Caller {
    std::uint64_t number = 0;  ///< 0 if there is none.
    MonotonicTime heard{};
    PeriodEstimator estimator;
  };
  [[nodiscard]] std::optional<Expectation> window_of(
      const PeriodEstimator& estimator) const noexcept;

  std::array<Caller, kCallerCountMax> callers_{};
  std::size_t caller_count_ = 0;
  Duration lateness_ = std::chrono::microseconds{60};  ///< The lateness of wake-ups, smoothed,
  Duration lateness_deviation_ = std::chrono::microseconds{10};
};

}  // namespace rtpm::rt
