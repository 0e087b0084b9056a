#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>

#include "rtpm/base/bytes.hpp"
#include "rtpm/base/priority.hpp"
#include "rtpm/base/setup_error.hpp"
#include "rtpm/transport/datagram_batch.hpp"
#include "rtpm/transport/socket.hpp"
#include "rtpm/wire/cookie.hpp"

namespace rtpm::transport {

/// The IPv4 address that a datagram came from, 127.0.0.1 being 0x7f000001.   RT: alloc-free.
[[nodiscard]] std::uint32_t ipv4_of(const wire::PeerAddress& peer) noexcept;

/// What a lane's UDP socket is opened for.
struct UdpPortConfig {
  std::string host = "127.0.0.1";
  std::uint16_t port = 0;
  Priority priority = 0;  ///< Of what it sends: see set_traffic_class().
  Priority low = 0;       ///< The lowest priority that steer() hands it.
  bool joins = false;     ///< The port is a further one of a server's, not its first.
};

/// A lane's UDP socket. All lanes of a server share one port: the kernel steers each datagram to
/// the lane of its priority (see steer()).
/// Threads: one at a time, but for wake().
class UdpPort {
 public:
  /// Set-up only.   Errors: the port is taken, the address is not this host's.
  [[nodiscard]] static expected<UdpPort, SetupError> open(const UdpPortConfig& config);

  /// A datagram, or several that came together, into `buffer`, which holds Datagrams::kSizeMax.
  /// RT: alloc-free, one syscall, never blocks.
  [[nodiscard]] expected<Datagrams, IoError> receive(MutableBytes buffer) noexcept;
  /// When receive() gave these: whether batches are to be taken follows from it, see
  /// BatchEstimator. RT: alloc-free, a syscall where that changes.
  void note(const Datagrams& datagrams, MonotonicTime received) noexcept {
    const auto change = sense_.on_datagrams(datagrams.peer(), datagrams.are_several(), received);
    if (change != BatchEstimator::Change::kNone) heed(change);
  }

  /// Waits for datagrams, for kBlockTime at most, and receives them into `buffer`: the next
  /// receive() gives them, wherever that is told to put them. False: none came, or wake() ended the
  /// wait. RT: alloc-free, one syscall, where a poll and a receive are two.
  [[nodiscard]] bool await(MutableBytes buffer) noexcept;
  /// Whether await() received a datagram that receive() has not given yet.
  [[nodiscard]] bool has_received() const noexcept { return awaited_.has_value(); }
  /// Ends the await() that another thread is in, or the next one, by a datagram to itself. Should
  /// that be lost, as by a packet filter, await() ends in its time.
  /// False: the system did not take it.   Threads: any.   RT: alloc-free, one syscall.
  bool wake() noexcept;
  /// How many datagrams of wake() have come.
  [[nodiscard]] std::uint64_t woken_count() const noexcept { return woken_count_; }
  /// RT: alloc-free, one syscall, never blocks.
  [[nodiscard]] expected<void, IoError> send(const wire::PeerAddress& peer,
                                             ConstBytes frame) noexcept;
  /// The same of several frames, together where the system can; some may have gone where it gives
  /// an error.   RT: alloc-free, one syscall, never blocks; where the system can't, one a frame.
  [[nodiscard]] expected<void, IoError> send_batch(const wire::PeerAddress& peer,
                                                   const DatagramBatch& batch) noexcept;
  [[nodiscard]] int descriptor() const noexcept { return socket_.number(); }

 private:
  UdpPort(Descriptor socket, Priority low) noexcept : socket_(std::move(socket)), low_(low) {}
  [[nodiscard]] bool open_waker() noexcept;
  [[nodiscard]] expected<Datagrams, IoError> receive(MutableBytes buffer, int flags) noexcept;
  void heed(BatchEstimator::Change change) noexcept;

  Descriptor socket_;
  Descriptor waker_;                ///< Connected to the port.
  wire::PeerAddress waker_peer_{};  ///< Whom its datagrams come from.
  Priority low_;
  bool can_send_batches_ = true;
  BatchEstimator sense_;
  std::uint64_t woken_count_ = 0;
  std::optional<Datagrams> awaited_;
};

/// Has the kernel hand each datagram to the lane that serves the priority in its header.
/// `lane_lows` are the lowest priorities of the lanes, ascending from 0, in the order in which
/// their ports were opened; `any_lane` is one of those ports.   Set-up only. Source:
/// SO_ATTACH_REUSEPORT_CBPF, socket(7); the priority's offset is spec/hprotocol.md#hp-2's.
[[nodiscard]] expected<void, SetupError> steer(const UdpPort& any_lane,
                                               std::span<const Priority> lane_lows);

}  // namespace rtpm::transport
