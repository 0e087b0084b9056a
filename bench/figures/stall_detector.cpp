#include "figures/stall_detector.hpp"

#include <sched.h>

#include <utility>

#include "rtpm/rt/clock.hpp"

namespace rtpm::bench {

StallDetector::~StallDetector() {
  is_over_.store(true, std::memory_order_relaxed);
}

expected<void, std::string> StallDetector::start(std::span<const int> cpus) {
  cpus_.assign(cpus.begin(), cpus.end());
  for (const int cpu : cpus) {
    auto thread = rt::Thread::start({.name = "bench-detector", .cpus = {cpu}}, [this] { run(); });
    if (!thread) return unexpected{thread.error().text()};
    threads_.push_back(std::move(*thread));
  }
  return {};
}

void StallDetector::run() noexcept {
  const sched_param parameter{.sched_priority = sched_get_priority_max(SCHED_FIFO)};
  if (sched_setscheduler(0, SCHED_FIFO, &parameter) != 0) return;
  // Not a multiple of any caller's period, so that it does not meet the same call each time.
  constexpr Duration kPeriod = std::chrono::microseconds{1730};
  MonotonicTime due = rt::now() + kPeriod;
  while (!is_over_.load(std::memory_order_relaxed)) {
    rt::sleep_until(due);
    const MonotonicTime now = rt::now();
    if (now - due >= kStallMin && now - due < kStallMax) count_.fetch_add(1);
    while (due <= now)
      due += kPeriod;
  }
}

}  // namespace rtpm::bench
