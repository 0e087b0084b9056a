#pragma once

#include <span>
#include <vector>

#include "rtpm/transport/udp.hpp"

namespace rtpm::transport {

/// open_lane_ports() of this system.
class LanePorts {
 public:
  [[nodiscard]] static expected<std::vector<UdpPort>, SetupError> open(
      const UdpPortConfig& config, std::span<const LanePortConfig> lanes,
      rt::RealtimeMode realtime);

  /// Opens one port, and lets a Distributor hand out its datagrams.
  [[nodiscard]] static expected<std::vector<UdpPort>, SetupError> open_distributed(
      const UdpPortConfig& config, std::span<const LanePortConfig> lanes,
      rt::RealtimeMode realtime);
};

}  // namespace rtpm::transport
