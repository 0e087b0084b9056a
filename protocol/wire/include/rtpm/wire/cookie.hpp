#pragma once

#include <cstdint>

#include "rtpm/base/hash.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/wire/handshake.hpp"

namespace rtpm::wire {

/// Where a frame came from, opaque to the protocol: equal values are the same peer. `high` and
/// `low` name its host, or its process in shared memory; `port` tells the peers of a host apart.
struct PeerAddress {
  std::uint64_t high = 0;
  std::uint64_t low = 0;
  std::uint32_t port = 0;
  friend bool operator==(const PeerAddress&, const PeerAddress&) noexcept = default;
};

/// Whether both are of one host: what is shared is limited per host.
[[nodiscard]] constexpr bool is_same_host(const PeerAddress& a, const PeerAddress& b) noexcept {
  return a.high == b.high && a.low == b.low;
}

/// Gives and checks cookies without remembering any: a forged address costs the server nothing.
/// RT: alloc-free.   Source: spec/hprotocol.md#hp-4.2; the idea is DTLS's (RFC 6347, 4.2.1).
class CookieJar {
 public:
  explicit CookieJar(SipKey key) noexcept : key_(key) {}
  [[nodiscard]] Cookie give(const PeerAddress& peer, std::uint64_t client_epoch,
                            MonotonicTime now) const noexcept;
  /// True if this jar gave `cookie` to that peer and client less than two kCookieSpan ago.
  [[nodiscard]] bool is_good(const Cookie& cookie, const PeerAddress& peer,
                             std::uint64_t client_epoch, MonotonicTime now) const noexcept;

 private:
  [[nodiscard]] Cookie make(const PeerAddress& peer, std::uint64_t client_epoch,
                            std::uint64_t span_number) const noexcept;
  SipKey key_;
};

}  // namespace rtpm::wire
