#pragma once

#include <cstdint>

#include "rtpm/base/hash.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/wire/handshake.hpp"

namespace rtpm::wire {

/// The origin of a frame, opaque to the protocol: equal values mean the same peer. `high` and `low`
/// identify its host, or its process in shared memory; `port` distinguishes the peers of a host. A
/// nonzero `high` is the first 64 bits of an IPv6 address: a /64 counts as one host, because a host
/// can use any address of its /64.
struct PeerAddress {
  std::uint64_t high = 0;
  std::uint64_t low = 0;
  std::uint32_t port = 0;
  friend bool operator==(const PeerAddress&, const PeerAddress&) noexcept = default;
};

/// Whether both are on the same host: quotas are per host, and per IPv6 /64.
[[nodiscard]] constexpr bool is_same_host(const PeerAddress& a, const PeerAddress& b) noexcept {
  return a.high == b.high && (a.high != 0 || a.low == b.low);
}

/// Issues and checks cookies without storing them: a forged address costs the server no memory.
/// @realtime alloc-free
/// @source   spec/hprotocol.md#hp-4.2; the idea is DTLS's (RFC 6347, 4.2.1)
class CookieJar {
 public:
  explicit CookieJar(SipKey key) noexcept : key_(key) {}
  [[nodiscard]] Cookie give(const PeerAddress& peer, std::uint64_t client_epoch,
                            MonotonicTime now) const noexcept;
  /// Whether this jar issued `cookie` to that peer and client less than two kCookieSpan ago.
  [[nodiscard]] bool is_good(const Cookie& cookie, const PeerAddress& peer,
                             std::uint64_t client_epoch, MonotonicTime now) const noexcept;

 private:
  [[nodiscard]] Cookie make(const PeerAddress& peer, std::uint64_t client_epoch,
                            std::uint64_t span_number) const noexcept;
  SipKey key_;
};

}  // namespace rtpm::wire
