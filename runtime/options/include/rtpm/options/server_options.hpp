#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/options/options.hpp"
#include "rtpm/rpc/server.hpp"
#include "rtpm/rt/cpu_latency.hpp"

namespace rtpm::options {

/// The configuration of a program's server, its lanes, and the process around them.
struct ServerSettings {
  /// The program's defaults before add_server(). A lane's options use its name, without "lane-".
  rpc::ServerConfig server{};
  std::optional<Duration> cpu_latency{};  ///< Longest wake-up of a CPU; nullopt if not limited.
  bool shows_setup = false;               ///< Print the granted setup.
  std::string known_servers_file{};       ///< Used by the program's node, see add_caller().
  std::vector<std::string> lanes{};       ///< The lanes' names, set by add_server().
};

/// Adds the options of a server, the same for every program: --host, --advertise, --port,
/// --authorized, --key, --insecure, --audit, --key-log, limits, shared memory, real-time mode, CPU
/// latency; --lanes, the lanes' names; and for each lane
/// --lane-NAME-low, -priority, -cpus, -wait, -spin, -schedule, -threads, -dynamic-threads,
/// -dynamic-idle, -buffered-requests and -buffered-bytes. A lane with defaults in `settings` keeps
/// them unless the user changes them. rpc::Server::create() checks the lanes.
/// @ownership `settings` must not move, nor its lanes change, until Options::parse() has returned
/// @realtime set-up only
void add_server(const Options& options, ServerSettings& settings);

/// Adds a caller's options to a program that also serves, after add_server(). Its key and its key
/// log are those of its server, so only --known-servers is added.
void add_caller(const Options& options, ServerSettings& settings);
/// The security settings of such a program's node.
[[nodiscard]] rpc::NodeSecurity node_security(const ServerSettings& settings);

/// Requests the configured CPU latency for the process, for the lifetime of the returned object.
/// Call it after add_server() and Options::parse().
/// @realtime set-up only
/// @errors   --shared-memory where the system offers none; as rt::CpuLatencyRequest::open(), in the
///           server's mode
[[nodiscard]] expected<rt::CpuLatencyRequest, SetupError> prepare(const ServerSettings& settings);

/// Prints on standard error the served addresses, a line each, if programs of other hosts can reach
/// them; the key and the grants of a server that requires grants; and the rights that the system
/// granted, if so configured. Call it after the start.
/// @realtime set-up only
void show_setup(const ServerSettings& settings, const rpc::Server& server,
                std::string_view program);

}  // namespace rtpm::options
