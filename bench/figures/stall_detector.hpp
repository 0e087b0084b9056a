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

/// Feels whether the CPUs of a run stand still: a thread on each, above all that is measured, wakes
/// up every so often and notes when it was let run too late. That is the machine's doing: a
/// hypervisor's, most often, or a system call of some other program in which the kernel does not
/// let anybody else run. Where there is no privilege for such threads it feels nothing.
/// Threads: one.   Set-up only.
class StallDetector {
 public:
  /// Waking up takes up to 0.2 ms on a virtual machine, and no stall is needed for that.
  static constexpr Duration kStallMin = std::chrono::microseconds{300};
  /// Longer ones are not counted: the kernel's throttling of real-time threads looks like that, and
  /// may be a contender's own fault. So that is never left out.
  static constexpr Duration kStallMax = std::chrono::milliseconds{30};

  StallDetector() = default;
  StallDetector(const StallDetector&) = delete;
  StallDetector& operator=(const StallDetector&) = delete;
  ~StallDetector();
  [[nodiscard]] expected<void, std::string> start(std::span<const int> cpus);
  [[nodiscard]] std::uint64_t count() const noexcept { return count_.load(); }
  /// Those it was started on.
  [[nodiscard]] std::span<const int> cpus() const noexcept { return cpus_; }

 private:
  void run() noexcept;

  std::atomic<bool> is_over_{false};
  std::atomic<std::uint64_t> count_{0};
  std::vector<int> cpus_;
  std::vector<rt::Thread> threads_;
};

}  // namespace rtpm::bench
