#include <linux/filter.h>
#include <sys/socket.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <vector>

#include "rtpm/base/assert.hpp"
#include "rtpm/transport/udp.hpp"
#include "sockets/native.hpp"

namespace rtpm::transport {
namespace {

// Classic BPF loads big-endian.
constexpr std::uint32_t kPriorityLowByte = kPriorityOffset;
constexpr std::uint32_t kPriorityHighByte = kPriorityOffset + 1;

sock_filter statement(int code, std::uint32_t k) noexcept {
  return {static_cast<std::uint16_t>(code), 0, 0, k};
}

}  // namespace

expected<void, SetupError> steer(const UdpPort& any_lane, std::span<const Priority> lane_lows) {
  RTPM_ASSERT(!lane_lows.empty() && lane_lows.size() <= 64 && lane_lows.front() == Priority{0} &&
                  std::ranges::is_sorted(lane_lows),
              "1 to 64 lanes ascend from priority 0");
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
  for (std::size_t lane = lane_lows.size() - 1; lane > 0; --lane) {
    send_from(lane_lows[lane].value(), lane);
  }
  program.push_back(statement(BPF_RET | BPF_K, 0));
  const sock_fprog filter{static_cast<std::uint16_t>(program.size()), program.data()};
  if (set_option(any_lane.descriptor(), SOL_SOCKET, SO_ATTACH_REUSEPORT_CBPF, filter)) return {};
  return setup_error("datagrams can't be steered to lanes by priority (SO_ATTACH_REUSEPORT_CBPF)",
                     system_error(errno),
                     "Linux 4.5 or later is needed; serve one lane, or TCP alone");
}

}  // namespace rtpm::transport
