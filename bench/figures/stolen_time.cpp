#include "figures/stolen_time.hpp"

#include <sched.h>

#include <algorithm>
#include <ctime>
#include <fstream>
#include <sstream>
#include <string>

#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/native_time.hpp"

namespace rtpm::bench {
namespace {

/// Moves the calling thread to other CPUs, and back at its end.
class Excursion {
 public:
  Excursion() noexcept { sched_getaffinity(0, sizeof home_, &home_); }
  Excursion(const Excursion&) = delete;
  Excursion& operator=(const Excursion&) = delete;
  ~Excursion() { sched_setaffinity(0, sizeof home_, &home_); }
  /// False if there is no such CPU, or this thread may not use it.
  [[nodiscard]] bool go_to(int cpu) noexcept {
    cpu_set_t there;
    CPU_ZERO(&there);
    CPU_SET(static_cast<std::size_t>(cpu), &there);
    return sched_setaffinity(0, sizeof there, &there) == 0;
  }

 private:
  cpu_set_t home_{};
};

// Returns how far this CPU's task clock is behind. The kernel updates it when a thread gets the
// CPU, so this thread sleeps first.
std::optional<Duration> read_behind() {
  rt::sleep_until(rt::now() + std::chrono::microseconds{10});
  timespec now{};
  clock_gettime(CLOCK_MONOTONIC_RAW, &now);
  std::ifstream file("/proc/thread-self/sched");
  for (std::string line; std::getline(file, line);) {
    if (!line.starts_with("se.exec_start")) continue;
    std::istringstream value(line.substr(line.find(':') + 1));
    double given_ms = 0;
    if (!(value >> given_ms)) return std::nullopt;
    return rt::to_duration(now) - Duration{static_cast<Duration::rep>(given_ms * 1e6)};
  }
  return std::nullopt;
}

}  // namespace

StolenTime::StolenTime(std::span<const int> cpus) {
  Excursion excursion;
  for (const int cpu : cpus) {
    if (!excursion.go_to(cpu)) continue;
    if (const auto behind = read_behind()) cpus_.push_back({cpu, *behind});
  }
}

std::optional<Duration> StolenTime::most() const {
  std::optional<Duration> most;
  Excursion excursion;
  for (const Cpu& cpu : cpus_) {
    if (!excursion.go_to(cpu.number)) continue;
    const auto behind = read_behind();
    if (behind) most = std::max(most.value_or(Duration{0}), *behind - cpu.behind);
  }
  return most;
}

}  // namespace rtpm::bench
