#pragma once

#include <netinet/in.h>

#include <cstdint>
#include <string>
#include <utility>

#include "rtpm/base/expected.hpp"
#include "rtpm/base/priority.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/transport/error.hpp"

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

/// The IPv4 address of a numeric address or host name.   Set-up only: may ask a name server.
[[nodiscard]] expected<sockaddr_in, TransportError> address_of(const std::string& host,
                                                               std::uint16_t port);

/// The numeric form of a host's IPv4 address, "127.0.0.1", so that nobody has to ask for it again.
/// Set-up only: may ask a name server.
[[nodiscard]] expected<std::string, TransportError> numeric_address_of(const std::string& host);

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
