#pragma once

#include <cstdint>

#include "figures/report.hpp"
#include "figures/stalls.hpp"
#include "settings.hpp"

namespace rtpm::bench {

/// CPU time of all CPUs so far, in ticks.
struct CpuTime {
  std::uint64_t stolen = 0;  ///< The time that the hypervisor took away.
  std::uint64_t total = 0;
};
/// @realtime set-up only: reads /proc/stat
[[nodiscard]] CpuTime read_cpu_time();

/// Adds the part of the CPU time since `before` that was stolen, as "steal_percent", and a mark if
/// it matters.
void add_steal(Json& result, const CpuTime& before);

/// Detects whether the machine stood still since construction: the hypervisor took CPU time away
/// (steal), or a detector counted a stall.
/// @threads   one
/// @realtime  set-up only: reads /proc, and with a detector visits its CPUs
class RoundWatch {
 public:
  /// The least stolen time that matters to a p99.9 of some tenths of a millisecond.
  static constexpr Duration kStolenMin = std::chrono::microseconds{300};

  /// Reads steal from /proc/stat, to hundredths of a second, and on the detector's CPUs to some ten
  /// microseconds.
  /// @lifetime refers to `detector`
  explicit RoundWatch(const StallDetector& detector);
  [[nodiscard]] bool was_disturbed() const;

 private:
  const StallDetector& detector_;
  StolenTime stolen_time_;
  std::uint64_t stolen_;
  std::uint64_t stall_count_;
};

/// The machine as far as it matters for latencies.
[[nodiscard]] Json describe_environment(const Placement& placement, bool is_realtime);

}  // namespace rtpm::bench
