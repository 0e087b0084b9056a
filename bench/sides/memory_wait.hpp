#pragma once

#include <linux/futex.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <atomic>
#include <cstdint>
#include <ctime>

#include "rtpm/base/time.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/wait.hpp"

/// How the raw floors of shared memory wait: on a word that they spin on, and then on a futex.
namespace rtpm::bench {

/// Where a thread sleeps.
struct alignas(64) Bed {
  std::atomic<std::uint32_t> is_taken{0};
  std::atomic<std::uint32_t> wake_count{0};

  void wake() noexcept {
    if (is_taken.load(std::memory_order_seq_cst) == 0 || is_taken.exchange(0) == 0) return;
    wake_count.fetch_add(1);
    syscall(SYS_futex, &wake_count, FUTEX_WAKE, 1, nullptr, nullptr, 0);
  }
  /// Sleeps unless `has_work()`.
  template <class HasWork>
  void sleep(HasWork has_work) noexcept {
    const std::uint32_t before = wake_count.load();
    is_taken.store(1, std::memory_order_seq_cst);
    const timespec patience{.tv_sec = 1, .tv_nsec = 0};
    if (!has_work()) {
      syscall(SYS_futex, &wake_count, FUTEX_WAIT, before, &patience, nullptr, 0);
    }
    is_taken.store(0, std::memory_order_relaxed);
  }
  /// Sleeps until `has_work()`; false after a second without any. One sleep is not enough: who is
  /// stopped between its answer and the wake-up wakes the next sleep instead.
  template <class HasWork>
  bool sleep_until(HasWork has_work) noexcept {
    const MonotonicTime end = rt::now() + std::chrono::seconds{1};
    while (!has_work() && rt::now() < end)
      sleep(has_work);
    return has_work();
  }
};

/// How long a waiting side spins before it sleeps.
inline Duration spin_of(const rt::WaitConfig& wait, Duration give_up) noexcept {
  switch (wait.strategy) {
    case rt::WaitStrategy::kPeriodic:
    case rt::WaitStrategy::kSpin:
      return give_up;
    case rt::WaitStrategy::kAdaptive:
      return wait.spin;
    case rt::WaitStrategy::kBlock:
      break;
  }
  return Duration{0};
}

/// Spins until `has_work()`; false if it took longer than `spin`. Looks at the clock only now and
/// then.
template <class HasWork>
bool spin_until(HasWork has_work, Duration spin) noexcept {
  if (has_work()) return true;
  if (spin <= Duration{0}) return false;
  const MonotonicTime end = spin == Duration::max() ? kNever : rt::now() + spin;
  // Looks between two at the clock.
  constexpr int kLooksPerClock = 64;
  while (true) {
    for (int look = 0; look < kLooksPerClock; ++look) {
      if (has_work()) return true;
    }
    if (end != kNever && rt::now() >= end) return false;
  }
}

}  // namespace rtpm::bench
