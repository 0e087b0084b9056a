#pragma once

#include <algorithm>
#include <cstdint>

#include "rtpm/base/time.hpp"
#include "rtpm/rt/host.hpp"
#include "rtpm/rt/periodic.hpp"
#include "rtpm/rt/spin_estimator.hpp"
#include "rtpm/rt/wait.hpp"

namespace rtpm::rpc {

/// Decides what an idle lane does: poll or sleep, and until when. Pure arithmetic.
/// @threads  one at a time
/// @realtime alloc-free, some ten ns
class Idling {
 public:
  struct Next {
    bool polls = false;
    bool is_prediction = false;    ///< Sleeps until shortly before an expected call.
    MonotonicTime until = kNever;  ///< When a sleep ends at the latest.
  };

  explicit Idling(const rt::WaitConfig& wait) noexcept : wait_(wait) {
    // On one CPU a polling lane would only keep its callers from running.
    const bool may_poll = wait.strategy != rt::WaitStrategy::kAdaptive &&
                          wait.strategy != rt::WaitStrategy::kPeriodic;
    if (!may_poll && rt::usable_cpu_count() == 1) wait_.strategy = rt::WaitStrategy::kBlock;
  }

  /// Whether it sleeps as soon as there is no work.
  [[nodiscard]] bool is_blocking() const noexcept {
    return wait_.strategy == rt::WaitStrategy::kBlock;
  }
  /// Records a call of `session`.
  void on_call(std::uint64_t session, MonotonicTime received) noexcept {
    if (wait_.strategy == rt::WaitStrategy::kPeriodic) predictor_.on_arrival(session, received);
  }
  /// Records that there was work; the last frame arrived at `received`.
  void on_work(MonotonicTime received) noexcept {
    polling_end_ = kNever;
    estimator_.on_work(received);
  }
  /// Decides what to do, as there is no work at `now`.
  [[nodiscard]] Next on_idle(MonotonicTime now) noexcept {
    if (wait_.strategy == rt::WaitStrategy::kSpin) return {.polls = true};
    if (is_blocking()) return {};
    if (polling_end_ == kNever) polling_end_ = now + polling_time(now);
    if (now < polling_end_) return {.polls = true};
    if (wait_.strategy != rt::WaitStrategy::kPeriodic) return {};
    const auto window = predictor_.next(now);
    has_rhythm_ = window.has_value();
    if (!window) return {};
    if (now >= window->from) return {.polls = true};
    return {.is_prediction = true, .until = window->from};
  }
  /// Records that the sleep requested by `slept` ended at `now`. If there is work, on_work()
  /// follows.
  void on_woken(const Next& slept, MonotonicTime now, bool has_work) noexcept {
    if (has_work) return;
    // A sleep that ended without work does not restart polling.
    if (!slept.is_prediction) polling_end_ = MonotonicTime::min();
    if (slept.is_prediction && now >= slept.until) predictor_.on_woken(slept.until, now);
  }

 private:
  // Polling after a call is wasted if the next one never arrives that soon. With steadily paced
  // callers it is wasted unless they make several calls in a row.
  [[nodiscard]] Duration polling_time(MonotonicTime now) noexcept {
    const bool does_pay = estimator_.on_idle(now, wait_.spin);
    if (has_rhythm_) return std::min(wait_.spin, predictor_.patience());
    return does_pay ? wait_.spin : Duration{0};
  }

  rt::WaitConfig wait_;
  /// When the polling ends; kNever if there has been work since then.
  MonotonicTime polling_end_ = kNever;
  bool has_rhythm_ = false;  ///< According to the last prediction.
  rt::ArrivalPredictor predictor_;
  rt::SpinEstimator estimator_;
};

}  // namespace rtpm::rpc
