#pragma once

#include <algorithm>
#include <cstdint>
#include <utility>

#include "rtpm/base/time.hpp"

namespace rtpm::inline base {

/// The rate at which a log accepts lines.
struct LogRate {
  std::uint32_t burst = 20;                     ///< Lines at once, at least 2.
  Duration interval = std::chrono::seconds{1};  ///< After the burst, one line per interval.
};

/// Limits the rate of a log: a token bucket that counts the lines it suppresses.
/// @threads  one at a time
/// @realtime alloc-free
class LogLimit {
 public:
  explicit LogLimit(LogRate rate = {}) noexcept : rate_(rate), tokens_(rate.burst) {}

  /// Whether a line may be written now; otherwise it counts as suppressed.
  [[nodiscard]] bool admit(MonotonicTime now) noexcept {
    refill(now);
    // The last token is reserved for the line that reports how many were suppressed.
    if (tokens_ > 1) {
      --tokens_;
      return true;
    }
    ++suppressed_count_;
    return false;
  }
  /// The number of lines suppressed since the last report; 0 while the rate allows no report.
  [[nodiscard]] std::uint64_t take_suppressed(MonotonicTime now) noexcept {
    refill(now);
    if (suppressed_count_ == 0 || tokens_ == 0) return 0;
    --tokens_;
    return std::exchange(suppressed_count_, 0);
  }
  /// The number of lines suppressed since the last report, ignoring the rate; for when the log
  /// ends.
  [[nodiscard]] std::uint64_t take_all_suppressed() noexcept {
    return std::exchange(suppressed_count_, 0);
  }

 private:
  void refill(MonotonicTime now) noexcept {
    if (!has_begun_) {
      has_begun_ = true;
      last_ = now;
    }
    const auto count = (now - last_) / rate_.interval;
    if (count <= 0) return;
    last_ += count * rate_.interval;
    tokens_ = static_cast<std::uint32_t>(
        std::min<std::int64_t>(rate_.burst, std::int64_t{tokens_} + count));
  }

  LogRate rate_;
  std::uint32_t tokens_;
  bool has_begun_ = false;
  MonotonicTime last_{};
  std::uint64_t suppressed_count_ = 0;
};

}  // namespace rtpm::inline base
