#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "figures/report.hpp"
#include "runs/run.hpp"
#include "settings.hpp"
#include "sides/caller.hpp"
#include "sides/memory_floor.hpp"
#include "sides/rtpm_side.hpp"
#include "sides/sealed_keys.hpp"
#include "sides/server_process.hpp"

namespace rtpm::bench {

/// The options that the two sides share.
struct DuelConfig {
  Carrier carrier = Carrier::kUdp;
  std::optional<Carrier> floor_carrier{};   ///< The raw floor's carrier, if different.
  rt::WaitConfig wait{};                    ///< The wait of the measured callers and of their lane.
  std::size_t payload_size = kPayloadSize;  ///< The payload of the measured calls.
  int low_caller_count = 0;                 ///< If above 0, both servers have a second lane.
  Duration low_work{};                      ///< How long a call of low priority computes.
  std::string host = "127.0.0.1";           ///< The servers' address; numeric.
  /// Runs first in a server's process, if not empty.
  std::function<Outcome<>()> enter_server_host{};
  std::uint32_t session_count_max = 256;     ///< Sessions of RTPM's server, per lane.
  std::shared_ptr<const SealedKeys> keys{};  ///< Seal the sessions; null for plain ones.
  /// A caller of low priority sends HELLOs to RTPM's server instead of calls, and as many frames to
  /// the floor's second thread.
  bool has_hello_storm = false;
  Placement placement{};
  rt::RealtimeMode realtime = rt::RealtimeMode::kPrefer;
};

/// An RTPM server and a raw one, each in its own process, with the same wait strategy, scheduling
/// and CPU. Both are stopped until the run resumes them. Make it before this process starts a
/// thread.
/// @threads  one at a time
/// @realtime set-up only
class Duel {
 public:
  [[nodiscard]] static Outcome<std::shared_ptr<Duel>> start(const DuelConfig& config);

  [[nodiscard]] const ServerProcess& server(Side side) const {
    return side == Side::kRtpm ? rtpm_ : floor_;
  }
  [[nodiscard]] const std::string& rtpm_url() const { return rtpm_.address(); }
  /// The node of the measured callers.
  [[nodiscard]] rpc::Node& node() { return *high_node_; }

  /// A side's measured caller. The side's server has to run.
  [[nodiscard]] Outcome<Call> connect(Side side);
  /// Like connect().
  [[nodiscard]] Outcome<Pipeline> connect_pipeline(Side side);
  /// The contenders of RTPM and of the floor, each with the configured load: on the thread of the
  /// measured callers.
  /// @lifetime refers to this
  [[nodiscard]] Outcome<Contenders> contenders();

 private:
  Duel(DuelConfig config, std::unique_ptr<MemoryFloor> memory, ServerProcess floor,
       ServerProcess rtpm);
  [[nodiscard]] Outcome<Call> connect_low(Side side);
  [[nodiscard]] Outcome<Call> connect_storm(Side side);
  [[nodiscard]] Outcome<Contender> contender(Side side);

  DuelConfig config_;
  std::unique_ptr<MemoryFloor> memory_floor_;  ///< Only for shared memory.
  ServerProcess floor_;
  ServerProcess rtpm_;
  std::uint16_t floor_ports_[2]{};  ///< The ports of high and of low priority.
  std::unique_ptr<rpc::Node> high_node_;
  std::unique_ptr<rpc::Node> low_node_;
};

/// Calls to servers that run only in their own turns, with or without load.
/// @lifetime refers to the servers
[[nodiscard]] Contender make_contender(std::vector<const ServerProcess*> servers, Call caller,
                                       std::shared_ptr<LowLoad> load = nullptr);

/// Starts a duel for each part of a run. It lasts as long as the part, or as `connect` keeps it.
[[nodiscard]] Start start_duel(
    const DuelConfig& config,
    std::function<Outcome<Contenders>(const std::shared_ptr<Duel>&)> connect =
        [](const std::shared_ptr<Duel>& duel) { return duel->contenders(); });

/// A client that is bound and has called once: its own node, hence its own session and sockets.
struct Client {
  std::unique_ptr<rpc::Node> node;
  Call caller;
};
[[nodiscard]] Outcome<Client> bind_client(Carrier carrier, const rt::WaitConfig& wait,
                                          const std::string& url);

/// The first fields of a result: its case, transport, wait and payload.
[[nodiscard]] Json head_of(std::string_view case_name, const DuelConfig& config);

}  // namespace rtpm::bench
