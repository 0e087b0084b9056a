#include "rtpm/wire/cookie.hpp"

namespace rtpm::wire {
namespace {

std::uint64_t span_of(MonotonicTime now) noexcept {
  return static_cast<std::uint64_t>(now.time_since_epoch() / kCookieSpan);
}

}  // namespace

Cookie CookieJar::make(const PeerAddress& peer, std::uint64_t client_epoch,
                       std::uint64_t span_number) const noexcept {
  std::array<std::byte, 40> input{};
  ByteWriter text(input);
  text.put(peer.high);
  text.put(peer.low);
  text.put(peer.port);
  text.put(std::uint32_t{0});
  text.put(client_epoch);
  text.put(span_number);
  Cookie cookie{};
  ByteWriter writer(cookie);
  writer.put(siphash_2_4(key_, input));
  writer.put(span_number);
  return cookie;
}

Cookie CookieJar::give(const PeerAddress& peer, std::uint64_t client_epoch,
                       MonotonicTime now) const noexcept {
  return make(peer, client_epoch, span_of(now));
}

// The comparison need not be constant-time: a cookie proves an address, and an attacker that can
// measure the answer time at that address already receives there.
bool CookieJar::is_good(const Cookie& cookie, const PeerAddress& peer, std::uint64_t client_epoch,
                        MonotonicTime now) const noexcept {
  const std::uint64_t current = span_of(now);
  return cookie == make(peer, client_epoch, current) ||
         (current > 0 && cookie == make(peer, client_epoch, current - 1));
}

}  // namespace rtpm::wire
