#pragma once

#include <cstdint>
#include <string>

#include "rtpm/base/bytes.hpp"
#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/transport/error.hpp"
#include "rtpm/transport/socket.hpp"

/// Datagrams from one sender to many receivers: UDP to an IPv4 multicast group.
namespace rtpm::transport {

struct MulticastGroup {
  /// In 224.0.0.0/4; groups in 239.0.0.0/8 stay within a site.
  std::string group = "239.255.42.1";
  std::uint16_t port = 7422;
  /// The address of the network interface; if empty, the system's routes choose one.
  std::string interface {};
  std::uint8_t hops = 1;  ///< The sender's TTL: 1 for the LAN, 0 for this host.
};

/// @threads  one at a time
class MulticastSender {
 public:
  /// Opens a sender. Programs on this host receive the datagrams, too.
  /// @realtime set-up only
  /// @errors   no such group, no such interface, no descriptor left
  [[nodiscard]] static expected<MulticastSender, SetupError> open(const MulticastGroup& group);
  /// @return false if the socket's buffer is full or the network is gone; then the datagram is lost
  /// @realtime alloc-free, one system call
  [[nodiscard]] bool send(ConstBytes datagram) noexcept;

 private:
  MulticastSender(Descriptor socket, std::uint32_t group, std::uint16_t port) noexcept
      : socket_(std::move(socket)), group_(group), port_(port) {}
  Descriptor socket_;
  std::uint32_t group_;  ///< 239.255.42.1 is 0xefff2a01.
  std::uint16_t port_;
};

/// @threads  one
class MulticastReceiver {
 public:
  /// Joins the group. Several programs on a host may join.
  /// @realtime set-up only
  /// @errors   no such group, no such interface, another program has the port
  [[nodiscard]] static expected<MulticastReceiver, SetupError> open(const MulticastGroup& group);
  /// Returns the next datagram, a view of `buffer`; empty if there is none.
  /// @realtime alloc-free, one system call
  [[nodiscard]] ConstBytes receive(MutableBytes buffer) noexcept;
  /// A descriptor that is readable while there is a datagram.
  [[nodiscard]] int descriptor() const noexcept { return socket_.number(); }
  /// Waits for a datagram until `until`; false if none arrived in time.
  /// @realtime alloc-free, one system call
  bool wait(MonotonicTime until) noexcept { return wait_readable(socket_.number(), until); }

 private:
  explicit MulticastReceiver(Descriptor socket) noexcept : socket_(std::move(socket)) {}
  Descriptor socket_;
};

}  // namespace rtpm::transport
