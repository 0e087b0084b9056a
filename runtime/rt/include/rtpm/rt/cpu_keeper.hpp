#pragma once

#include <atomic>
#include <memory>
#include <string>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/rt/semaphore.hpp"
#include "rtpm/rt/thread.hpp"

namespace rtpm::rt {

/// Keeps one CPU awake on demand. When a thread of low priority pauses to avoid throttling
/// (budget.hpp), its CPU would sleep for a tenth of a millisecond, and a more urgent thread woken
/// during that time would pay for the CPU's wake-up: at least 20 µs on a virtual machine. So a
/// thread at nice 19 spins on the CPU meanwhile; it yields to all other threads.
/// @threads  keep_until(): any; the rest: the thread that created it
class CpuKeeper {
 public:
  /// Starts the thread, named `name`, on `cpu`.
  /// @realtime set-up only
  /// @errors   a CPU that does not exist; no thread left. The caller can continue without it
  [[nodiscard]] static expected<std::unique_ptr<CpuKeeper>, SetupError> start(
      const std::string& name, int cpu);
  CpuKeeper(const CpuKeeper&) = delete;
  CpuKeeper& operator=(const CpuKeeper&) = delete;
  /// Ends the thread. Waits until the system gives the thread CPU time.
  ~CpuKeeper();

  /// Keeps the CPU awake until `time`, or longer if an earlier call requested it.
  /// @realtime alloc-free, ≤ 1 syscall
  void keep_until(MonotonicTime time) noexcept;

 private:
  CpuKeeper() = default;
  void run() noexcept;

  std::atomic<std::int64_t> until_ns_{0};
  std::atomic<bool> is_called_{false};
  std::atomic<bool> is_ending_{false};
  Semaphore call_;
  Thread thread_;
};

}  // namespace rtpm::rt
