#include "rtpm/rt/periodic.hpp"

#include <algorithm>
#include <utility>

#include "wake_up.hpp"

namespace rtpm::rt {
namespace {

constexpr Duration kLeadMin = std::chrono::microseconds{10};
constexpr Duration kLeadMax = os::kWakeUpMax;
/// Calls closer together than this belong to one turn, regardless of the period.
constexpr Duration kTurnMin = std::chrono::microseconds{100};
/// A caller whose jitter exceeds this part of the period has no usable rhythm.
constexpr int kJitterShare = 8;
/// The largest part of the period that may be spun through before a call, given the usual wake-up
/// time. An occasional call that finds its server asleep is the price of leaving the CPU to other
/// threads.
constexpr int kSpinShare = 16;

Duration distance(Duration a, Duration b) noexcept {
  return a > b ? a - b : b - a;
}

}  // namespace

void PeriodEstimator::on_arrival(MonotonicTime when) noexcept {
  const bool is_first = begun_ == MonotonicTime{};
  // Further calls of a turn closely follow its first.
  const Duration turn = std::max(kTurnMin, period_ / 4);
  if (!is_first && when - last_ < turn) {
    patience_ = std::max(patience_, 2 * (when - last_));
    has_further_calls_ = true;
    last_ = when;
    return;
  }
  // In turns without further calls, their estimate decays.
  if (!std::exchange(has_further_calls_, false)) patience_ = patience_ * 3 / 4;
  last_ = when;
  const MonotonicTime begun_before = begun_;
  begun_ = when;
  if (is_first) return;
  // If calls were missed, the interval covers several periods.
  const Duration interval = (when - begun_before) / (missed_count_ + 1);
  missed_count_ = 0;
  if (interval < kPeriodMin || interval > kPeriodMax) return forget();
  learn(interval);
}

void PeriodEstimator::learn(Duration interval) noexcept {
  if (period_ == Duration{0}) {
    period_ = interval;
    return;
  }
  const Duration error = distance(interval, period_);
  if (error > period_ / 4) {
    // The rhythm has changed or ended. A single outlier does not end a steady rhythm.
    if (steady_count_ >= kSteadyCount) {
      steady_count_ -= kSteadyCount / 2;
    } else {
      period_ = interval;
      deviation_ = Duration{0};
      steady_count_ = 0;
    }
    return;
  }
  // The period follows drift within about ten turns; the phase always follows the last call.
  period_ += (interval - period_) / 16;
  deviation_ += (error - deviation_) / 8;
  steady_count_ = std::min(steady_count_ + 1, 2 * kSteadyCount);
}

void PeriodEstimator::on_missed() noexcept {
  if (++missed_count_ > kMissedMax) forget();
}

void PeriodEstimator::forget() noexcept {
  period_ = deviation_ = Duration{0};
  steady_count_ = missed_count_ = 0;
}

std::optional<MonotonicTime> PeriodEstimator::next() const noexcept {
  if (steady_count_ < kSteadyCount) return std::nullopt;
  return begun_ + (missed_count_ + 1) * period_;
}

void ArrivalPredictor::on_arrival(std::uint64_t caller, MonotonicTime when) noexcept {
  Caller* place = nullptr;
  for (std::size_t i = 0; i < caller_count_; ++i) {
    Caller& each = callers_[i];
    if (each.number == caller) {
      place = &each;
      break;
    }
    if (place == nullptr || each.heard < place->heard) place = &each;
  }
  if (place == nullptr || place->number != caller) {
    if (caller_count_ < callers_.size()) place = &callers_[caller_count_++];
    *place = Caller{caller, when, {}};
  }
  place->heard = when;
  place->estimator.on_arrival(when);
}

void ArrivalPredictor::on_woken(MonotonicTime wanted, MonotonicTime woken) noexcept {
  const Duration late = std::max(woken - wanted, Duration{0});
  // A longer delay than any wake-up was a stall, which no lead could compensate.
  if (late > kLeadMax) return;
  lateness_deviation_ += (distance(late, lateness_) - lateness_deviation_) / 8;
  lateness_ += (late - lateness_) / 8;
}

Duration ArrivalPredictor::patience() const noexcept {
  Duration longest{0};
  for (std::size_t i = 0; i < caller_count_; ++i)
    longest = std::max(longest, callers_[i].estimator.patience());
  return longest;
}

Duration ArrivalPredictor::lead() const noexcept {
  return std::clamp<Duration>(lateness_ + 3 * lateness_deviation_, kLeadMin, kLeadMax);
}

// The window in which to spin for the caller's next turn.
std::optional<Expectation> ArrivalPredictor::window_of(
    const PeriodEstimator& estimator) const noexcept {
  const auto next = estimator.next();
  if (!next) return std::nullopt;
  // Spinning for a caller without a usable rhythm would only cost CPU time.
  if (estimator.jitter() > estimator.period() / kJitterShare) return std::nullopt;
  const Duration early =
      std::min(lead() + estimator.jitter(), lateness_ + estimator.period() / kSpinShare);
  return Expectation{*next - early, *next + estimator.jitter() + kLeadMin};
}

std::optional<Expectation> ArrivalPredictor::next(MonotonicTime now) noexcept {
  std::optional<Expectation> first;
  for (std::size_t i = 0; i < caller_count_; ++i) {
    PeriodEstimator& estimator = callers_[i].estimator;
    auto window = window_of(estimator);
    while (window && window->to < now) {
      estimator.on_missed();
      window = window_of(estimator);
    }
    if (window && (!first || window->from < first->from)) first = window;
  }
  return first;
}

}  // namespace rtpm::rt
