#pragma once

#include <cstddef>

#include "rtpm/base/time.hpp"
#include "rtpm/events/limits.hpp"

namespace rtpm::events {

/// Token buckets of a quota.
class QuotaMeter {
 public:
  explicit QuotaMeter(const Quota& quota = {}) noexcept
      : quota_(quota),
        events_(quota.events_per_s * quota.burst_s),
        bytes_(quota.bytes_per_s * quota.burst_s) {}

  /// Whether an event of `size` bytes is within the quota; if so, consumes the quota.
  [[nodiscard]] bool take(std::size_t size, MonotonicTime now) noexcept {
    const double elapsed_s = now > last_ ? static_cast<double>((now - last_).count()) * 1e-9 : 0;
    last_ = now > last_ ? now : last_;
    refill(events_, quota_.events_per_s, elapsed_s);
    refill(bytes_, quota_.bytes_per_s, elapsed_s);
    const auto wanted = static_cast<double>(size);
    // An event larger than a burst passes only when the bucket is full.
    if (events_ < 1 || (bytes_ < wanted && bytes_ < quota_.bytes_per_s * quota_.burst_s)) {
      return false;
    }
    events_ -= 1;
    bytes_ -= wanted;
    return true;
  }

 private:
  void refill(double& level, double rate, double elapsed_s) const noexcept {
    const double full = rate * quota_.burst_s;
    level += rate * elapsed_s;
    if (level > full) level = full;
  }

  Quota quota_;
  double events_ = 0;
  double bytes_ = 0;
  MonotonicTime last_{};
};

}  // namespace rtpm::events
