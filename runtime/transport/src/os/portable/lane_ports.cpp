#include "udp/lane_ports.hpp"

namespace rtpm::transport {

expected<std::vector<UdpPort>, SetupError> LanePorts::open(const UdpPortConfig& config,
                                                           std::span<const LanePortConfig> lanes,
                                                           rt::RealtimeMode realtime) {
  return open_distributed(config, lanes, realtime);
}

}  // namespace rtpm::transport
