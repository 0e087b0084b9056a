#pragma once

#include <optional>
#include <string>
#include <vector>

#include "rtpm/base/expected.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/options/options.hpp"
#include "rtpm/rpc/server.hpp"
#include "rtpm/rt/cpu_latency.hpp"

namespace rtpm::options {

/// All that can be said of a program's server, its lanes, and the process around them.
struct ServerSettings {
  /// Filled with the program's defaults before add_server(). Lanes have names, by which they are
  /// spoken of in options: "haptic", or "lane-haptic" for threads that are called so.
  rpc::ServerConfig server{};
  std::optional<Duration> cpu_latency{};  ///< Within which CPUs are to wake; none: not asked for.
  bool shows_setup = false;               ///< Whether to print what the system granted.
  std::vector<std::string> lanes{};       ///< The lanes' names; add_server() fills them in.
};

/// Adds the options of a server, one table for every program that has one: --host, --port, the
/// limits, shared memory, real-time mode and CPU latency; --lanes, a list of the lanes' names; and
/// for each lane, those that the user adds included, --lane-NAME-low, -priority, -cpus, -wait,
/// -spin, -schedule, -threads, -dynamic-threads, -dynamic-idle, -buffered-requests and
/// -buffered-bytes. A lane that has defaults in `settings` keeps what the user does not change.
/// What lanes may not be like is for rpc::Server::create() to say.
/// Ownership: `settings` stays where it is, and its lanes as they are, until Options::parse() has
/// returned.   Set-up only.
void add_server(Options& options, ServerSettings& settings);

/// Does for the process what the settings say besides the server: asks for the CPU latency, which
/// stands as long as what comes back lives.   Set-up only.
/// Errors: as rt::CpuLatencyRequest::open(), in the server's mode.
[[nodiscard]] expected<rt::CpuLatencyRequest, rt::RealtimeError> prepare(
    const ServerSettings& settings);

/// Prints, if the user wants it, what the system granted so far, on standard error. For after the
/// server's start.   Set-up only.
void show_setup(const ServerSettings& settings);

}  // namespace rtpm::options
