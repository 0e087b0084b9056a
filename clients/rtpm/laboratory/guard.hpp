#pragma once

#include <functional>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/time.hpp"

namespace rtpm::laboratory {

/// The end of run_guarded()'s work.
struct GuardedEnd {
  int exit_code = 0;
  bool was_killed = false;  ///< Killed by a signal; its descendants were ended, too.
};

/// Runs `work` in a child process. Each of the two ends the work's descendants if the other one is
/// killed: this process because it adopts them, the work because the other end of its lifeline
/// closes. Stop signals that this process receives are forwarded as bytes of the lifeline, except
/// those of the terminal, which the work receives itself.
/// @param patience  time between SIGTERM and SIGKILL for descendants, if the work was killed
/// @param leaves_terminal  this process gives up its standard streams
/// @threads  before any other thread starts
/// @errors   the system's error
[[nodiscard]] expected<GuardedEnd, SetupError> run_guarded(
    const std::function<int(int lifeline)>& work, Duration patience, bool leaves_terminal);

}  // namespace rtpm::laboratory
