#pragma once

#include <sys/types.h>

#include <optional>
#include <string>
#include <string_view>

#include "rtpm/base/expected.hpp"
#include "rtpm/base/time.hpp"
#include "settings.hpp"
#include "sides/server_process.hpp"

/// Servers that are programs of their own, as users start them: for what a forked copy of this
/// process would blur, its start and its memory.
namespace rtpm::bench {

/// Which server.
enum class Standalone : std::uint8_t { kRtpm, kFloor };
/// "rtpm" or "floor"; nothing of another text.
[[nodiscard]] std::optional<Standalone> standalone_of(std::string_view text) noexcept;

/// Serves in this process as `rtpm-bench serve WHO` is asked to, with the first of the settings'
/// carriers and wait strategies, and says on standard output where: "+ADDRESS", or "-REASON".
/// Returns only if it cannot serve: the exit code.
[[nodiscard]] int serve_standalone(Standalone which, const Settings& settings);

/// Starts this program again as a server. It runs with SCHED_FIFO where `settings` allow it, and on
/// the placement's server CPU.   Set-up only.
[[nodiscard]] expected<ServerProcess, std::string> start_standalone(Standalone which,
                                                                    Carrier carrier,
                                                                    rt::WaitStrategy wait,
                                                                    const Settings& settings);

/// The port of a floor's address.
[[nodiscard]] std::uint16_t floor_port(const std::string& address);

/// What a process has in memory.
struct MemoryUse {
  double resident_mib = 0;      ///< Of it, shared libraries included.
  double proportional_mib = 0;  ///< What others share counts by their number.
};
[[nodiscard]] MemoryUse memory_of(pid_t process);
/// CPU time that a process has taken so far, of all its threads.
[[nodiscard]] Duration cpu_time_of(pid_t process);

}  // namespace rtpm::bench
