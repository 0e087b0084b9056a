#pragma once

#include <sys/types.h>

#include "outcome.hpp"
#include "rtpm/base/time.hpp"
#include "settings.hpp"
#include "sides/server_process.hpp"

/// Servers that are programs of their own, as users start them: for figures that a forked copy of
/// this process would blur, namely start-up time and memory.
namespace rtpm::bench {

/// Serves in this process as `rtpm-bench serve SIDE` asks, with the first of the settings' carriers
/// and wait strategies, and announces on standard output where: "+ADDRESS", or "-REASON". Returns
/// only if it cannot serve: the exit code.
[[nodiscard]] int serve_standalone(Side side, const Settings& settings);

/// Starts this program again as a server. It runs with SCHED_FIFO where `settings` allow it, and on
/// the placement's server CPU.
/// @return   the process; the floor's address is its port
/// @realtime set-up only
[[nodiscard]] Outcome<ServerProcess> start_standalone(Side side, Carrier carrier,
                                                      rt::WaitStrategy wait,
                                                      const Settings& settings);

/// The memory of a process, shared libraries included.
[[nodiscard]] double resident_mib_of(pid_t process);
/// The CPU time that all threads of a process have taken so far.
[[nodiscard]] Duration cpu_time_of(pid_t process);

}  // namespace rtpm::bench
