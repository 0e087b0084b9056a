#pragma once

#include <netinet/in.h>
#include <sys/types.h>

#include "rtpm/base/bytes.hpp"
#include "rtpm/base/expected.hpp"
#include "rtpm/transport/datagram_batch.hpp"
#include "rtpm/transport/error.hpp"

// Batches of datagrams on a socket. All is alloc-free, one system call each.
namespace rtpm::transport {

/// Lets the socket receive the datagrams of a batch together, or no longer; batches that came
/// before stay as they came. A kernel that refuses delivers them one by one.
void accept_segments(int socket, bool is_on) noexcept;

/// As sendmsg(2), for several datagrams.
/// @param to  null: the socket is connected
[[nodiscard]] ssize_t send_segments(int socket, const sockaddr_in* to,
                                    const DatagramBatch& batch) noexcept;
/// Whether an error of send_segments() means that the path takes no batches but may take datagrams.
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

/// As recvfrom(2), or as recvmsg(2) if the socket accepts segments.
/// @param from  may be null
/// @param each  receives the size of each datagram but the last
[[nodiscard]] ssize_t receive_datagrams(int socket, bool are_segments, MutableBytes buffer,
                                        sockaddr_in* from, int flags, std::size_t& each) noexcept;

}  // namespace rtpm::transport
