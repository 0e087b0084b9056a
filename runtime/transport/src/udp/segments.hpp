#pragma once

#include <cstddef>

#include "rtpm/base/bytes.hpp"
#include "rtpm/base/expected.hpp"
#include "rtpm/transport/address.hpp"
#include "rtpm/transport/datagram_batch.hpp"
#include "rtpm/transport/error.hpp"

// Batches of datagrams on a socket. All functions are alloc-free, one system call each.
namespace rtpm::transport {

/// Lets the socket receive the datagrams of a batch together, or stops that; batches already
/// received are not affected. A kernel without support delivers datagrams singly.
void accept_segments(int socket, bool is_on) noexcept;

/// Sends several datagrams, like sendmsg(2) for one.
/// @param to    null if the socket is connected
/// @param from  the local address to send from; null for the socket's, or by the route
[[nodiscard]] std::ptrdiff_t send_segments(int socket, const SocketAddress* to,
                                           const SocketAddress* from,
                                           const DatagramBatch& batch) noexcept;
/// Sends one datagram from the local address `from`.
[[nodiscard]] std::ptrdiff_t send_from(int socket, const SocketAddress& to,
                                       const SocketAddress& from, ConstBytes datagram) noexcept;
/// Whether an error of send_segments() means that the path does not support batches but may support
/// single datagrams.
[[nodiscard]] bool means_no_batches(int error) noexcept;

/// Sends the frames of a batch one by one, up to the first error.
template <class Send>
[[nodiscard]] expected<void, IoError> send_each(const DatagramBatch& batch, Send send) noexcept {
  expected<void, IoError> outcome;
  static_cast<void>(batch.for_each([&](ConstBytes frame) {
    outcome = send(frame);
    return outcome.has_value();
  }));
  return outcome;
}

/// Lets receive_datagrams() return the address at which a datagram arrived.
/// @return false if the system refuses
[[nodiscard]] bool receive_destinations(int socket, const SocketAddress& own) noexcept;

/// Receives like recvfrom(2), or like recvmsg(2) if the socket accepts segments or reports
/// destinations.
/// @param from  may be null
/// @param to    may be null; without a family if the system does not report it
/// @param each  receives the size of each datagram except the last
[[nodiscard]] std::ptrdiff_t receive_datagrams(int socket, bool are_segments, MutableBytes buffer,
                                               SocketAddress* from, SocketAddress* to, int flags,
                                               std::size_t& each) noexcept;

}  // namespace rtpm::transport
