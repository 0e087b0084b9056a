#pragma once

#include <optional>
#include <span>
#include <vector>

#include "rtpm/base/time.hpp"

namespace rtpm::bench {

/// Measures the time that a hypervisor takes from each CPU of a run, to some ten microseconds. The
/// kernel's clock for tasks stands still meanwhile; its lag behind the hardware's clock shows the
/// loss. Where that clock is not shown (no /proc/thread-self/sched), nothing is known.
/// Threads: one, which runs on each of the CPUs for a moment and then returns to its own.
/// Set-up only: it takes some 0.1 ms for each CPU.
class StolenTime {
 public:
  /// Counts from now on.
  explicit StolenTime(std::span<const int> cpus);
  /// The most time that was taken from any of the CPUs since.
  [[nodiscard]] std::optional<Duration> most() const;

 private:
  struct Cpu {
    int number = 0;
    Duration behind{0};
  };
  std::vector<Cpu> cpus_;
};

}  // namespace rtpm::bench
