#pragma once

#include <atomic>
#include <memory>
#include <string>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/rt/semaphore.hpp"
#include "rtpm/rt/thread.hpp"

namespace rtpm::rt {

/// Keeps one CPU awake on demand. When a thread of low priority pauses for its budget's sake
/// (budget.hpp), its CPU would go to sleep for a tenth of a millisecond, and a more urgent thread
/// woken just then would pay for the CPU's own wake-up: 20 µs and more on a virtual machine. A
/// thread at nice 19 spins there meanwhile. It gives way to all other threads.
/// @threads  keep_until() from any; the other functions from the one that made it
class CpuKeeper {
 public:
  /// Starts the thread, named `name`, on `cpu`.
  /// @realtime set-up only
  /// @errors   a CPU that does not exist, no thread left: go on without
  [[nodiscard]] static expected<std::unique_ptr<CpuKeeper>, SetupError> start(
      const std::string& name, int cpu);
  CpuKeeper(const CpuKeeper&) = delete;
  CpuKeeper& operator=(const CpuKeeper&) = delete;
  /// Ends the thread, which may take as long as the system gives it no CPU time.
  ~CpuKeeper();

  /// Keeps the CPU awake until `time`, or longer if an earlier call asked for more.
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
