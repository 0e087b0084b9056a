#pragma once

#include <memory>
#include <string>
#include <vector>

#include "caller.hpp"
#include "rtpm/base/expected.hpp"
#include "rtpm/rpc/node.hpp"
#include "rtpm/rpc/server.hpp"
#include "settings.hpp"

/// RTPM's own side of every comparison: the Echo service of bench.fbs through generated code.
namespace rtpm::bench {

/// Starts an Echo server in this process, which serves until the process ends, and gives back the
/// object's URL.   Set-up only.
[[nodiscard]] expected<std::string, std::string> start_rtpm_server(
    std::vector<rpc::LaneConfig> lanes, rt::RealtimeMode realtime);

/// The calling side of one program for callers that share a carrier and a wait strategy.
[[nodiscard]] std::unique_ptr<rpc::Node> make_node(Carrier carrier, const rt::WaitConfig& wait);

/// Binds the Echo object at `url`; the caller's priority is that of the thread that calls.
/// Ownership: refers to `node`.   Set-up only.
[[nodiscard]] expected<std::unique_ptr<Caller>, std::string> connect_rtpm_caller(
    rpc::Node& node, const std::string& url, Priority priority);

}  // namespace rtpm::bench
