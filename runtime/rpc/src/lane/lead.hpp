#pragma once

#include "rtpm/base/time.hpp"
#include "rtpm/rt/clock.hpp"

namespace rtpm::rpc {

using Clock = MonotonicTime (*)() noexcept;

/// The right to touch what belongs to a lane's leader: its sources, sessions, open calls, report.
/// The only thread of a lane has it for life; a thread of a pool has it while it holds the lock.
class Lead {
 public:
  Lead(const Lead&) = delete;
  Lead& operator=(const Lead&) = delete;

  /// The time, by the lane's clock.
  [[nodiscard]] MonotonicTime now() const noexcept { return clock_(); }

 private:
  friend class Lane;  // When none of its threads runs.
  friend class SoloExecution;
  friend class ThreadPool;
  explicit Lead(Clock clock = rt::now) noexcept : clock_(clock) {}

  Clock clock_;
};

}  // namespace rtpm::rpc
