#pragma once

#include <cstdint>
#include <string>

#include "rtpm/base/bytes.hpp"
#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/transport/error.hpp"
#include "rtpm/transport/socket.hpp"

/// Datagrams that one sends and any number receive: UDP to an IPv4 multicast group.
namespace rtpm::transport {

/// A group and how it is reached.
struct MulticastGroup {
  std::string group = "239.255.42.1";  ///< 224.0.0.0/4; 239/8 stays within a site.
  std::uint16_t port = 7422;
  /// The address of the interface to send by or to receive at; empty: as the system's routes say.
  std::string interface {};
  std::uint8_t hops =
      1;  ///< Of the sender: 1 stays in the LAN, as routers count it down; 0: on this host.
};

/// Sends to a group.   Threads: one at a time.
class MulticastSender {
 public:
  /// Programs on this host, too, receive what is sent.   Set-up only.
  /// Errors: no group, no such interface, no descriptor left.
  [[nodiscard]] static expected<MulticastSender, SetupError> open(const MulticastGroup& group);
  /// False if the system has no room now, or the network is gone: the datagram is lost.
  /// RT: alloc-free, one syscall.
  [[nodiscard]] bool send(ConstBytes datagram) noexcept;

 private:
  MulticastSender(Descriptor socket, sockaddr_in to) noexcept
      : socket_(std::move(socket)), to_(to) {}
  Descriptor socket_;
  sockaddr_in to_;
};

/// Receives what is sent to a group.   Threads: one.
class MulticastReceiver {
 public:
  /// Joins the group. Several programs of a host may.   Set-up only.
  /// Errors: no group, no such interface, the port is another's.
  [[nodiscard]] static expected<MulticastReceiver, SetupError> open(const MulticastGroup& group);
  /// The next datagram, a view of `buffer`; empty: none is there.   RT: alloc-free, one syscall.
  [[nodiscard]] ConstBytes receive(MutableBytes buffer) noexcept;
  /// Can be read while there is one.
  [[nodiscard]] int descriptor() const noexcept { return socket_.number(); }
  /// Waits until there is one, or until `until`; false if it was the time.   RT: alloc-free, one
  /// syscall.
  bool wait(MonotonicTime until) noexcept { return wait_readable(socket_.number(), until); }

 private:
  explicit MulticastReceiver(Descriptor socket) noexcept : socket_(std::move(socket)) {}
  Descriptor socket_;
};

}  // namespace rtpm::transport
