#pragma once

#include "rtpm/base/time.hpp"

namespace rtpm::options {

/// The request to end the program: SIGINT (Ctrl-C) or SIGTERM.
///
/// The constructor blocks both signals in the calling thread and in all threads started later. So
/// they interrupt no real-time thread, and a second one does not cut an orderly shutdown short
/// (SIGQUIT and SIGKILL still end the program at once). They stay blocked after destruction and
/// across exec.
/// @threads  construct it before any other thread starts; then any, concurrently
class StopSignal {
 public:
  /// Without a free file descriptor, reports it on standard error and exits with code 1.
  /// @realtime set-up only
  StopSignal();
  StopSignal(const StopSignal&) = delete;
  StopSignal& operator=(const StopSignal&) = delete;
  ~StopSignal();

  /// Whether a signal has arrived; stays true.
  /// @realtime alloc-free, one system call, does not block
  [[nodiscard]] bool is_requested() const noexcept;
  /// Blocks until a signal has arrived.
  /// @realtime alloc-free, one system call
  void wait() const noexcept;
  /// Blocks until a signal has arrived, or `duration` has passed; negative counts as 0.
  /// @return whether a signal has arrived
  /// @realtime alloc-free, one system call
  [[nodiscard]] bool wait_for(Duration duration) const noexcept;

 private:
  int signals_ = -1;
};

}  // namespace rtpm::options
