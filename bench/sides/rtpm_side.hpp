#pragma once

#include <memory>
#include <string>
#include <vector>

#include "rtpm/rpc/node.hpp"
#include "rtpm/rpc/server.hpp"
#include "settings.hpp"
#include "sides/caller.hpp"

/// RTPM's own side of every comparison: the Echo service of bench.fbs through generated code.
namespace rtpm::bench {

/// Opens a server of one object, which does not run yet but has its address.
[[nodiscard]] Outcome<std::unique_ptr<rpc::Server>> open_server(const rpc::ServerConfig& config,
                                                                std::string_view path,
                                                                rpc::Servant& servant);

/// Starts an Echo server in this process, which serves until the process ends.
/// @return   the object's URL
/// @realtime set-up only
[[nodiscard]] Outcome<std::string> start_rtpm_server(rpc::ServerConfig config);

[[nodiscard]] rpc::Transport transport_of(Carrier carrier) noexcept;

/// The calling side of one program for callers that share a carrier and a wait strategy.
[[nodiscard]] std::unique_ptr<rpc::Node> make_node(Carrier carrier, const rt::WaitConfig& wait,
                                                   rpc::NodeSecurity security = {});

/// Binds the Echo object at `url`; the caller's priority is that of the thread that calls. The
/// server returns `payload_size` bytes: 48 as a struct, none as rtpm.Empty, others as a vector in a
/// table, encoded beforehand.
/// @lifetime refers to `node`
/// @realtime set-up only
[[nodiscard]] Outcome<Call> connect_rtpm_caller(rpc::Node& node, const std::string& url,
                                                Priority priority,
                                                std::size_t payload_size = kPayloadSize);

/// Like connect_rtpm_caller().
[[nodiscard]] Outcome<Pipeline> connect_rtpm_pipeline(rpc::Node& node, const std::string& url,
                                                      Priority priority);

}  // namespace rtpm::bench
