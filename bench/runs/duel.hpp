#pragma once

#include <sys/types.h>

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "figures/disturbance.hpp"
#include "figures/report.hpp"
#include "figures/samples.hpp"
#include "rtpm/base/expected.hpp"
#include "settings.hpp"
#include "sides/caller.hpp"
#include "sides/rtpm_side.hpp"
#include "sides/server_process.hpp"

namespace rtpm::bench {

/// Who is measured.
enum class Side : std::uint8_t { kRtpm, kFloor };
inline constexpr Side kBothSides[] = {Side::kRtpm, Side::kFloor};

/// What the two sides have in common.
struct DuelConfig {
  Carrier carrier = Carrier::kUdp;
  std::optional<Carrier> floor_carrier{};   ///< Of the raw floor, if not the same.
  rt::WaitConfig wait{};                    ///< Of the measured callers and their lane.
  std::size_t payload_size = kPayloadSize;  ///< Of the measured calls.
  int low_caller_count = 0;  ///< Above 0: both servers have a second lane, for low priorities.
  std::string host = "127.0.0.1";         ///< That the servers serve; numeric.
  Job enter_server_host{};                ///< What a server's process does first, if anything.
  std::uint32_t session_count_max = 256;  ///< Of RTPM's server, per lane.
  std::uint64_t numbered_count = 0;       ///< How many numbered calls RTPM's server can tell apart.
  Placement placement{};
  rt::RealtimeMode realtime = rt::RealtimeMode::kPrefer;
};

/// An RTPM server and a raw one, each in its own process, with the same wait strategy, scheduling
/// and CPU, to be measured by turns in one run. Only the one whose turn it is runs; the other is
/// stopped. Make it before this process starts a thread. Threads: one at a time, connect() from
/// several.   Set-up only, but for take_turn().
class Duel {
 public:
  [[nodiscard]] static expected<std::unique_ptr<Duel>, std::string> start(const DuelConfig& config);
  ~Duel();

  /// Lets `side`'s server run until the next turn.
  void take_turn(Side side);
  /// Lets RTPM's server run along with the one whose turn it is, until that ends.
  void join_rtpm();
  /// Stops both servers, so that the CPUs rest.
  void end_turn();
  /// Ends the turn, so that nobody spins, and watches the round that begins, on the CPUs of the
  /// callers and servers of high priority.
  [[nodiscard]] RoundWatch watch_round();
  /// As end_turn(), and waits for `part` of the time that the turn took. Real-time threads that
  /// leave nothing to others for about a second are throttled by the kernel. RTPM's take care, the
  /// floor's do not, and its stalls would fall into RTPM's turns as well.
  void rest_after(Duration turn, double part = 0.15);

  /// A caller of high priority, to the server whose turn it is.
  [[nodiscard]] expected<std::unique_ptr<Caller>, std::string> connect_high();
  /// RTPM's server runs: a caller of high priority from a node of its own, which must outlive it.
  [[nodiscard]] expected<std::unique_ptr<Caller>, std::string> connect_by(rpc::Node& node);
  /// A caller of low priority, which blocks while it waits.
  [[nodiscard]] expected<std::unique_ptr<Caller>, std::string> connect_low();

  /// RTPM's server runs: a job that has it bring `size` bytes back, at low priority, and blocks
  /// while it waits.
  [[nodiscard]] expected<Job, std::string> connect_large(std::size_t size);
  /// RTPM's server runs: a caller of high priority whose calls are numbered.
  [[nodiscard]] expected<std::unique_ptr<NumberedCaller>, std::string> connect_numbered();
  /// A pipeline of high priority to the server whose turn it is; of the raw one over UDP only.
  [[nodiscard]] expected<std::unique_ptr<Pipeline>, std::string> connect_pipeline(
      std::size_t in_flight);
  /// Where RTPM's server serves.
  [[nodiscard]] std::uint16_t rtpm_port() const;

  [[nodiscard]] std::vector<pid_t> server_ids() const;
  /// CPU time that RTPM's server has taken so far.
  [[nodiscard]] Duration rtpm_server_cpu_time() const;

 private:
  struct Impl;
  explicit Duel(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

/// Runs `body` to its end on a thread as a measured caller has it: high priority, on the clients'
/// CPU. Gives back what the body gives.
[[nodiscard]] expected<void, std::string> run_as_caller(
    const DuelConfig& config, const std::function<expected<void, std::string>()>& body);

/// "call, udp, adaptive wait": how results are headed.
[[nodiscard]] std::string title_of(std::string_view case_name, const DuelConfig& config);

/// Measures once with each carrier and wait strategy that was asked for, and reports; false if one
/// could not be measured, which is said.
using Measurement = expected<Result, std::string> (*)(const Settings& settings,
                                                      const DuelConfig& config);
bool measure_each(std::string_view case_name, Measurement measure, const Settings& settings,
                  Report& report, std::size_t payload_size = kPayloadSize);

/// Adds the fields and rows that every result has: case, transport, wait, payload, n, both sides'
/// distributions and their ratios.
void add_comparison(Result& result, std::string_view case_name, const DuelConfig& config,
                    const Samples& rtpm, const Samples& floor);

/// Adds every latency of both: latencies_us, floor_latencies_us.
void add_latencies(Result& result, const Samples& rtpm, const Samples& floor);

/// The largest latency that either side showed in a result that add_comparison() began.
[[nodiscard]] double longest_us(const Result& result);

}  // namespace rtpm::bench
