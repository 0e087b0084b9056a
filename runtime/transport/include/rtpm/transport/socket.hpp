#pragma once

#include <chrono>
#include <cstdint>
#include <string>
#include <utility>

#include "rtpm/base/priority.hpp"
#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/transport/error.hpp"
#include "rtpm/wire/cookie.hpp"

namespace rtpm::transport {

/// Owns a file descriptor, on Windows the handle of a socket or a file, and closes it.
class Descriptor {
 public:
  Descriptor() noexcept = default;
  explicit Descriptor(int number) noexcept : number_(number) {}
  Descriptor(Descriptor&& other) noexcept : number_(std::exchange(other.number_, -1)) {}
  Descriptor& operator=(Descriptor&& other) noexcept {
    std::swap(number_, other.number_);
    return *this;
  }
  ~Descriptor();
  [[nodiscard]] int number() const noexcept { return number_; }
  [[nodiscard]] bool is_open() const noexcept { return number_ >= 0; }

 private:
  int number_ = -1;
};

/// The result of accepting a connection.
struct Accepted {
  Descriptor socket{};  ///< Not open if no connection is waiting, or with `shortage`.
  int shortage = 0;     ///< EMFILE or ENFILE: no descriptor was left for the connection.
  /// The connection could not even be closed, and keeps waking its acceptor.
  bool still_waits = false;
};

/// The system's text for an error number: "Connection refused".
/// @threads  the text stays valid; some systems replace the text of an unknown number
[[nodiscard]] const char* error_text(int error) noexcept;

/// The error for when the system gave no descriptor or memory for `what`, with cause and remedy by
/// error number.
[[nodiscard]] SetupError no_descriptor(const std::string& what, int error);
/// The remedy for a shortage with this error number: "raise the limit of open files (ulimit -n;
/// …).".
[[nodiscard]] const char* remedy_for_shortage(int error) noexcept;
/// Whether the error means that the system or the process has no descriptor or memory left.
[[nodiscard]] bool is_shortage(int error) noexcept;

/// The peer of a connected socket, without a port: its host or, for a UNIX socket, its process as
/// the kernel reports it. All 0 if unknown.
/// @realtime alloc-free, at most two system calls
[[nodiscard]] wire::PeerAddress host_of(int socket) noexcept;

/// The user of a UNIX socket's peer at the time of its connect or listen, as the kernel reports it;
/// nullopt if unknown.
/// @realtime alloc-free, one system call
[[nodiscard]] std::optional<std::uint32_t> user_of(int socket) noexcept;

/// Whether the peer of a connected socket is on this host: its address is loopback, or the one that
/// it called.
/// @realtime alloc-free, at most two system calls
[[nodiscard]] bool is_from_this_host(int socket) noexcept;

/// 127.0.0.1 as a peer.
[[nodiscard]] wire::PeerAddress this_host() noexcept;

/// The error for when `what` cannot be served, with cause and remedy by the error number of bind(2)
/// or listen(2).
[[nodiscard]] SetupError not_served(const std::string& what, int error);

/// Marks the socket's traffic by its priority: DSCP EF for the top quarter, then AF41, AF21, best
/// effort; and SO_PRIORITY 6, 4, 2, 0 for VLANs and queueing disciplines. If the system refuses,
/// the traffic stays best effort, which matters only on a busy link.
void set_traffic_class(int socket, Priority priority) noexcept;

/// Blocks until the descriptor is readable (writable), at most until `until`; false after that or
/// after a signal.
/// @realtime alloc-free, one system call
bool wait_readable(int descriptor, MonotonicTime until) noexcept;
bool wait_writable(int descriptor, MonotonicTime until) noexcept;

/// How long a blocking receive waits, approximately, and by how much it may overrun: the kernel
/// counts ticks of up to 10 ms. Such a receive saves a poll and its timer if the end need not be
/// precise.
inline constexpr Duration kBlockTime = std::chrono::milliseconds{40};
inline constexpr Duration kBlockTimeError = std::chrono::milliseconds{20};
/// The wait of a blocking receive whose caller has other work soon.
inline constexpr Duration kBlockTimeShort = std::chrono::milliseconds{4};
/// Lets receives without MSG_DONTWAIT block for `time`. Set-up only.
void limit_blocking(int socket, Duration time = kBlockTime) noexcept;
/// Whether a wait until `until` is long enough for such a receive.
[[nodiscard]] bool may_block_until(MonotonicTime until, Duration time = kBlockTime) noexcept;

}  // namespace rtpm::transport
