#include "udp/lane_ports.hpp"

#include <linux/filter.h>

#include <cerrno>
#include <vector>

#include "sockets/native.hpp"

namespace rtpm::transport {
namespace {

// Classic BPF loads big-endian.
constexpr std::uint32_t kPriorityLowByte = kPriorityOffset;
constexpr std::uint32_t kPriorityHighByte = kPriorityOffset + 1;

sock_filter statement(int code, std::uint32_t k) noexcept {
  return {static_cast<std::uint16_t>(code), 0, 0, k};
}

// Makes the kernel deliver each datagram to the lane that serves the priority in its header: the
// n-th socket on the port (SO_ATTACH_REUSEPORT_CBPF, socket(7)).
expected<void, SetupError> steer(const UdpPort& any_lane, std::span<const LanePortConfig> lanes) {
  // A load beyond the end of a short datagram ends the program with 0: the lowest lane counts it.
  std::vector<sock_filter> program{statement(BPF_LD | BPF_B | BPF_ABS, kPriorityHighByte),
                                   statement(BPF_ALU | BPF_LSH | BPF_K, 8),
                                   statement(BPF_MISC | BPF_TAX, 0),
                                   statement(BPF_LD | BPF_B | BPF_ABS, kPriorityLowByte),
                                   statement(BPF_ALU | BPF_OR | BPF_X, 0)};
  const auto send_from = [&program](std::uint32_t low, std::size_t lane) {
    program.push_back({static_cast<std::uint16_t>(BPF_JMP | BPF_JGE | BPF_K), 0, 1, low});
    program.push_back(statement(BPF_RET | BPF_K, static_cast<std::uint32_t>(lane)));
  };
  // Invalid priorities go to the lowest lane, too.
  send_from(Priority::kHighest + 1, 0);
  for (std::size_t lane = lanes.size() - 1; lane > 0; --lane) {
    send_from(lanes[lane].low.value(), lane);
  }
  program.push_back(statement(BPF_RET | BPF_K, 0));
  const sock_fprog filter{static_cast<std::uint16_t>(program.size()), program.data()};
  if (set_option(any_lane.descriptor(), SOL_SOCKET, SO_ATTACH_REUSEPORT_CBPF, filter)) return {};
  return setup_error("datagrams can't be steered to lanes by priority (SO_ATTACH_REUSEPORT_CBPF)",
                     system_error(errno),
                     "Linux 4.5 or later is needed; serve one lane, or TCP alone");
}

}  // namespace

expected<std::vector<UdpPort>, SetupError> LanePorts::open(const UdpPortConfig& config,
                                                           std::span<const LanePortConfig> lanes,
                                                           rt::RealtimeMode) {
  std::vector<UdpPort> ports;
  for (const LanePortConfig& lane : lanes) {
    auto port = UdpPort::open({config.host, config.port, lane.priority, lane.low, config.index},
                              /*joins=*/!ports.empty());
    if (!port) return unexpected{std::move(port.error())};
    ports.push_back(std::move(*port));
  }
  if (ports.size() == 1) return ports;
  if (auto steered = steer(ports.front(), lanes); !steered) {
    return unexpected{std::move(steered.error())};
  }
  return ports;
}

}  // namespace rtpm::transport
