#pragma once

#include <optional>
#include <span>
#include <vector>

#include "rtpm/base/time.hpp"

namespace rtpm::bench {

/// How much time a hypervisor takes from each CPU of a run, to some ten microseconds. The kernel's
/// clock for tasks stands still meanwhile; how far it falls behind the hardware's clock tells it.
/// Where that clock is not shown (no /proc/thread-self/sched), nothing is known.
/// Threads: one, which runs on each of the CPUs for a moment and is then where it was.
/// Set-up only: it takes some 0.1 ms for each CPU.
class StolenTime {
 public:
  /// Counts from now on.
  explicit StolenTime(std::span<const int> cpus);
  /// The most that was taken from any of the CPUs since.
  [[nodiscard]] std::optional<Duration> most() const;

 private:
  struct Cpu {
    int number = 0;
    Duration behind{0};
  };
  std::vector<Cpu> cpus_;
};

}  // namespace rtpm::bench
