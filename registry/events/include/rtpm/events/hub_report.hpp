#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/rpc/node.hpp"

namespace rtpm::events {

/// A consumer of a hub, by the hub's report. Its texts are printable.
/// @ownership a value
struct HubConsumer {
  std::string name{};     ///< The subscription's: "record".
  std::string program{};  ///< As it says; empty with an older consumer.
  std::uint32_t process = 0;
  std::string host{};                ///< The address that it subscribed from.
  std::string_view way{};            ///< How events reach it: "stream", "ring", "multicast", "hub".
  Duration age{0};                   ///< Since it subscribed.
  Duration lag{0};                   ///< How far it is behind, see events.fbs.
  std::uint32_t waiting_count = 0;   ///< Events that wait for it at the hub.
  std::uint64_t accepted_count = 0;  ///< Events that its filter accepted.
  std::uint64_t lost_count = 0;      ///< At the hub and on its own side, not as it asked for.
  bool is_suspended = false;
};

/// A hub's report on itself.
/// @ownership a value
struct HubReport {
  /// Those that are most behind first, then those that lost most.
  std::vector<HubConsumer> consumers{};
  std::uint64_t taken_count = 0;  ///< Events of all suppliers together.

  /// Queries the hub at `target`, a URL or a name.
  /// @realtime set-up only
  /// @errors   no hub answers in time; its grants do not let this caller have its report
  [[nodiscard]] static expected<HubReport, SetupError> ask(
      rpc::Node& node, const std::string& target, Duration deadline = std::chrono::seconds{1});
};

}  // namespace rtpm::events
