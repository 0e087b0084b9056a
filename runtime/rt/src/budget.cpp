#include "rtpm/rt/budget.hpp"

#include <algorithm>
#include <optional>

#include "os/native_clock.hpp"
#include "rtpm/rt/clock.hpp"

namespace rtpm::rt {
namespace {

thread_local RealtimeBudget thread_budget;

}  // namespace

RealtimeBudget::RealtimeBudget(RealtimeLimit limit, MonotonicTime now) noexcept {
  if (!limit.is_limited()) return;
  const double share = std::clamp(limit.share() - kReserve, 0.05, 0.99);
  earned_per_slept_ = share / (1 - share);
  spent_ = now + kBurst;
  compared_ = now;
  run_time_ = os::thread_run_time();
}

bool RealtimeBudget::is_spent_indeed(MonotonicTime now) noexcept {
  const Duration ran = os::thread_run_time();
  const Duration missing = (now - compared_) - (ran - run_time_) - slept_;
  compared_ = now;
  run_time_ = ran;
  slept_ = Duration{0};
  if (missing > kPreemptionMax) {
    on_slept(now - missing, now, missing);
    slept_ = Duration{0};
  }
  return is_spent(now);
}

Duration RealtimeBudget::overdue(MonotonicTime now) const noexcept {
  if (now < spent_ || now - spent_ < kDebtMax) return Duration{0};
  const double debt = static_cast<double>((now - spent_).count());
  return std::max(kPause, Duration{static_cast<Duration::rep>(debt / earned_per_slept_)});
}

void RealtimeBudget::on_slept(MonotonicTime begin, MonotonicTime end,
                              std::optional<Duration> slept) noexcept {
  if (!is_limited()) return;
  const bool was_spent = is_spent(begin);
  const Duration off = std::max(slept.value_or(end - begin - kWakeCost), Duration{0});
  // A sleep of seconds earns no more than one of milliseconds; in double it does not overflow.
  const double earned = std::min(static_cast<double>(off.count()) * earned_per_slept_, 1e10);
  // The sleep itself costs nothing.
  spent_ = std::min(spent_ + off + Duration{static_cast<Duration::rep>(earned)}, end + kBurst);
  slept_ += off;
  is_block_in_vain_ = was_spent && off < kPause / 2;
}

RealtimeBudget& this_thread_budget() noexcept {
  return thread_budget;
}

AsleepScope::AsleepScope() noexcept {
  if (!thread_budget.is_limited()) return;
  begin_ = now();
  if (thread_budget.is_exact(begin_)) run_before_ = os::thread_run_time();
}

AsleepScope::~AsleepScope() {
  if (begin_ == MonotonicTime{}) return;
  const MonotonicTime end = now();
  std::optional<Duration> slept;
  if (run_before_) slept = (end - begin_) - (os::thread_run_time() - *run_before_);
  thread_budget.on_slept(begin_, end, slept);
}

}  // namespace rtpm::rt
