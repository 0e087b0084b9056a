#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "runs/turn.hpp"
#include "settings.hpp"

/// How rtpm-bench and the programs of a peer talk while the peer is measured. Each peer has a
/// program of its own, rtpm-peer-NAME, so that its libraries are not in rtpm-bench and a peer that
/// is not built is just missing. `rtpm-peer-NAME ROLE SETTING` runs once as a server and once as a
/// client. The client takes a TurnPlan as a line of JSON, runs it and answers with a PeerAnswer.
namespace rtpm::bench {

/// How a peer is set up.
struct PeerSetting {
  std::string transport{};
  std::string folder{};  ///< Holds sockets and configuration; removed after the run.
  Placement placement{};
  rt::RealtimeMode realtime = rt::RealtimeMode::kPrefer;
  int low_caller_count = 0;  ///< If above 0, the server has a second lane.
  std::int64_t work_ns = 0;  ///< How long a call of low priority computes.
  int consumer_count = 0;    ///< Consumers of events.
  /// The client's: what the server announced, for the lane of the measured caller and the one of
  /// the callers of low priority.
  std::vector<std::string> addresses{};
  int link = -1;  ///< The client's end of the stream to rtpm-bench, an open descriptor.
};

struct PeerAnswer {
  std::string error{};  ///< Empty if all went well.
  std::vector<std::int64_t> first_ns{};
  std::vector<std::int64_t> second_ns{};
  std::uint64_t missing_count = 0;
};

NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(Placement, client_cpu, server_cpu)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(PeerSetting, transport, folder, placement, realtime,
                                   low_caller_count, work_ns, consumer_count, addresses, link)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(TurnPlan, warm_up_count, count, period_ns, count_from,
                                   low_caller_count)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(PeerAnswer, error, first_ns, second_ns, missing_count)

/// Writes a line. False if the other end is gone.
[[nodiscard]] bool send_line(int link, const nlohmann::json& line);
/// Waits for a line: nullopt if none came within `patience`, or the other end is gone.
[[nodiscard]] std::optional<nlohmann::json> receive_line(int link, Duration patience);

}  // namespace rtpm::bench
