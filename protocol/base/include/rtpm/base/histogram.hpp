#pragma once

#include <array>
#include <cstdint>

#include "rtpm/base/time.hpp"

namespace rtpm::inline base {

/// Counts latencies from 1 ns to over four hours in buckets no wider than 1.6 % of their value, so
/// that p99.99 of millions of samples needs neither memory nor sorting.
/// @ownership 64 KiB in place; make it static or a member, not a local variable of a lane thread
/// @threads  one at a time
/// @realtime record() is alloc-free, a few ns
class LatencyHistogram {
 public:
  /// Adds one sample; negative ones count as 0.
  void record(Duration latency) noexcept;
  void clear() noexcept { *this = LatencyHistogram{}; }

  [[nodiscard]] std::uint64_t count() const noexcept { return count_; }
  /// The latency that `percent` (0…100) of the samples do not exceed; 0 without samples. At most
  /// 1.6 % too high, and never above max().
  [[nodiscard]] Duration percentile(double percent) const noexcept;
  [[nodiscard]] Duration min() const noexcept { return count_ == 0 ? Duration{0} : min_; }
  [[nodiscard]] Duration max() const noexcept { return max_; }
  [[nodiscard]] Duration mean() const noexcept {
    return count_ == 0 ? Duration{0} : Duration{static_cast<Duration::rep>(sum_ / count_)};
  }

 private:
  static constexpr int kSubBits = 6;
  static constexpr int kSubCount = 1 << kSubBits;
  static constexpr int kMagnitudes = 40;
  static constexpr int kBucketCount = kSubCount * (kMagnitudes + 1);

  [[nodiscard]] static int bucket_of(std::uint64_t ns) noexcept;
  [[nodiscard]] static std::uint64_t upper_end_of(int bucket) noexcept;

  std::array<std::uint64_t, kBucketCount> buckets_{};
  std::uint64_t count_ = 0;
  std::uint64_t sum_ = 0;
  Duration min_ = Duration::max();
  Duration max_{0};
};

}  // namespace rtpm::inline base
