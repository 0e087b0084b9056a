#pragma once

#include <sys/types.h>

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "rtpm/base/bytes.hpp"
#include "rtpm/base/priority.hpp"
#include "rtpm/base/setup_error.hpp"
#include "rtpm/transport/address.hpp"
#include "rtpm/transport/datagram_batch.hpp"
#include "rtpm/transport/socket.hpp"
#include "rtpm/wire/cookie.hpp"

namespace rtpm::transport {

struct UdpPortConfig {
  /// Numeric, a name, or "any": every address of this host, also later ones. With "any" an answer
  /// leaves from the address at which its request came.
  std::string host = "127.0.0.1";
  std::uint16_t port = 0;
  Priority priority = 0;    ///< The priority of sent datagrams, see set_traffic_class().
  Priority low = 0;         ///< The lowest priority that steer() gives it.
  bool joins = false;       ///< A further socket of a server's port, not its first one.
  std::uint16_t index = 0;  ///< One of a lane's ports at several addresses, for index_of().
};

/// A lane's UDP socket. All lanes of a server share one port; the kernel steers each datagram to
/// the lane of its priority, see steer().
/// @threads  one at a time, but for wake()
/// @realtime alloc-free, never blocks, one system call, unless said otherwise
class UdpPort {
 public:
  /// @realtime set-up only
  /// @errors   the port is taken, the address is not this host's
  [[nodiscard]] static expected<UdpPort, SetupError> open(const UdpPortConfig& config);

  /// Receives a datagram, or several that came together.
  /// @param buffer  of Datagrams::kSizeMax
  [[nodiscard]] expected<Datagrams, IoError> receive(MutableBytes buffer) noexcept;
  /// Reports to the BatchEstimator when receive() returned these datagrams.
  /// @realtime a system call only if batches begin or end
  void note(const Datagrams& datagrams, MonotonicTime received) noexcept;

  /// Waits for datagrams, for kBlockTime at most, and receives them into `buffer`. The next
  /// receive() returns them from there, whatever its own buffer is. False if none came, or if
  /// wake() ended the wait.
  [[nodiscard]] bool await(MutableBytes buffer) noexcept;
  /// Whether await() received a datagram that receive() has not returned yet.
  [[nodiscard]] bool has_received() const noexcept { return awaited_.has_value(); }
  /// Ends the await() of another thread, or the next one, by a datagram to this port. If it is
  /// lost, as by a packet filter, await() ends in its time.
  /// @return false if the system did not take the datagram
  /// @threads  any
  bool wake() noexcept;
  /// The number of datagrams of wake() that have arrived.
  [[nodiscard]] std::uint64_t woken_count() const noexcept { return woken_count_; }
  [[nodiscard]] expected<void, IoError> send(const wire::PeerAddress& peer,
                                             ConstBytes frame) noexcept;
  /// Sends several frames, together where the system can; after an error some may have gone.
  /// @realtime one system call, or one per frame
  [[nodiscard]] expected<void, IoError> send_batch(const wire::PeerAddress& peer,
                                                   const DatagramBatch& batch) noexcept;
  [[nodiscard]] int descriptor() const noexcept { return socket_.number(); }

  /// The host of a peer: this_host() if it called from the address that it called.
  /// @realtime a few ns
  [[nodiscard]] wire::PeerAddress host_of(const wire::PeerAddress& peer) const noexcept;
  /// The index of the port that received from the peer, among a lane's ports at several addresses:
  /// its UdpPortConfig::index.
  /// @realtime a few ns
  [[nodiscard]] static std::size_t index_of(const wire::PeerAddress& peer) noexcept {
    return peer.port >> kLocalShift;
  }

 private:
  /// The bits above a peer's port hold the own address at which its datagram came.
  static constexpr int kLocalShift = 16;
  /// The addresses at which datagrams came to "any"; the first stands for any beyond the 64th.
  using LocalAddresses = std::array<SocketAddress, 64>;

  UdpPort(Descriptor socket, const SocketAddress& own, const UdpPortConfig& config);
  [[nodiscard]] bool open_waker() noexcept;
  [[nodiscard]] ssize_t send_as_asked(const SocketAddress& to, const SocketAddress& local,
                                      ConstBytes frame) noexcept;
  [[nodiscard]] std::uint32_t index_of_local(const SocketAddress& to) noexcept;
  [[nodiscard]] const SocketAddress& local_of(const wire::PeerAddress& peer) const noexcept;
  [[nodiscard]] expected<Datagrams, IoError> receive(MutableBytes buffer, int flags) noexcept;

  Descriptor socket_;
  Descriptor waker_;                ///< Connected to the port.
  wire::PeerAddress waker_peer_{};  ///< The sender of its datagrams.
  Priority low_;
  SocketAddress own_;
  std::uint32_t index_;                       ///< The port's index, kept in a peer.
  std::unique_ptr<LocalAddresses> locals_{};  ///< Null unless the host is "any".
  std::uint32_t local_count_ = 1;
  bool can_send_batches_ = true;
  BatchEstimator estimator_;
  std::uint64_t woken_count_ = 0;
  std::optional<Datagrams> awaited_;
};

/// Where steer() finds a datagram's priority, two bytes, little-endian: the header's (hp-11-2).
inline constexpr std::uint32_t kPriorityOffset = 4;

/// Lets the kernel deliver each datagram to the lane that serves the priority in its header.
/// @param any_lane   one of the lanes' ports
/// @param lane_lows  the lowest priorities of the lanes, ascending from 0, in the order in which
///           their ports were opened
/// @realtime set-up only
/// @source   SO_ATTACH_REUSEPORT_CBPF, socket(7); the priority's offset is spec/hprotocol.md#hp-2's
[[nodiscard]] expected<void, SetupError> steer(const UdpPort& any_lane,
                                               std::span<const Priority> lane_lows);

}  // namespace rtpm::transport
