#pragma once

#include <atomic>
#include <cstdint>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "outcome.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/rt/thread.hpp"

/// Two ways to find out that the machine, and no contender, stood still.
namespace rtpm::bench {

/// Detects whether the CPUs of a run stand still: a thread on each CPU, above all that is measured,
/// wakes up periodically and records when it ran too late. The machine causes that: most often a
/// hypervisor, or another program's system call in which the kernel does not preempt. Without the
/// privilege for such threads it detects nothing.
/// @threads  one
/// @realtime set-up only
class StallDetector {
 public:
  /// A wake-up takes up to 0.2 ms on a virtual machine even without a stall.
  static constexpr Duration kStallMin = std::chrono::microseconds{300};
  /// Longer ones are not counted: the kernel's throttling of real-time threads looks like that, and
  /// may be a contender's own fault. So those are never left out.
  static constexpr Duration kStallMax = std::chrono::milliseconds{30};

  StallDetector() = default;
  StallDetector(const StallDetector&) = delete;
  StallDetector& operator=(const StallDetector&) = delete;
  ~StallDetector();
  [[nodiscard]] Outcome<> start(std::span<const int> cpus);
  [[nodiscard]] std::uint64_t count() const noexcept { return count_.load(); }
  /// The CPUs that it was started on.
  [[nodiscard]] std::span<const int> cpus() const noexcept { return cpus_; }

 private:
  void run() noexcept;

  std::atomic<bool> is_over_{false};
  std::atomic<std::uint64_t> count_{0};
  std::vector<int> cpus_;
  std::vector<rt::Thread> threads_;
};

/// Measures the time that a hypervisor takes from each CPU of a run, to some ten microseconds. The
/// kernel's clock for tasks stands still meanwhile; its lag behind the hardware's clock shows the
/// loss. Where that clock is not shown (no /proc/thread-self/sched), nothing is known.
/// @threads  one, which runs on each of the CPUs for a moment and then returns to its own
/// @realtime set-up only: it takes some 0.1 ms for each CPU
class StolenTime {
 public:
  /// Counts from now on.
  explicit StolenTime(std::span<const int> cpus);
  /// The most time that was taken from any of the CPUs since.
  [[nodiscard]] std::optional<Duration> most() const;

 private:
  std::vector<std::pair<int, Duration>> cpus_;  ///< Each with its task clock's lag.
};

}  // namespace rtpm::bench
