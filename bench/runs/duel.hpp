#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "figures/report.hpp"
#include "rtpm/base/expected.hpp"
#include "runs/contender.hpp"
#include "settings.hpp"
#include "sides/caller.hpp"
#include "sides/memory_floor.hpp"
#include "sides/rtpm_side.hpp"
#include "sides/sealed_keys.hpp"
#include "sides/server_process.hpp"

namespace rtpm::bench {

/// The two sides that are measured.
enum class Side : std::uint8_t { kRtpm, kFloor };
inline constexpr Side kBothSides[] = {Side::kRtpm, Side::kFloor};

/// The options that the two sides share.
struct DuelConfig {
  Carrier carrier = Carrier::kUdp;
  std::optional<Carrier> floor_carrier{};   ///< The raw floor's carrier, if different.
  rt::WaitConfig wait{};                    ///< The wait of the measured callers and of their lane.
  std::size_t payload_size = kPayloadSize;  ///< The payload of the measured calls.
  int low_caller_count = 0;                 ///< If above 0, both servers have a second lane.
  std::string host = "127.0.0.1";           ///< The servers' address; numeric.
  Job enter_server_host{};                  ///< Runs first in a server's process, if not empty.
  std::uint32_t session_count_max = 256;    ///< Sessions of RTPM's server, per lane.
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
  [[nodiscard]] static expected<std::shared_ptr<Duel>, std::string> start(const DuelConfig& config);

  [[nodiscard]] const ServerProcess& server(Side side) const {
    return side == Side::kRtpm ? rtpm_ : floor_;
  }
  [[nodiscard]] const std::string& rtpm_url() const { return rtpm_.address(); }
  [[nodiscard]] std::uint16_t floor_high_port() const { return floor_ports_[0]; }
  /// The nodes of the callers of high priority, and of low priority.
  [[nodiscard]] rpc::Node& high_node() { return *high_node_; }
  [[nodiscard]] rpc::Node& low_node() { return *low_node_; }

  // The side's server has to run.
  [[nodiscard]] expected<std::unique_ptr<Caller>, std::string> connect_high(Side side);
  /// Makes a caller that blocks while it waits.
  [[nodiscard]] expected<std::unique_ptr<Caller>, std::string> connect_low(Side side);

  /// Makes the storm of DuelConfig::has_hello_storm.
  [[nodiscard]] expected<Job, std::string> connect_storm(Side side);

  /// A side's measured caller, and the configured number of callers of low priority, whose calls
  /// compute for `work`.   On a thread of run_as_caller().
  /// @lifetime refers to this
  [[nodiscard]] expected<std::unique_ptr<Contender>, std::string> contender(Side side,
                                                                            Duration work = {});
  /// The contenders of RTPM and of the floor.
  [[nodiscard]] expected<Contenders, std::string> contenders(Duration work = {});

 private:
  Duel(DuelConfig config, std::unique_ptr<MemoryFloor> memory, ServerProcess floor,
       ServerProcess rtpm);

  DuelConfig config_;
  std::unique_ptr<MemoryFloor> memory_floor_;  ///< Only for shared memory.
  ServerProcess floor_;
  ServerProcess rtpm_;
  std::uint16_t floor_ports_[2]{};  ///< The ports of high and of low priority.
  std::unique_ptr<rpc::Node> high_node_;
  std::unique_ptr<rpc::Node> low_node_;
};

/// Runs `body` to its end on a thread like a measured caller's: high priority, on the clients' CPU.
/// Returns the body's result.
[[nodiscard]] expected<void, std::string> run_as_caller(
    const Settings& settings, const std::function<expected<void, std::string>()>& body);

/// Starts a duel for each part of a run, which lasts as long as the part.
[[nodiscard]] Start start_duel(const DuelConfig& config,
                               std::function<expected<Contenders, std::string>(Duel&)> connect);

/// A client that is bound and has called once: its own node, hence its own session and sockets.
struct Client {
  std::unique_ptr<rpc::Node> node;
  std::unique_ptr<Caller> caller;
};
[[nodiscard]] expected<Client, std::string> bind_client(Carrier carrier, const rt::WaitConfig& wait,
                                                        const std::string& url);

/// Measures with each carrier and wait strategy that was asked for; the report says which could not
/// be measured.
/// @param shares_cpu  several servers, or lanes, run on a CPU at a time: none of them may spin
using Measure = expected<void, std::string> (*)(const Settings& settings, const DuelConfig& config,
                                                Report& report);
void measure_each(std::string_view case_name, const Settings& settings, Report& report,
                  bool shares_cpu, Measure measure);

/// The first fields of a result: its case, transport, wait and payload.
[[nodiscard]] Json head_of(std::string_view case_name, const DuelConfig& config);

}  // namespace rtpm::bench
