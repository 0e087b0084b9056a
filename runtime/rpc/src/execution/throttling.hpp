#pragma once

#include "rtpm/base/time.hpp"
#include "rtpm/rt/budget.hpp"

// Decides when a lane's thread pauses, so that the kernel throttles neither it nor more urgent
// threads; see rt/budget.hpp. The lane makes the pauses. The budget is an rt::RealtimeBudget,
// except in tests.
namespace rtpm::rpc {

struct Pause {
  enum class Kind : std::uint8_t {
    kNone,
    kWait,   ///< Wait for work, at most until `until`.
    kSleep,  ///< Sleep until `until`, ignoring events.
  };
  Kind kind = Kind::kNone;
  MonotonicTime until{};
};

/// The pause of a thread that polls without finding work.
template <class Budget>
[[nodiscard]] Pause pause_while_polling(Budget& budget, MonotonicTime now) noexcept {
  if (!budget.must_pause(now)) return {};
  const bool must_sleep = budget.must_sleep(now);
  return {must_sleep ? Pause::Kind::kSleep : Pause::Kind::kWait, now + rt::RealtimeBudget::kPause};
}

/// The pause of a thread that always finds work and so never waits.
/// @param received  when the last frame arrived
/// @param clock     read only if the budget may be spent
template <class Budget, class Clock>
[[nodiscard]] Pause pause_after_work(Budget& budget, MonotonicTime received, Clock clock) noexcept {
  if (budget.overdue(received) == Duration{0}) return {};
  // A call may have run since `received`.
  const MonotonicTime now = clock();
  if (!budget.must_pause(now)) return {};
  const Duration rest = budget.overdue(now);
  if (rest == Duration{0}) return {};
  return {Pause::Kind::kSleep, now + rest};
}

}  // namespace rtpm::rpc
