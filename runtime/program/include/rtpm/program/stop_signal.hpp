#pragma once

#include <cstdint>
#include <vector>

#include "rtpm/base/time.hpp"

namespace rtpm::program {

/// The signals that ask a program to end: SIGINT (Ctrl-C), SIGTERM, SIGHUP (its terminal is gone)
/// and SIGQUIT. The latter two are left out if they are ignored, as under nohup and in a shell's
/// background jobs. On Windows SIGINT and SIGTERM, for programs that start others.
[[nodiscard]] std::vector<int> stop_signals();

/// Whether a program continues when it can no longer write to standard output.
enum class LostOutput : std::uint8_t {
  kGoesOn,       ///< It serves other programs.
  kRequestsEnd,  ///< Its output is its only purpose.
};

/// The request to end the program: one of stop_signals(). On Windows: Ctrl-C, Ctrl-Break, a closed
/// console, a shutdown, or another process that sets the event "Local\rtpm-stop-PID".
///
/// The constructor blocks them in the calling thread and in all threads started later. So they
/// interrupt no real-time thread, and a second one does not cut an orderly shutdown short (SIGKILL
/// still ends the program at once). They stay blocked after destruction and across exec.
/// @threads  construct it before any other thread starts; then any, concurrently
class StopSignal {
 public:
  /// Without a free file descriptor, reports it on standard error and exits with code 1.
  /// @realtime set-up only
  explicit StopSignal(LostOutput lost_output = LostOutput::kGoesOn);
  StopSignal(const StopSignal&) = delete;
  StopSignal& operator=(const StopSignal&) = delete;
  ~StopSignal();

  /// Whether a signal has arrived, or output was lost that requests the end; stays true.
  /// @realtime alloc-free, one system call, does not block
  [[nodiscard]] bool is_requested() const noexcept;
  /// Blocks until a signal has arrived.
  /// @realtime alloc-free, one system call
  void wait() const noexcept;
  /// Blocks until is_requested(), or `duration` has passed; negative counts as 0. Output that is
  /// lost meanwhile counts at the next call.
  /// @return whether the end is requested
  /// @realtime alloc-free, one system call
  [[nodiscard]] bool wait_for(Duration duration) const noexcept;

 private:
  [[nodiscard]] bool is_output_lost() const noexcept;

  LostOutput lost_output_;
  std::intptr_t source_;
};

}  // namespace rtpm::program
