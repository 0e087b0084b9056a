#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "rtpm/base/time.hpp"

/// Predicts a periodic caller's next call, and how much earlier to wake for it. Pure arithmetic on
/// the times passed in.
namespace rtpm::rt {

/// When a call is expected: spinning pays from `from` to `to`.
struct Expectation {
  MonotonicTime from{};
  MonotonicTime to{};
};

/// Estimates the period, phase and jitter of one caller. Several calls in a row count as one turn,
/// which starts at the first of them.
/// @realtime alloc-free, a few ns
class PeriodEstimator {
 public:
  /// The periods worth predicting: shorter ones are spun through, and after longer ones the caches
  /// are cold anyway.
  static constexpr Duration kPeriodMin = std::chrono::microseconds{200};
  static constexpr Duration kPeriodMax = std::chrono::milliseconds{50};

  /// Records a call.
  void on_arrival(MonotonicTime when) noexcept;
  /// Records that the expected call did not come; it is now expected a period later.
  void on_missed() noexcept;

  /// When the next call is expected; nullopt if unknown.
  [[nodiscard]] std::optional<MonotonicTime> next() const noexcept;
  /// How far from next() the call may arrive, by the jitter observed so far.
  [[nodiscard]] Duration jitter() const noexcept { return 3 * deviation_; }
  [[nodiscard]] Duration period() const noexcept { return period_; }
  /// How long after a call another call of the same turn may arrive; 0 if turns have only one call.
  [[nodiscard]] Duration patience() const noexcept { return patience_; }

 private:
  static constexpr int kSteadyCount = 8;  ///< Good periods in a row that establish a rhythm.
  static constexpr int kMissedMax = 3;    ///< Missed calls in a row that end it.

  void learn(Duration interval) noexcept;
  void forget() noexcept;

  MonotonicTime begun_{};  ///< When the caller's last turn started.
  MonotonicTime last_{};   ///< When the caller's last call arrived.
  Duration period_{0};
  Duration deviation_{0};
  Duration patience_{0};
  bool has_further_calls_ = false;  ///< Whether there were further calls in the current turn.
  int steady_count_ = 0;
  int missed_count_ = 0;  ///< Missed calls since begun_.
};

/// Predicts the calls of several callers, and estimates how early its owner must wake.
/// @ownership bounded memory; a new caller replaces the one heard longest ago
/// @threads  one
/// @realtime alloc-free, some ten ns
class ArrivalPredictor {
 public:
  static constexpr std::size_t kCallerCountMax = 16;

  /// Records a call. `caller` is any non-zero number that identifies the caller.
  void on_arrival(std::uint64_t caller, MonotonicTime when) noexcept;
  /// Records that a sleep until `wanted` ended by itself at `woken`.
  void on_woken(MonotonicTime wanted, MonotonicTime woken) noexcept;

  /// The next window worth spinning in; nullopt if no caller has a rhythm. Calls expected before
  /// `now` that did not come count as missed.
  [[nodiscard]] std::optional<Expectation> next(MonotonicTime now) noexcept;
  /// How long after a call it pays to spin for another call of the same turn.
  [[nodiscard]] Duration patience() const noexcept;
  /// How much earlier than needed a sleep should end.
  [[nodiscard]] Duration lead() const noexcept;

 private:
  struct Caller {
    std::uint64_t number = 0;  ///< 0 if unused.
    MonotonicTime heard{};
    PeriodEstimator estimator;
  };
  [[nodiscard]] std::optional<Expectation> window_of(
      const PeriodEstimator& estimator) const noexcept;

  std::array<Caller, kCallerCountMax> callers_{};
  std::size_t caller_count_ = 0;
  Duration lateness_ = std::chrono::microseconds{60};  ///< The smoothed lateness of wake-ups.
  Duration lateness_deviation_ = std::chrono::microseconds{10};
};

}  // namespace rtpm::rt
