#pragma once

#include <sys/types.h>

#include <optional>
#include <string>
#include <string_view>

#include "rtpm/base/expected.hpp"
#include "rtpm/base/time.hpp"
#include "settings.hpp"
#include "sides/server_process.hpp"

/// Servers that are programs of their own, as users start them: for figures that a forked copy of
/// this process would blur, namely start-up time and memory.
namespace rtpm::bench {

/// The kind of server.
enum class Standalone : std::uint8_t { kRtpm, kFloor };
/// Parses "rtpm" or "floor"; nullopt for any other text.
[[nodiscard]] std::optional<Standalone> standalone_of(std::string_view text) noexcept;

/// Serves in this process as `rtpm-bench serve WHO` asks, with the first of the settings' carriers
/// and wait strategies, and announces on standard output where: "+ADDRESS", or "-REASON". Returns
/// only if it cannot serve: the exit code.
[[nodiscard]] int serve_standalone(Standalone which, const Settings& settings);

/// Starts this program again as a server. It runs with SCHED_FIFO where `settings` allow it, and on
/// the placement's server CPU.   Set-up only.
[[nodiscard]] expected<ServerProcess, std::string> start_standalone(Standalone which,
                                                                    Carrier carrier,
                                                                    rt::WaitStrategy wait,
                                                                    const Settings& settings);

/// The port of a floor's address.
[[nodiscard]] std::uint16_t floor_port(const std::string& address);

/// The memory of a process.
struct MemoryUse {
  double resident_mib = 0;      ///< Shared libraries included.
  double proportional_mib = 0;  ///< Shared pages count divided by their number of users.
};
[[nodiscard]] MemoryUse memory_of(pid_t process);
/// The CPU time that all threads of a process have taken so far.
[[nodiscard]] Duration cpu_time_of(pid_t process);

}  // namespace rtpm::bench
