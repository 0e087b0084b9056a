#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "rtpm/base/expected.hpp"
#include "rtpm/rpc/node.hpp"
#include "rtpm/rpc/server.hpp"
#include "settings.hpp"
#include "sides/caller.hpp"

/// RTPM's own side of every comparison: the Echo service of bench.fbs through generated code.
namespace rtpm::bench {

/// The options of an Echo server.
struct RtpmServerConfig {
  std::string host = "127.0.0.1";  ///< Numeric.
  std::vector<rpc::LaneConfig> lanes{};
  std::uint32_t session_count_max = 256;  ///< Per lane and transport.
  rt::RealtimeMode realtime = rt::RealtimeMode::kPrefer;
  rpc::ServerSecurity security{.is_insecure = true};
};

/// Opens a server of one object, which does not run yet but has its address.
[[nodiscard]] expected<std::unique_ptr<rpc::Server>, std::string> open_server(
    const rpc::ServerConfig& config, std::string_view path, rpc::Servant& servant);

/// Starts an Echo server in this process, which serves until the process ends, and returns the
/// object's URL.   Set-up only.
[[nodiscard]] expected<std::string, std::string> start_rtpm_server(RtpmServerConfig config);

[[nodiscard]] rpc::Transport transport_of(Carrier carrier) noexcept;

/// The calling side of one program for callers that share a carrier and a wait strategy.
[[nodiscard]] std::unique_ptr<rpc::Node> make_node(Carrier carrier, const rt::WaitConfig& wait,
                                                   rpc::NodeSecurity security = {});

/// Binds the Echo object at `url`; the caller's priority is that of the thread that calls. Its
/// echo() lets the server return `payload_size` bytes: 48 as a struct, none as rtpm.Empty, others
/// as a vector in a table, encoded beforehand.   Ownership: refers to `node`.   Set-up only.
[[nodiscard]] expected<std::unique_ptr<Caller>, std::string> connect_rtpm_caller(
    rpc::Node& node, const std::string& url, Priority priority,
    std::size_t payload_size = kPayloadSize);

/// Like connect_rtpm_caller(): a call that lets the server return `size` bytes, as one message.
[[nodiscard]] expected<Job, std::string> connect_large_job(rpc::Node& node, const std::string& url,
                                                           Priority priority, std::size_t size);

/// Like connect_rtpm_caller().
[[nodiscard]] expected<std::unique_ptr<Pipeline>, std::string> connect_rtpm_pipeline(
    rpc::Node& node, const std::string& url, Priority priority);

}  // namespace rtpm::bench
