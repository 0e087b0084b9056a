#pragma once

#include "rtpm/base/time.hpp"

namespace rtpm::options {

/// The request to end the program: SIGINT (Ctrl-C) or SIGTERM.
///
/// Its making blocks both signals in the calling thread and, by inheritance, in all threads that
/// are started later. So no real-time thread is ever interrupted by them, and a program that is
/// already ending is not cut short by a second one (SIGQUIT and SIGKILL still end it at once). They
/// stay blocked when it ends, and in programs that this one executes.
///
/// Threads: make it before any other thread; then all of it from any thread, several at once.
class StopSignal {
 public:
  /// Set-up only. If the system gives no file descriptor, says so on standard error and ends the
  /// program with exit code 1.
  StopSignal();
  StopSignal(const StopSignal&) = delete;
  StopSignal& operator=(const StopSignal&) = delete;
  ~StopSignal();

  /// Whether a signal came; true for ever after.   RT: alloc-free, one syscall, does not block.
  [[nodiscard]] bool is_requested() const noexcept;
  /// Returns when a signal has come.   RT: alloc-free, one syscall.
  void wait() const noexcept;
  /// Returns true when a signal has come, false after `duration` without one. A negative duration
  /// is as 0.   RT: alloc-free, one syscall.
  [[nodiscard]] bool wait_for(Duration duration) const noexcept;

 private:
  int signals_ = -1;
};

}  // namespace rtpm::options
