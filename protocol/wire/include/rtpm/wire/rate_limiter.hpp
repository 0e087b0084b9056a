#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "rtpm/base/hash.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/wire/cookie.hpp"

namespace rtpm::wire {

/// Limits the rate of an action for each host: `burst` times at once, then once per `interval`.
/// Uses a fixed table of token buckets; hosts whose keyed hashes collide share one, so memory does
/// not grow with the number of hosts.
/// @threads  one
/// @realtime alloc-free
/// @source   ATM Forum's generic cell rate algorithm, virtual scheduling
class RateLimiter {
 public:
  RateLimiter(SipKey key, std::uint32_t burst, Duration interval) noexcept
      : key_(key), interval_(interval), tolerance_(interval * (burst - 1)) {}

  /// Takes a token from the host's bucket; false if it is empty.
  [[nodiscard]] bool admit(const PeerAddress& host, MonotonicTime now) noexcept;

 private:
  static constexpr std::size_t kBucketCount = 64;

  SipKey key_;
  Duration interval_;
  Duration tolerance_;
  std::array<MonotonicTime, kBucketCount> full_at_{};  ///< When each bucket will be full again.
};

}  // namespace rtpm::wire
