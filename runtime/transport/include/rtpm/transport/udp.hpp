#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "rtpm/base/bytes.hpp"
#include "rtpm/base/priority.hpp"
#include "rtpm/base/setup_error.hpp"
#include "rtpm/rt/thread.hpp"
#include "rtpm/transport/address.hpp"
#include "rtpm/transport/datagram_batch.hpp"
#include "rtpm/transport/socket.hpp"
#include "rtpm/wire/cookie.hpp"

namespace rtpm::transport {

class LaneInbox;

struct UdpPortConfig {
  /// Numeric, a name, or "any": every address of this host, including later ones. With "any", an
  /// answer is sent from the address at which its request arrived.
  std::string host = "127.0.0.1";
  std::uint16_t port = 0;
  Priority priority = 0;  ///< The priority of sent datagrams, see set_traffic_class().
  Priority low = 0;       ///< The lowest priority of its lane.
  /// The port's index, if a lane has ports at several addresses; see index_of().
  std::uint16_t index = 0;
};

/// A lane's UDP socket. All lanes of a server share one port, see open_lane_ports().
/// @threads  one at a time, except wake()
/// @realtime alloc-free, never blocks, one system call, unless stated otherwise
class UdpPort {
 public:
  /// @realtime set-up only
  /// @errors   the port is taken; the address does not belong to this host
  [[nodiscard]] static expected<UdpPort, SetupError> open(const UdpPortConfig& config);

  /// Receives a datagram, or several that arrived together.
  /// @param buffer  of size Datagrams::kSizeMax
  [[nodiscard]] expected<Datagrams, IoError> receive(MutableBytes buffer) noexcept;
  /// Reports these received datagrams to the BatchEstimator.
  /// @realtime a system call only when batches are switched on or off
  void note(const Datagrams& datagrams, MonotonicTime received) noexcept;

  /// Waits for datagrams, at most kBlockTime, and receives them into `buffer`. The next receive()
  /// returns them from there, ignoring its own buffer. False if none arrived, or if wake() ended
  /// the wait.
  [[nodiscard]] bool await(MutableBytes buffer) noexcept;
  /// Whether await() has received a datagram that receive() has not returned yet.
  [[nodiscard]] bool has_received() const noexcept { return awaited_.has_value(); }
  /// Ends another thread's await(), or the next one, by sending a datagram to this port. If that is
  /// lost, for example in a packet filter, await() ends after kBlockTime.
  /// @return false if the system did not accept the datagram
  /// @threads  any
  bool wake() noexcept;
  /// The number of wake() datagrams that have arrived.
  [[nodiscard]] std::uint64_t woken_count() const noexcept { return woken_count_; }
  [[nodiscard]] expected<void, IoError> send(const wire::PeerAddress& peer,
                                             ConstBytes frame) noexcept;
  /// Sends several frames, together if the system supports it; after an error some may have been
  /// sent.
  /// @realtime one system call, or one per frame
  [[nodiscard]] expected<void, IoError> send_batch(const wire::PeerAddress& peer,
                                                   const DatagramBatch& batch) noexcept;
  /// The descriptor that is readable while there are datagrams.
  [[nodiscard]] int descriptor() const noexcept;

  /// The host of a peer; this_host() if its address is loopback, or the one that it called.
  /// @realtime a few ns
  [[nodiscard]] wire::PeerAddress host_of(const wire::PeerAddress& peer) const noexcept;
  /// The UdpPortConfig::index of the port that received from the peer.
  /// @realtime a few ns
  [[nodiscard]] static std::size_t index_of(const wire::PeerAddress& peer) noexcept {
    return peer.port >> kLocalShift;
  }

 private:
  /// The bits above a peer's port identify the local address at which its datagram arrived.
  static constexpr int kLocalShift = 16;
  /// The addresses at which datagrams arrived for "any". The first one stands for any beyond the
  /// 64th.
  using LocalAddresses = std::array<SocketAddress, 64>;

  friend class LanePorts;

  UdpPort(Descriptor socket, const SocketAddress& own, const UdpPortConfig& config);
  /// @param joins  an additional socket on a server's port, not the first one
  [[nodiscard]] static expected<UdpPort, SetupError> open(const UdpPortConfig& config, bool joins);
  [[nodiscard]] bool open_waker() noexcept;
  [[nodiscard]] std::ptrdiff_t send_as_asked(const SocketAddress& to, const SocketAddress& local,
                                             ConstBytes frame) noexcept;
  [[nodiscard]] std::uint32_t index_of_local(const SocketAddress& to) noexcept;
  [[nodiscard]] const SocketAddress& local_of(const wire::PeerAddress& peer) const noexcept;
  [[nodiscard]] expected<Datagrams, IoError> receive(MutableBytes buffer, int flags) noexcept;

  Descriptor socket_;
  std::shared_ptr<LaneInbox> inbox_{};  ///< Null if the lane receives from its socket.
  Descriptor waker_;                    ///< Connected to the port.
  wire::PeerAddress waker_peer_{};      ///< The sender address of its datagrams.
  Priority low_;
  SocketAddress own_;
  std::uint32_t index_;                       ///< The port's index, stored in each peer.
  std::unique_ptr<LocalAddresses> locals_{};  ///< Null unless the host is "any".
  std::uint32_t local_count_ = 1;
  bool can_send_batches_ = true;
  BatchEstimator estimator_;
  std::uint64_t woken_count_ = 0;
  std::optional<Datagrams> awaited_;
};

/// The offset of a datagram's priority, two bytes, little-endian: the header's (hp-11-2).
inline constexpr std::uint32_t kPriorityOffset = 4;
/// The most lanes at one address.
inline constexpr std::size_t kLaneCountMax = 64;

/// A lane's part of UdpPortConfig.
struct LanePortConfig {
  Priority priority = 0;
  Priority low = 0;
};

/// Opens a port for each lane at one address, all with one number. Each datagram reaches the lane
/// that serves the priority in its header; one with an invalid priority, or none, the lowest. On
/// Linux the kernel steers them; elsewhere a thread of the highest lane's priority hands them out.
/// @param config    `priority` and `low` are ignored
/// @param lanes     1 to kLaneCountMax, their `low` ascending from 0
/// @param realtime  for that thread
/// @realtime set-up only
/// @errors   as UdpPort::open(); the system can't steer
/// @source   spec/hprotocol.md#hp-11
[[nodiscard]] expected<std::vector<UdpPort>, SetupError> open_lane_ports(
    const UdpPortConfig& config, std::span<const LanePortConfig> lanes, rt::RealtimeMode realtime);

}  // namespace rtpm::transport
