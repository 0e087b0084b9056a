#pragma once

#include <netinet/in.h>

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

/// Owns a file descriptor and closes it.
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

/// What came of accepting.
struct Accepted {
  Descriptor socket{};  ///< Not open: nobody is there, or `shortage`.
  int shortage = 0;     ///< EMFILE or ENFILE: no descriptor was left for the one that is there.
  /// Of a shortage: not even one to turn it away with. It waits on, and so wakes its acceptor.
  bool still_waits = false;
};

/// How long a name server may take where no deadline is given.
inline constexpr Duration kResolvePatience = std::chrono::seconds{5};

/// The IPv4 address of a numeric address, or of a host name, which is asked for on a thread of its
/// own: that may outlive `deadline`, but few do at a time.   Set-up only.
/// Errors: the name has no IPv4 address; it was not answered by `deadline`.
[[nodiscard]] expected<sockaddr_in, SetupError> address_of(const std::string& host,
                                                           std::uint16_t port,
                                                           MonotonicTime deadline);
/// By kResolvePatience from now on.
[[nodiscard]] expected<sockaddr_in, SetupError> address_of(const std::string& host,
                                                           std::uint16_t port);

/// The numeric form of a host's IPv4 address, "127.0.0.1", so that nobody has to ask for it again.
/// Set-up only.   Errors: as address_of().
[[nodiscard]] expected<std::string, SetupError> numeric_address_of(const std::string& host,
                                                                   MonotonicTime deadline);

/// Why the system gave no descriptor, or no memory, for `what`, and what to do, by its error
/// number. Set-up only.
[[nodiscard]] SetupError no_descriptor(const std::string& what, int error);
/// "raise the limit of open files (ulimit -n; …)." by the error number of a shortage.
[[nodiscard]] const char* remedy_for_shortage(int error) noexcept;
/// Whether it says that the system, or the process, has no descriptor or memory left.
[[nodiscard]] bool is_shortage(int error) noexcept;

/// Who is at the other end of a connected socket, without a port: its host; or, of a UNIX socket,
/// its process, as the kernel says it. All 0 if that can't be known.
/// @realtime alloc-free, at most two system calls
[[nodiscard]] wire::PeerAddress host_of(int socket) noexcept;

/// What a person can do about a port that can't be served, by the error of bind(2) or listen(2).
/// Set-up only.
[[nodiscard]] std::string remedy_for_bind(int error);

/// Has the network treat the socket's traffic by its priority: DSCP (EF for the top quarter, AF41,
/// AF21, best effort below) and SO_PRIORITY 6, 4, 2, 0, which VLANs and queueing disciplines read.
/// A system that refuses leaves the traffic best effort, which only a busy link shows.
void set_traffic_class(int socket, Priority priority) noexcept;

/// Blocks until the descriptor can be read (or written), or until `until`; false if it was the time
/// or a signal.   RT: alloc-free, one syscall.
bool wait_readable(int descriptor, MonotonicTime until) noexcept;
bool wait_writable(int descriptor, MonotonicTime until) noexcept;

/// About how long a receive blocks that is meant to, and by how much that may be too long, as the
/// system counts in ticks of up to 10 ms. It spares the poll before it and a timer of its own,
/// which costs more than the poll, where nobody needs the wait to end to the nanosecond.
inline constexpr Duration kBlockTime = std::chrono::milliseconds{40};
inline constexpr Duration kBlockTimeError = std::chrono::milliseconds{20};
/// The same for one that has something to do by itself soon.
inline constexpr Duration kBlockTimeShort = std::chrono::milliseconds{4};
/// Has receives on the socket block for `time`, where they don't say that they must not.
/// Set-up only.
void limit_blocking(int socket, Duration time = kBlockTime) noexcept;
/// Whether a wait until then is long enough to begin with such a receive.   RT: alloc-free.
[[nodiscard]] bool may_block_until(MonotonicTime until, Duration time = kBlockTime) noexcept;

}  // namespace rtpm::transport
