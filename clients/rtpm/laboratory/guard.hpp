#pragma once

#include <functional>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/time.hpp"

namespace rtpm::laboratory {

/// How the work of run_guarded() ended.
struct GuardedEnd {
  int exit_code = 0;
  bool was_killed = false;  ///< By a signal; its descendants were ended all the same.
};

/// Runs `work` in a process below this one. Each of the two ends the work's descendants if the
/// other one is killed: this process because they become its children, the work because the other
/// end of its lifeline closes. Signals to stop that this process gets are passed on as bytes of the
/// lifeline, except those of the terminal, which the work gets itself.
/// @param patience  of descendants between SIGTERM and SIGKILL, if the work was killed
/// @param leaves_terminal  this process does not keep its standard streams
/// @threads  before any other thread starts
/// @errors   the system's
[[nodiscard]] expected<GuardedEnd, SetupError> run_guarded(
    const std::function<int(int lifeline)>& work, Duration patience, bool leaves_terminal);

}  // namespace rtpm::laboratory
