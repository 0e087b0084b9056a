#include "figures/stalls.hpp"

#include <sched.h>

#include <algorithm>
#include <ctime>
#include <fstream>
#include <string>

#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/native_time.hpp"

namespace rtpm::bench {
namespace {

// Returns how far a CPU's task clock is behind. The kernel updates it when a thread gets the CPU,
// so this thread sleeps there first. Nullopt if this thread may not use the CPU.
std::optional<Duration> read_lag(int cpu) {
  cpu_set_t there;
  CPU_ZERO(&there);
  CPU_SET(static_cast<std::size_t>(cpu), &there);
  if (sched_setaffinity(0, sizeof there, &there) != 0) return std::nullopt;
  rt::sleep_until(rt::now() + std::chrono::microseconds{10});
  timespec now{};
  clock_gettime(CLOCK_MONOTONIC_RAW, &now);
  std::ifstream file("/proc/thread-self/sched");
  for (std::string line; std::getline(file, line);) {
    if (!line.starts_with("se.exec_start")) continue;
    const double given_ms = std::stod(line.substr(line.find(':') + 1));
    return rt::to_duration(now) - Duration{static_cast<Duration::rep>(given_ms * 1e6)};
  }
  return std::nullopt;
}

/// Calls `visit(cpu, lag)` for each CPU, and returns this thread to its own.
template <class Visit>
void visit_cpus(std::span<const int> cpus, Visit visit) {
  cpu_set_t home;
  sched_getaffinity(0, sizeof home, &home);
  for (const int cpu : cpus) {
    if (const auto lag = read_lag(cpu)) visit(cpu, *lag);
  }
  sched_setaffinity(0, sizeof home, &home);
}

}  // namespace

StallDetector::~StallDetector() {
  is_over_.store(true, std::memory_order_relaxed);
}

Outcome<> StallDetector::start(std::span<const int> cpus) {
  cpus_.assign(cpus.begin(), cpus.end());
  for (const int cpu : cpus) {
    auto thread = rt::Thread::start({.name = "bench-detector", .cpus = {cpu}}, [this] { run(); });
    if (!thread) return failure(thread.error());
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

StolenTime::StolenTime(std::span<const int> cpus) {
  visit_cpus(cpus, [this](int cpu, Duration lag) { cpus_.emplace_back(cpu, lag); });
}

std::optional<Duration> StolenTime::most() const {
  std::optional<Duration> most;
  for (const auto& [cpu, before] : cpus_) {
    visit_cpus(std::span(&cpu, 1), [&, before = before](int, Duration lag) {
      most = std::max(most.value_or(Duration{0}), lag - before);
    });
  }
  return most;
}

}  // namespace rtpm::bench
