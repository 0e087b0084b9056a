#include "rtpm/wire/rate_limiter.hpp"

#include <algorithm>

#include "rtpm/base/bytes.hpp"

namespace rtpm::wire {

bool RateLimiter::admit(const PeerAddress& host, MonotonicTime now) noexcept {
  std::array<std::byte, 16> seed{};
  ByteWriter writer(seed);
  writer.put(host.high);
  // Hosts are compared like in is_same_host().
  writer.put(host.high == 0 ? host.low : std::uint64_t{0});
  MonotonicTime& full_at = full_at_[siphash_2_4(key_, seed) % kBucketCount];
  const MonotonicTime begin = std::max(full_at, now);
  if (begin - now > tolerance_) return false;
  full_at = begin + interval_;
  return true;
}

}  // namespace rtpm::wire
