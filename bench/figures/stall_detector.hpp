#pragma once

#include <atomic>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "rtpm/base/expected.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/rt/thread.hpp"

namespace rtpm::bench {

/// Detects whether the CPUs of a run stand still: a thread on each CPU, above all that is measured,
/// wakes up periodically and records when it ran too late. The machine causes that: most often a
/// hypervisor, or another program's system call in which the kernel does not preempt. Without the
/// privilege for such threads it detects nothing.
/// Threads: one.   Set-up only.
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
  [[nodiscard]] expected<void, std::string> start(std::span<const int> cpus);
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

}  // namespace rtpm::bench
