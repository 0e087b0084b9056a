#include "udp/lane_ports.hpp"

#include <algorithm>
#include <cerrno>
#include <memory>
#include <utility>

#include "os/doorbell.hpp"
#include "os/native_socket.hpp"
#include "rtpm/base/assert.hpp"
#include "sockets/native.hpp"
#include "udp/distributor.hpp"

namespace rtpm::transport {

expected<std::vector<UdpPort>, SetupError> open_lane_ports(const UdpPortConfig& config,
                                                           std::span<const LanePortConfig> lanes,
                                                           rt::RealtimeMode realtime) {
  RTPM_ASSERT(!lanes.empty() && lanes.size() <= kLaneCountMax && lanes.front().low == Priority{0} &&
                  std::ranges::is_sorted(lanes, {}, &LanePortConfig::low),
              "1 to 64 lanes ascend from priority 0");
  return LanePorts::open(config, lanes, realtime);
}

expected<std::vector<UdpPort>, SetupError> LanePorts::open_distributed(
    const UdpPortConfig& config, std::span<const LanePortConfig> lanes, rt::RealtimeMode realtime) {
  const Priority highest = lanes.back().priority;
  auto first = UdpPort::open({config.host, config.port, highest, lanes.front().low, config.index});
  if (!first) return unexpected{std::move(first.error())};
  std::vector<UdpPort> ports;
  if (lanes.size() == 1) {
    ports.push_back(std::move(*first));
    return ports;
  }
  const auto no_more = [] {
    return unexpected{no_descriptor("the descriptors of a server's lanes", errno)};
  };
  std::vector<std::unique_ptr<LaneInbox>> inboxes;
  for (const LanePortConfig& lane : lanes) {
    auto doorbell = os::Doorbell::open();
    if (!doorbell) return no_more();
    inboxes.push_back(std::make_unique<LaneInbox>(lane.low, std::move(*doorbell)));
    // Lanes send on the one socket themselves.
    Descriptor socket = os::duplicate(first->socket_.number());
    if (!socket.is_open()) return no_more();
    UdpPort port(std::move(socket), first->own_,
                 {config.host, config.port, lane.priority, lane.low, config.index});
    if (!port.open_waker()) return no_more();
    ports.push_back(std::move(port));
  }
  auto distributor =
      Distributor::start(std::move(first->socket_), std::move(inboxes), highest, realtime);
  if (!distributor) return unexpected{std::move(distributor.error())};
  // Each port keeps the distributor alive.
  for (std::size_t i = 0; i < ports.size(); ++i)
    ports[i].inbox_ = std::shared_ptr<LaneInbox>(*distributor, &(*distributor)->inbox(i));
  return ports;
}

}  // namespace rtpm::transport
