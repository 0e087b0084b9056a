#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>

#include "bsd_sockets.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/transport/address.hpp"
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

/// Closes a descriptor.
/// @realtime alloc-free, one system call, or a few
void close(int descriptor) noexcept;
/// Another descriptor of the socket; not open if none is left.
[[nodiscard]] Descriptor duplicate(int socket) noexcept;
/// Whether the process has a descriptor of this number.
[[nodiscard]] bool is_open(int descriptor) noexcept;
/// Lets receives without MSG_DONTWAIT block, for at most `time`, below a second.
void limit_blocking(int socket, Duration time) noexcept;

/// Like poll(2), until a time; kNever for no limit, a time in the past to return at once.
/// @realtime alloc-free; one system call, or a few
[[nodiscard]] int poll_until(std::span<pollfd> entries, MonotonicTime until) noexcept;

/// Lets the lanes of this process share a UDP port, where they do, and no other program take it
/// away. Where a refused datagram would make the port's next receive fail, prevents that.
void prepare_server_port(int socket) noexcept;
/// Lets a restarted server bind its TCP port while old connections are still ending.
void prepare_listener(int socket) noexcept;
/// The address to bind in order to receive a multicast group's datagrams.
[[nodiscard]] SocketAddress address_to_hear(const SocketAddress& group) noexcept;

/// The number of this host's interface, as it stands in addresses of one link; 0 for another name.
/// @realtime set-up only
[[nodiscard]] std::uint32_t zone_of(const std::string& interface);
/// @realtime set-up only
[[nodiscard]] std::string name_of_zone(std::uint32_t zone);
/// The text for an error of getaddrinfo(3).
/// @realtime set-up only
[[nodiscard]] std::string lookup_error_text(int error);

/// The process at the other end of a UNIX socket when it connected.
struct PeerProcess {
  std::uint32_t process_id = 0;
  std::uint32_t user = 0;
};
/// @realtime alloc-free
[[nodiscard]] std::optional<PeerProcess> peer_process(int socket) noexcept;
/// Whether a user is this process's own, or root.
[[nodiscard]] bool is_own_or_root(std::uint32_t user) noexcept;

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
