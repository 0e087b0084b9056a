#pragma once

#include <algorithm>
#include <atomic>
#include <cstdint>

#include "rtpm/base/time.hpp"

namespace rtpm::rpc {

/// Limits how many handshakes a server starts, over all lanes and hosts: a burst at once, then one
/// per kInterval. Further ones get no answer; their clients retry.
/// @threads  any
/// @realtime alloc-free, lock-free
/// @source   ATM Forum's generic cell rate algorithm, virtual scheduling
class HandshakeRate {
 public:
  /// 500 per second; each takes 0.25 ms of the gatekeeper's thread.
  static constexpr Duration kInterval = std::chrono::milliseconds{2};
  static constexpr int kBurst = 256;  ///< All clients of a restarted server return at once.

  [[nodiscard]] bool admit(MonotonicTime now) noexcept {
    const std::int64_t now_ns = to_ns(now);
    std::int64_t full_at = full_at_ns_.load(std::memory_order_relaxed);
    while (full_at - now_ns <= Duration(kInterval * (kBurst - 1)).count()) {
      const std::int64_t next = std::max(full_at, now_ns) + Duration(kInterval).count();
      if (full_at_ns_.compare_exchange_weak(full_at, next, std::memory_order_relaxed)) return true;
    }
    return false;
  }

 private:
  std::atomic<std::int64_t> full_at_ns_{0};
};

}  // namespace rtpm::rpc
