#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "bsd_sockets.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/transport/socket.hpp"

/// Calls that systems add to BSD's for sockets, or make differently. Errors are in errno.
namespace rtpm::transport::os {

/// Whether a socket's calls without MSG_DONTWAIT block.
enum class Blocking : bool { kNo, kYes };

/// Opens a socket that child processes do not inherit.
/// @realtime one or a few system calls
[[nodiscard]] Descriptor open_socket(int family, int type, Blocking blocking) noexcept;
/// Accepts the next connection of a listening socket likewise.
/// @realtime one or a few system calls
[[nodiscard]] Descriptor accept_from(int listener, Blocking blocking) noexcept;

/// Whether the process has a descriptor of this number.
[[nodiscard]] bool is_open(int descriptor) noexcept;
/// Lets receives without MSG_DONTWAIT block, for at most `time`, below a second.
void limit_blocking(int socket, Duration time) noexcept;

/// Like poll(2), until a time; kNever for no limit, a time in the past to return at once.
/// @realtime alloc-free; one system call, or a few
[[nodiscard]] int poll_until(std::span<pollfd> entries, MonotonicTime until) noexcept;

/// The process at the other end of a UNIX socket when it connected.
struct PeerProcess {
  std::uint32_t process_id = 0;
  std::uint32_t user = 0;
};
/// @realtime alloc-free
[[nodiscard]] std::optional<PeerProcess> peer_process(int socket) noexcept;

/// Enlarges the receive buffer beyond the system's limit if the process has the right.
void enlarge_receive_buffer(int socket, int size) noexcept;
/// Chooses the queue of VLANs and queueing disciplines, 0 to 6.
void set_queue(int socket, int queue) noexcept;
/// Makes a stream end after a peer's silence: keep-alive after 5 s, end after 3 s without
/// acknowledgement.
void limit_silence(int stream) noexcept;
/// How many sent bytes of a stream its peer has not acknowledged; nullopt if unknown.
/// @realtime alloc-free, one system call
[[nodiscard]] std::optional<std::size_t> unacknowledged_size(int stream) noexcept;
/// Makes the system refuse a datagram that would be fragmented on its path.
void keep_whole(int socket) noexcept;
/// Lets a socket receive only from groups that it has joined itself.
/// @return false if the system refuses
[[nodiscard]] bool hear_joined_groups_only(int socket) noexcept;

}  // namespace rtpm::transport::os
