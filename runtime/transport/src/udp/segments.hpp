#pragma once

#include <netinet/in.h>
#include <sys/types.h>

#include "rtpm/base/bytes.hpp"
#include "rtpm/base/expected.hpp"
#include "rtpm/transport/datagram_batch.hpp"
#include "rtpm/transport/error.hpp"

// How batches of datagrams pass a socket.
namespace rtpm::transport {

/// Has the socket take the datagrams of a batch together, or no longer; those that came before are
/// given as they came. A system that refuses gives them one by one.   RT: alloc-free, one syscall.
void accept_segments(int socket, bool is_on) noexcept;

/// As sendmsg(2), of several datagrams; `to` is null where the socket is connected.
/// RT: alloc-free, one syscall.
[[nodiscard]] ssize_t send_segments(int socket, const sockaddr_in* to,
                                    const DatagramBatch& batch) noexcept;
/// Whether an error of send_segments() means that the socket's way takes no batches, but may take
/// datagrams.
[[nodiscard]] bool means_no_batches(int error) noexcept;

/// Sends each frame of a batch by itself, up to the first that fails.
template <class Send>
[[nodiscard]] expected<void, IoError> send_each(const DatagramBatch& batch, Send send) noexcept {
  expected<void, IoError> outcome;
  static_cast<void>(batch.for_each([&](ConstBytes frame) {
    outcome = send(frame);
    return outcome.has_value();
  }));
  return outcome;
}

/// As recvmsg(2); `each` becomes the size of each datagram but the last. `from` may be null.
/// RT: alloc-free, one syscall.
[[nodiscard]] ssize_t receive_segments(int socket, MutableBytes buffer, sockaddr_in* from,
                                       int flags, std::size_t& each) noexcept;

}  // namespace rtpm::transport
